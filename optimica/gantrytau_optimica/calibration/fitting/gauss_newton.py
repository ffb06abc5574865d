"""Gauss-Newton with truncated minimum-norm steps."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record

ITERATIONS = 60
NEGLIGIBLE = 1e-9  # m, of a step: it is still taken, and what is left after it is less by far
UNSEEN = (
    1e-18  # of the cost, what a step may still gain; with the noise of a tracker it then moves by 1e-12 m
)
ROUNDING = 1e-12  # of the cost
JITTER = 1e-9  # of the cost: steps of less gain end at rounding errors, which reach 1e-10 of it with some ten poses
SMALLEST_ERROR = 1e-14  # m, of the closure of links of metres
SHARES = 0.5 ** np.arange(12)  # of a step that are tried
RELATIVE = 1e-10  # of the largest singular value, below which data say nothing
TALL = 4  # times as many rows as columns


@dataclass(frozen=True)
class Minimum(Record):
    """Where Gauss-Newton ended.

    x: all numbers; errors: (m,) there; slopes: (m, n) for the free numbers by their scale; rank: how many directions were
    moved, the first; singular: of the slopes along these; directions: the rows that belong to them, (n, n); success:
    whether the last step was negligible.
    """

    x: np.ndarray
    errors: np.ndarray
    slopes: np.ndarray
    singular: np.ndarray
    directions: np.ndarray
    rank: int
    iterations: int
    success: bool

    @property
    def cost(self) -> float:
        """Sum of squares of the errors."""
        return float(self.errors @ self.errors)


def gauss_newton(
    errors: Callable[[np.ndarray], np.ndarray],
    slopes: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    free: np.ndarray,
    *,
    scale: np.ndarray | None = None,
    smallest: float = 0.0,
    directions: np.ndarray | None = None,
    movable: int | None = None,
) -> Minimum:
    """Minimise |errors(x)|^2 over x[free], beginning at x.

    slopes: derivatives of the errors by x / scale, in which steps are least; scale: of each number, by default 1.
    Directions in which the slopes have a singular value below `smallest` (or 1e-10 of the largest) are left alone, so
    that what data do not hold stays where it began. Steps that do not make the errors smaller are halved.
    directions (n, n), orthonormal rows: only along the first, `movable` of them, is moved at all.
    """
    scale = np.ones(len(x)) if scale is None else scale
    count = int(np.count_nonzero(free))
    whole = np.eye(count) if directions is None else directions
    inside, outside = whole[:movable], whole[len(whole) if movable is None else movable :]
    x, e, success, iteration = x.copy(), errors(x), False, 0
    cost = float(e @ e)
    step, gain, singular, right, J = _step(slopes(x)[:, free], e, smallest, inside)
    while iteration < ITERATIONS and np.isfinite(step).all():
        iteration += 1
        done = np.abs(step).max(initial=0.0) < NEGLIGIBLE or gain < UNSEEN * cost
        after = _shortened(errors, x, free, step * scale[free], cost)
        if after is None:
            success = done or gain < JITTER * cost or gain < (SMALLEST_ERROR * singular.max(initial=0.0)) ** 2
            break
        x, e = after
        cost = float(e @ e)
        step, gain, singular, right, J = _step(slopes(x)[:, free], e, smallest, inside)
        if done:
            success = True
            break
    rank = int((singular > _limit(singular, smallest)).sum())
    singular = np.concatenate([singular, np.linalg.norm(J @ outside.T, axis=0)])
    return Minimum(x, e, J, singular, np.vstack([right, outside]), rank, iteration, success)


def _shortened(errors, x: np.ndarray, free: np.ndarray, step: np.ndarray, cost: float):
    """X and its errors after the step, or half of it and so on, that does not make them larger; None if none does."""
    for share in SHARES:
        trial = x.copy()
        trial[free] -= share * step
        e = errors(trial)
        if float(e @ e) <= cost * (1 + ROUNDING):
            return trial, e
    return None


def _limit(singular: np.ndarray, smallest: float) -> float:
    return max(smallest, RELATIVE * float(singular.max(initial=0.0)))


def _step(J: np.ndarray, e: np.ndarray, smallest: float, inside: np.ndarray):
    """The step of least norm among those that make |e - J step| least, by the directions inside that count.

    With it what it would gain, singular values and directions, and J.
    """
    if not np.isfinite(J).all() or not np.isfinite(e).all():
        return np.full(J.shape[1], np.nan), 0.0, np.zeros(len(inside)), inside, J
    rows, right_side = J @ inside.T, e
    if len(rows) > TALL * rows.shape[1]:  # the triangle first: the values of a tall matrix take longer
        triangle = np.asarray(np.linalg.qr(np.column_stack([rows, e]), mode="r"))
        rows, right_side = triangle[:, :-1], triangle[:, -1]
    left, singular, right = np.linalg.svd(rows, full_matrices=False)
    right = right @ inside
    counts = singular > _limit(singular, smallest)
    along = left[:, counts].T @ right_side
    return right[counts].T @ (along / singular[counts]), float(along @ along), singular, right, J
