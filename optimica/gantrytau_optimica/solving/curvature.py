"""Whether a stationary solution is a minimum: the least curvature of the Lagrangian along directions that are free.

    d' (H + S) d = c d' M d,   A d = D y,   H: Hessian of the Lagrangian in scaled unknowns, A: rows of conditions,
    S = z / s, D = s / l: limits at a distance s with multipliers z (of unknowns) and l (of rows), as the barrier weighs them

M makes curvatures those of motions rather than of meshes: every signal counts by its mean square. How many curvatures
are less than c is the number of negative pivots of

    [ H + S - c M   A' ]
    [ A            -D  ]

less the number of rows (Sylvester's law of inertia): Nocedal and Wright (2006), theorem 16.3. The factorisation is
that of SuperLU without exchanges of rows, where pivots stand on the diagonal. Equations give by D = SOFT, so that
curvatures are found somewhat too small rather than too large.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, SuperLU, eigsh, splu

from gantrytau_optimica.solving.ipopt import Solution, objective_size
from gantrytau_optimica.transcription.assemble import scipy_matrix
from gantrytau_optimica.transcription.program import Program

NEAR = 1e-6  # of its size or of a limit: what is closer is at the limit
SOFT = 1e-7  # what equations give, in their sizes
WEAK = 1e8  # what limits give at most that do not matter
FLAT = 1e-4  # of the objective's size per squared size of what moves: what is curved by less is flat
STEEPER = 30.0  # factor from one shift to the next
MOST_SHIFTS = 12
FALLS = 1e-6  # of the terms of a curvature: what is less negative is rounding
EXACT = 1e-10  # what equations give where a direction is brought onto them
LEAST = 1e-30  # in place of multipliers that vanish
FEW = 12  # unknowns up to which all directions are looked at
DETERMINED = 1e3  # curvatures from which on it is the conditions that are stiff

Sparse = Any  # a matrix of scipy.sparse


@dataclass(frozen=True, eq=False)
class Curvature:
    """The least curvature, relative to the objective's size, and the direction (n,) in scaled unknowns; no direction where
    conditions and limits leave none. flat: how many directions are neither curved upwards nor downwards. known: False
    where rounding leaves nothing of it.
    """

    least: float
    direction: np.ndarray | None
    flat: int
    known: bool = True

    @property
    def falls(self) -> bool:
        """Whether the objective falls to both sides."""
        return self.known and self.least < -FLAT


UNKNOWN = Curvature(np.nan, None, 0, known=False)
NOTHING_FREE = Curvature(np.inf, None, 0)


def least_curvature(program: Program, solution: Solution) -> Curvature:
    """The least curvature at a solution, by two sparse factorisations and a few solves with them."""
    size = objective_size(program)
    conditions = _conditions(program, solution, size) if size > 0 else None
    if conditions is None:
        return UNKNOWN
    if not conditions.free.size:
        return NOTHING_FREE
    falling, not_curved = conditions.below(-FLAT), conditions.below(FLAT)
    if falling is None or not_curved is None:
        return UNKNOWN
    shift = -FLAT
    for _ in range(MOST_SHIFTS if falling else 0):
        shift *= STEEPER
        if conditions.below(shift) == 0:
            break
    found = conditions.nearest(shift)
    if found is None:
        return UNKNOWN
    least, direction = found
    if least > DETERMINED:
        return NOTHING_FREE
    if falling and not conditions.falls_exactly(direction):
        return UNKNOWN
    whole = np.zeros(program.places.size)
    whole[conditions.free] = direction / np.max(np.abs(direction))
    return Curvature(least, whole, max(not_curved - falling, 0))


def falls_somewhere(program: Program, solution: Solution) -> bool:
    """Whether a curvature is negative, by one factorisation; False where rounding leaves nothing of it."""
    size = objective_size(program)
    conditions = _conditions(program, solution, size) if size > 0 else None
    return conditions is not None and conditions.free.size > 0 and bool(conditions.below(-FLAT))


@dataclass(frozen=True, eq=False)
class _Conditions:
    """The matrices at the head of this file, of the unknowns `free` that are not at a limit; hard: rows that hold."""

    free: np.ndarray
    hessian: Sparse
    barrier: np.ndarray  # (n,) diagonal of S
    weights: np.ndarray  # (n,) diagonal of M
    rows: Sparse
    give: np.ndarray  # (m,) diagonal of D
    hard: np.ndarray

    def below(self, level: float) -> int | None:
        """How many curvatures are less than a level; None where a pivot vanishes."""
        for shift in (level, level * 1.1, level * 1.3):  # of which at most one is a curvature itself
            factors = self._factors(shift)
            if factors is not None and np.array_equal(factors.perm_r, factors.perm_c):
                return int(np.sum(factors.U.diagonal() < 0)) - self.give.size
        return None

    def nearest(self, shift: float) -> tuple[float, np.ndarray] | None:
        """The least curvature, which is above the shift, and its direction."""
        factors = self._factors(shift)
        if factors is None:
            return None
        n, root = self.free.size, np.sqrt(self.weights)
        below = np.zeros(self.give.size)

        def inverse(v: np.ndarray) -> np.ndarray:
            return root * factors.solve(np.concatenate([root * np.ravel(v), below]))[:n]

        if n <= FEW:
            values, vectors = np.linalg.eigh(np.column_stack([inverse(e) for e in np.eye(n)]))
        else:
            kind: Any = LinearOperator  # its stubs know only subclasses
            look: Any = eigsh
            operator = kind((n, n), matvec=inverse, dtype=np.float64)
            start = 1.0 + 0.5 * np.sin(1.0 + 7.3 * np.arange(n))
            try:
                values, vectors = look(operator, k=1, which="LA", v0=start, tol=1e-3, maxiter=30)
            except ArpackError:
                return None
        if not values[-1] > 0:
            return None
        return float(shift + 1 / values[-1]), vectors[:, -1] / root

    def falls_exactly(self, direction: np.ndarray) -> bool:
        """Whether the direction, brought onto the rows that hold, is curved downwards by more than rounding."""
        rows, n = self.rows[self.hard], self.free.size
        count = rows.shape[0]
        matrix = sparse.block_array([[sparse.eye_array(n), rows.T], [rows, -EXACT * sparse.eye_array(count)]])
        try:
            onto = splu(matrix.tocsc()).solve(np.concatenate([direction, np.zeros(count)]))[:n]
        except RuntimeError:  # rows that repeat each other to the last digit
            return False
        terms = float(np.abs(onto) @ (abs(self.hessian) @ np.abs(onto)))
        return float(onto @ (self.hessian @ onto)) < -FALLS * terms

    def _factors(self, shift: float) -> SuperLU | None:
        inner = self.hessian + sparse.diags_array(self.barrier - shift * self.weights)
        matrix = sparse.block_array([[inner, self.rows.T], [self.rows, -sparse.diags_array(self.give)]])
        try:
            return splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # exactly singular
            return None


def _conditions(program: Program, solution: Solution, size: float) -> _Conditions | None:
    """Derivatives at the solution divided by the size of the objective; None where they are not finite."""
    scale = program.places.scale
    x, multipliers = solution.w / scale, solution.multipliers / size
    upper = scipy_matrix(program.assembled.hess_lag(x, [], 1.0 / size, multipliers)).tocsr()
    rows = scipy_matrix(program.assembled.jac_g(x, [])[1]).tocsr()
    if not (np.all(np.isfinite(upper.data)) and np.all(np.isfinite(rows.data))):
        return None
    low, high = x - program.lbw, program.ubw - x
    near = NEAR * np.maximum(1.0, np.abs(x))
    free = np.flatnonzero((low > near) & (high > near))
    z = solution.bound_multipliers * scale / size  # negative at lower limits
    barrier = np.where(z < 0, -z / np.maximum(low, near), z / np.maximum(high, near))[free]
    g = solution.constraints
    below, above = g - program.lbg, program.ubg - g
    distance = np.where(program.lbg == program.ubg, 0.0, np.where(multipliers < 0, below, above))
    give = np.maximum(distance, 0.0) / np.maximum(np.abs(multipliers), LEAST)
    hard = np.minimum(below, above) <= NEAR * np.maximum(1.0, np.abs(g))
    give = np.clip(give, SOFT, WEAK)
    hessian = (upper + sparse.triu(upper, 1).T).tocsr()[free][:, free]
    return _Conditions(free, hessian, barrier, _weights(program)[free], rows[:, free], give, hard)


def _weights(program: Program) -> np.ndarray:
    """The share of an unknown in the mean square of its signal, (n,); 1 for numbers and borders."""
    weights = np.ones(program.places.size)
    for layout in program.places.layouts:
        for number in range(len(layout.phase.signals)):
            mine = layout.of(number)
            weights[mine] = 1.0 / max(mine.size, 1)
    return weights
