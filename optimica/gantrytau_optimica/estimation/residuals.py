"""Residuals of a fit and their Jacobian by the estimated parameters, on the manifold of the equations of the model.

    w = (p, y): estimated parameters, all other unknowns; G(p, y) = 0: collocated equations and starts; r(p, y): residuals
    dr/dp = r_p - r_y G_y^-1 G_p

All Jacobians are exact; G_y is factorised once. Bard (1974), Nonlinear Parameter Estimation, section 5.4, with the
equations of the model as constraints.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from gantrytau import ModelError
from gantrytau_optimica.transcription.assemble import Assembled
from gantrytau_optimica.transcription.costs import sample_errors
from gantrytau_optimica.transcription.point_functions import running
from gantrytau_optimica.transcription.program import Program

NEWTON_STEPS = 30
CLOSE = 1e-9  # of typical sizes: the last step of Newton's method onto the manifold
# the last one with the Jacobian of another point, and what each of these must gain
CLOSER, CHORD = (1e-12, 0.1)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals (N,) over standard deviations of all samples, with their exact Jacobian; w: unscaled unknowns (n,).

    sizes: number of residuals of every sum over samples, in the order of the phases.
    """

    program: Program
    assembled: Assembled
    sizes: tuple[int, ...]
    # Jacobian of the equations where they were factorised last
    _last: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def _of_samples(self) -> "_Sparse":
        return _Sparse.of(self.assembled.jac_g, self.program.places.scale)

    @cached_property
    def _of_rows(self) -> "_Sparse":
        return _Sparse.of(self.program.assembled.jac_g, self.program.places.scale)

    @property
    def total(self) -> int:
        """N."""
        return sum(self.sizes)

    def values(self, w: np.ndarray) -> np.ndarray:
        """(model - measured) / deviation, (N,)."""
        return np.array(self.assembled.nlp(w / self.program.places.scale, [])[1]).ravel()

    @cached_property
    def equations(self) -> np.ndarray:
        """Indices of the rows with equations."""
        return np.flatnonzero(self.program.lbg == self.program.ubg)

    @cached_property
    def others(self) -> np.ndarray:
        """Indices of the unknowns other than estimated parameters."""
        return np.setdiff1d(np.arange(self.program.places.size), self.program.places.free)

    def jacobian(self, w: np.ndarray) -> np.ndarray:
        """Jacobian (N, k) with respect to the free parameters in their units."""
        program, free = self.program, self.program.places.free
        by_unknowns = self._of_samples.at(w)
        found = by_unknowns[:, free].toarray()
        if self.others.size:
            equations, factors = self._factorised(w)
            moved = factors.solve(equations[:, free].toarray())
            found = found - by_unknowns[:, self.others] @ moved
        return found / program.places.scale[free]

    def defects(self, w: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """First-order change (equations, k) of rows (k, N) @ residuals by the defect of each equation at w.

        For unknowns that are carried over from another mesh and do not fulfil the equations of this one.
        """
        scaled = w / self.program.places.scale
        _, factors = self._factorised(w)
        values = np.array(self.program.assembled.nlp(scaled, [])[1]).ravel()
        by_unknowns = self._of_samples.at(w)[:, self.others]
        adjoint = factors.solve((by_unknowns.T @ rows.T), trans="T")
        return -adjoint * (values - self.program.lbg)[self.equations, None]

    def multipliers(self, w: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Multipliers of the equations and of limits of free parameters; gradient: scaled, of the objective, (n,)."""
        if not self.others.size:
            return np.zeros(0), -gradient[self.program.places.free]
        equations, factors = self._factorised(w)
        found = factors.solve(-gradient[self.others], trans="T")
        free = self.program.places.free
        return found, -gradient[free] - equations[:, free].T @ found

    def on_manifold(self, w: np.ndarray, numbers: np.ndarray) -> np.ndarray | None:
        """Solution of the equations for other free parameters, by Newton's method from w; None if it fails."""
        scale, w = self.program.places.scale, w.copy()
        w[self.program.places.free] = numbers
        factors, fresh, before = self._last.get("factors"), False, np.inf
        for _ in range(NEWTON_STEPS):
            values = np.array(self.program.assembled.nlp(w / scale, [])[1]).ravel()
            step = np.full(self.others.size, np.nan) if factors is None else factors.solve(
                (values - self.program.lbg)[self.equations]
            )  # fmt: skip
            size = np.max(np.abs(step), initial=0.0)
            if not size <= CHORD * before and not fresh:  # the old Jacobian leads no further
                try:
                    factors, fresh, before = self._factorised(w)[1], True, np.inf
                except ModelError:
                    return None
                continue
            if not np.isfinite(size):
                return None
            w[self.others] -= step * scale[self.others]
            if size < (CLOSE if fresh else CLOSER):
                return w
            fresh, before = False, size
        return None

    def _factorised(self, w: np.ndarray) -> tuple[Any, SuperLU]:
        """Jacobian of the equations, and the factors of those with respect to the other unknowns."""
        if "at" in self._last and np.array_equal(self._last["at"], w):
            return self._last["equations"], self._last["factors"]
        equations = self._of_rows.at(w)[self.equations]
        try:
            factors = splu(equations[:, self.others].tocsc())
        except (RuntimeError, ValueError) as error:
            raise ModelError(
                f"{self.program.problem.name}: the equations and starts do not determine the motion ({error}); give "
                "independent starts"
            ) from error
        self._last.update(at=w.copy(), equations=equations, factors=factors)
        return equations, factors


@dataclass(frozen=True, eq=False)
class _Sparse:
    """A sparse Jacobian as CasADi evaluates it, with its pattern read once."""

    function: ca.Function
    scale: np.ndarray
    rows: np.ndarray
    starts: np.ndarray
    shape: tuple[int, int]

    @staticmethod
    def of(function: ca.Function, scale: np.ndarray) -> "_Sparse":
        pattern = function.sparsity_out(1)
        return _Sparse(function, scale, np.array(pattern.row()), np.array(pattern.colind()), pattern.shape)

    def at(self, w: np.ndarray) -> Any:
        """Derivatives by scaled unknowns at unknowns w, by columns."""
        found = self.function(w / self.scale, [])[1]
        values = np.array(found.nz[:]).ravel() if self.rows.size else np.zeros(0)
        return sparse.csc_matrix((values, self.rows, self.starts), shape=self.shape)


def residuals(program: Program) -> Residuals:
    """Residuals of the sums over samples of a program."""
    places, terms, sizes = program.places, [], []
    total = sum(s.times.size for s in program.problem.sums)
    for layout in places.layouts:
        for one, error, element, place, known in sample_errors(layout):
            count = one.times.size
            rows = sum(sizes) + np.arange(count)
            scatter = sparse.csr_matrix((np.ones(count), (rows, np.arange(count))), shape=(total, count))
            terms.append(running(places, layout).term(error, element, place, scatter, extra=known))
            sizes.append(count)
    linear = sparse.csr_matrix((total, places.size))
    rows = Assembled([], terms, linear, program.assembled.compiled)  # of a program without an objective
    return Residuals(program, rows, tuple(sizes))


def check_determined(found: Residuals, states: dict[str, list[str]]) -> None:
    """ModelError unless there are as many equations as unknowns; states: those without a given start by experiment."""
    missing = found.others.size - found.equations.size
    if missing == 0:
        return
    name = found.program.problem.name
    if missing < 0:
        raise ModelError(
            f"{name}: {-missing} more conditions than the motion has starts, expected as many; take starts out that "
            "follow from others"
        )
    words = "; ".join(f"{experiment}: {', '.join(some)}" for experiment, some in states.items() if some)
    raise ModelError(
        f"{name}: {missing} initial values are neither given nor estimated ({words}), expected them in "
        "Experiment(start={name: number or Free(guess)})"
    )
