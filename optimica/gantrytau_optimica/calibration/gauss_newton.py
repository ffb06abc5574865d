"""Gauss-Newton with truncated minimum-norm steps."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

ITERATIONS = 60
NEGLIGIBLE = (
    1e-11  # of steps in m; a tenth of what rounding leaves of lengths of metres in squares of them is 1e-13
)
RELATIVE = 1e-10  # of the largest singular value, below which data say nothing


@dataclass(frozen=True)
class Minimum:
    """Where Gauss-Newton ended.

    x: all numbers; errors: (m,) there; slopes: (m, n) for the free numbers; rank: how many directions were moved;
    singular: singular values of the slopes; directions: the rows that belong to them, (n, n); success: whether the
    last step was negligible.
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
    smallest: float = 0.0,
) -> Minimum:
    """Minimise |errors(x)|^2 over x[free], beginning at x.

    Directions in which the slopes have a singular value below `smallest` (or 1e-10 of the largest) are left alone, so
    that what data do not hold stays where it began. Steps that do not make the errors smaller are halved.
    """
    x, e, success, iteration = x.copy(), errors(x), False, 0
    best = float(e @ e)
    step, singular, directions, J = _step(slopes(x)[:, free], e, smallest)
    while iteration < ITERATIONS and np.isfinite(step).all():
        iteration += 1
        share, trial, found = 1.0, x, np.inf
        while share > 1e-4:
            trial = x.copy()
            trial[free] -= share * step
            e = errors(trial)
            found = float(e @ e)
            if found <= best or np.abs(share * step).max(initial=0.0) < NEGLIGIBLE:
                break
            share /= 2
        if not found <= best * (1 + 1e-6):
            break
        x, best = trial, min(best, found)
        done = np.abs(step).max(initial=0.0) < NEGLIGIBLE
        step, singular, directions, J = _step(slopes(x)[:, free], e, smallest)
        if done:
            success = True
            break
    e = errors(x)
    rank = int((singular > _limit(singular, smallest)).sum())
    return Minimum(x, e, J, singular, directions, rank, iteration, success)


def _limit(singular: np.ndarray, smallest: float) -> float:
    return max(smallest, RELATIVE * float(singular.max(initial=0.0)))


def _step(J: np.ndarray, e: np.ndarray, smallest: float):
    """The step of least norm among those that make |e - J step| least, by the directions that count."""
    if not np.isfinite(J).all() or not np.isfinite(e).all():
        return np.full(J.shape[1], np.nan), np.zeros(J.shape[1]), np.eye(J.shape[1]), J
    left, singular, right = np.linalg.svd(J, full_matrices=False)
    counts = singular > _limit(singular, smallest)
    step = right[counts].T @ ((left[:, counts].T @ e) / singular[counts])
    return step, singular, right, J
