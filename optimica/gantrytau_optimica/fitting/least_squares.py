"""Nonlinear least squares by Gauss-Newton with truncated steps of minimum norm, the one iteration of all dense fits.

    min |e(x)|^2 + sum_i w_i^2 (x_i - m_i)^2        e: residuals, w_i = 1 / standard deviation of a prior, in noise of e
    J S = U diag(s) V',   dx = -S V_r diag(1 / s_r) U_r' e        r: singular values above the limit
    (J'J)^-1 = S V_r diag(1 / s_r^2) V_r' S

S scales the parameters so that their steps compare. Along directions with a smaller singular value nothing moves: what data
do not determine stays where it began.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gantrytau.describing.record import Record

ITERATIONS = 60
NEGLIGIBLE = 1e-9  # m, of a step: it is still taken, and what is left after it is less by far
# of the cost, what a step may still gain; with the noise of a tracker it then moves by 1e-12 m
UNSEEN = 1e-18
ROUNDING = 1e-12  # of the cost
JITTER = 1e-9  # of the cost: steps of less gain end at rounding errors, which reach 1e-10 of it with some ten poses
SMALLEST_RESIDUAL = 1e-14  # m, of the closure of links of metres
SHARES = 0.5 ** np.arange(12)  # of a step that are tried
RELATIVE = 1e-10  # of the largest singular value, below which data say nothing
TALL = 4  # times as many rows as columns
MOVED = 0.1  # share of a parameter in a direction that data do not determine, from which on it is undetermined too


@dataclass(frozen=True)
class Minimum(Record):
    """Minimum of a sum of squares.

    x: all parameters; residuals: (m,), the rows of the prior last; jacobian: (m, n) by the free parameters over their
    scale; singular: singular values of the Jacobian, (n,); directions: right singular vectors in rows, (n, n); rank: number
    of determined directions, the first; scale: of the free parameters, (n,); success: whether the last step was negligible.
    """

    x: np.ndarray
    residuals: np.ndarray
    jacobian: np.ndarray
    singular: np.ndarray
    directions: np.ndarray
    rank: int
    scale: np.ndarray
    iterations: int
    success: bool

    @property
    def cost(self) -> float:
        """Sum of squares of the residuals."""
        return float(self.residuals @ self.residuals)

    def noise(self, count: int) -> float:
        """Standard deviation of a residual; count: number of measured residuals."""
        return float(np.sqrt(self.cost / max(1, count - self.rank)))

    @property
    def root(self) -> np.ndarray:
        """W (rank, n) with W'W = (J'J)^-1 of the free parameters, in the directions that are determined."""
        return self.directions[: self.rank] / self.singular[: self.rank, None] * self.scale

    @cached_property
    def inverse(self) -> np.ndarray:
        """(J'J)^-1 (n, n) of the free parameters, in the directions that are determined."""
        return self.root.T @ self.root

    def beside(self, lost: np.ndarray) -> "Minimum":
        """This minimum with further undetermined directions (k, n), which were not moved."""
        singular = np.concatenate([self.singular, np.linalg.norm(self.jacobian @ lost.T, axis=0)])
        return replace(self, singular=singular, directions=np.vstack([self.directions, lost]))

    def undetermined(self, names: Sequence[str], reported: np.ndarray | None = None) -> tuple[str, ...]:
        """Names of the free parameters with a component in an undetermined direction.

        reported: Jacobian (n, n) of the reported parameters by the fitted ones, None for the unit matrix.
        """
        lost = self.directions[self.rank :]
        part = np.abs(lost if reported is None else lost @ reported.T).max(axis=0, initial=0.0)
        return tuple(n for n, share in zip(names, part, strict=True) if share > MOVED)


@dataclass(frozen=True)
class Prior(Record):
    """Rows weight (x_i - value) of parameters by index; weights: noise of a residual over their standard deviations."""

    indices: Sequence[int] | np.ndarray
    values: Sequence[float] | np.ndarray
    weights: Sequence[float] | np.ndarray

    @classmethod
    def of(cls, expected: Mapping[int, tuple[float, float]], noise: float) -> "Prior":
        """Rows of parameters by index with (value, standard deviation); noise: standard deviation of a residual."""
        values, deviations = [v for v, _ in expected.values()], [d for _, d in expected.values()]
        return cls(list(expected), values, [noise / d for d in deviations])


def least_squares(
    residuals: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    *,
    scale: np.ndarray | None = None,
    priors: Sequence[Prior] = (),
    smallest: float = 0.0,
    along: np.ndarray | None = None,
    steps: int = ITERATIONS,
) -> Minimum:
    """Minimise |residuals(x)|^2 over the free parameters, beginning at x.

    jacobian: (m, n) by all parameters; scale: of each parameter, by default 1, 0 for a fixed one; priors: further rows;
    smallest: singular value of the scaled Jacobian, below which (or 1e-10 of the largest) a direction does not move; along:
    orthonormal rows (k, n), the only directions to move in; steps: at most, 0 for the record of another solver's minimum
    x. A step with larger residuals is halved.
    """
    problem = _Problem(residuals, jacobian, np.ones(len(x)) if scale is None else scale, priors)
    inside = np.eye(len(problem.scale)) if along is None else along
    x, success, iteration = x.copy(), False, 0
    e = problem.residuals(x)
    cost = float(e @ e)
    step, gain, singular, right, J = _step(problem.jacobian(x), e, smallest, inside)
    while iteration < steps and np.isfinite(step).all():
        iteration += 1
        done = np.abs(step).max(initial=0.0) < NEGLIGIBLE or gain < UNSEEN * cost
        after = _shortened(problem, x, step * problem.scale, cost)
        if after is None:
            rounding = (SMALLEST_RESIDUAL * singular.max(initial=0.0)) ** 2
            success = done or gain < JITTER * cost or gain < rounding
            break
        x, e = after
        cost = float(e @ e)
        step, gain, singular, right, J = _step(problem.jacobian(x), e, smallest, inside)
        if done:
            success = True
            break
    rank = int((singular > limit_of(singular, smallest)).sum())
    return Minimum(x, e, J, singular, right, rank, problem.scale, iteration, success)


def limit_of(singular: np.ndarray, smallest: float) -> float:
    """Smallest singular value of a determined direction."""
    return max(smallest, RELATIVE * float(singular.max(initial=0.0)))


class _Problem:
    """Residuals with rows of priors, and their derivatives by the free parameters over their scale."""

    def __init__(self, residuals, jacobian, scale: np.ndarray, priors: Sequence[Prior]):
        self.free = scale > 0
        self.scale = scale[self.free]
        self._residuals, self._jacobian = residuals, jacobian
        rows = [
            (int(i), m, w) for p in priors for i, m, w in zip(p.indices, p.values, p.weights, strict=True)
        ]
        self._indices = [i for i, _, _ in rows]
        self._values, self._weights = (np.array([row[k] for row in rows], dtype=float) for k in (1, 2))
        self._rows = np.eye(len(scale))[self._indices] * self._weights[:, None]

    def residuals(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([self._residuals(x), self._weights * (x[self._indices] - self._values)])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        return np.vstack([self._jacobian(x), self._rows])[:, self.free] * self.scale


def _shortened(problem: _Problem, x: np.ndarray, step: np.ndarray, cost: float):
    """X and its residuals after the step, or half of it and so on, that does not make them larger; None if none does."""
    for share in SHARES:
        trial = x.copy()
        trial[problem.free] -= share * step
        e = problem.residuals(trial)
        if float(e @ e) <= cost * (1 + ROUNDING):
            return trial, e
    return None


def _step(J: np.ndarray, e: np.ndarray, smallest: float, inside: np.ndarray):
    """Step of least norm among the minima of |e - J step|, along the determined directions inside.

    With its gain, singular values, directions and J.
    """
    if not np.isfinite(J).all() or not np.isfinite(e).all():
        return np.full(J.shape[1], np.nan), 0.0, np.zeros(len(inside)), inside, J
    rows, right_side = J @ inside.T, e
    if len(rows) > TALL * rows.shape[1]:  # the triangle first: the values of a tall matrix take longer
        triangle = np.asarray(np.linalg.qr(np.column_stack([rows, e]), mode="r"))
        rows, right_side = triangle[:, :-1], triangle[:, -1]
    left, singular, right = np.linalg.svd(rows, full_matrices=False)
    right = right @ inside
    counts = singular > limit_of(singular, smallest)
    along = left[:, counts].T @ right_side
    return right[counts].T @ (along / singular[counts]), float(along @ along), singular, right, J
