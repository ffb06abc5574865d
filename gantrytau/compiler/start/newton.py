"""Newton steps of least weighted length on dense matrices where they are small, on sparse ones where they are large."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

TOLERANCE = 1e-15  # of the terms of an equation, what may be left; rounding may stop the steps before
ITERATIONS = 100
NOISE = 1e-9  # of the longest row, below which one says nothing: across the plane of a planar loop
LONGEST_STEP = 0.7  # of a value without a scale of its own: about what an angle may turn in one step, rad
NOTHING = 1e-11  # of the largest singular value, below which one counts as zero
SQUARE = 1e8  # condition below which a square system has one solution, whatever the weights
LARGE = 20  # equations from which on elimination is quicker than singular values
DENSE = 50_000  # elements of a matrix from which on it is sparse

Matrix = Any  # np.ndarray or scipy.sparse.csr_array, (m, n)


def matrix_of(entries: np.ndarray, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> Matrix:
    """The matrix with these entries."""
    if shape[0] * shape[1] > DENSE:
        from scipy.sparse import csr_array

        return csr_array((entries, (rows, columns)), shape)
    found = np.zeros(shape)
    found[rows, columns] = entries
    return found


def scaled(matrix: Matrix, rows: np.ndarray | float, columns: np.ndarray | float) -> Matrix:
    """Rows (m, 1) and columns (n,) of a matrix times factors."""
    if isinstance(matrix, np.ndarray):
        return rows * matrix * columns
    found = matrix.copy()
    if np.ndim(rows):
        found.data *= np.repeat(np.ravel(rows), np.diff(matrix.indptr))
    if np.ndim(columns):
        found.data *= np.ravel(columns)[matrix.indices]
    return found


def newton(
    at: Callable[[np.ndarray], tuple[np.ndarray, Matrix]], point: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Matrix]:
    """Solve at(point) = (f, jacobian) for f = 0 near a point; returns the last point, f and jacobian.

    Steps are damped as far as the residual asks for it (Levenberg and Marquardt), so that a nearly singular
    Jacobian on the way, as of a loop that is not yet closed, does not send them far away.
    """
    f, jacobian = at(point)
    damping = 0.0
    for _ in range(ITERATIONS):
        terms = abs(jacobian) @ np.abs(point)
        if not _sound(f, jacobian) or np.all(np.abs(f) <= TOLERANCE * terms):
            break
        # where large terms could not be met better, small ones may still be, by steps that serve at once
        attempts, enough = 25, 0.1
        if np.all(np.abs(f) <= TOLERANCE * np.maximum(terms, 1.0)):
            attempts, enough = 1, 0.5
        weighted = scaled(jacobian, 1.0, weights)
        rows = np.sqrt(
            (weighted * weighted if isinstance(weighted, np.ndarray) else weighted.power(2)).sum(axis=1)
        )
        rows = np.maximum(rows, NOISE * rows.max(initial=1e-30))
        steps = _Steps(scaled(weighted, 1 / rows[:, None], 1.0), -f / rows)
        merit = np.linalg.norm(steps.target)
        moved = False
        for attempt in range(attempts):
            step = weights * steps.damped(damping)
            share = min(1.0, _longest(point, step)) if attempt else 1.0
            step *= share
            f_new, jacobian_new = at(point + step)
            size = np.linalg.norm(f_new / rows) if _sound(f_new, jacobian_new) else np.inf
            # at once only where the equations are as good as linear; a large step may reach another branch
            if size < (1 - 1e-4 * share if attempt else enough) * merit:
                point, f, jacobian, moved = point + step, f_new, jacobian_new, True
                damping = 0.0 if size < 0.1 * merit else damping / 10
                break
            if attempt:
                damping = max(10 * damping, 1e-8)
        if not moved:
            break
    return point, f, jacobian


class _Steps:
    """Shortest solutions of matrix @ step = target; damped ones are shorter and do not reach the target."""

    def __init__(self, matrix: Matrix, target: np.ndarray):
        self._matrix, self.target = matrix, target

    def damped(self, damping: float) -> np.ndarray:
        """The step with this damping."""
        if not damping and self._only is not None:
            return self._only
        along, sizes, right = self._singular
        known = sizes > NOTHING * sizes[:1]
        shares = np.where(known, sizes / np.maximum(sizes**2 + damping, 1e-300), 0.0)
        return right.T @ (shares * along)

    @cached_property
    def _singular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The target along the left singular vectors, the singular values, and the right singular vectors."""
        matrix = self._matrix if isinstance(self._matrix, np.ndarray) else self._matrix.toarray()
        left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
        return left.T @ self.target, sizes, right

    @cached_property
    def _only(self) -> np.ndarray | None:
        """The solution by elimination of a square system that has one; else None."""
        rows, columns = self._matrix.shape
        if rows != columns or rows < LARGE:
            return None
        largest = float(abs(self._matrix).sum(axis=0).max())
        if isinstance(self._matrix, np.ndarray):
            from scipy.linalg import get_lapack_funcs

            factorize, condition, solve = get_lapack_funcs(("getrf", "gecon", "getrs"), (self._matrix,))
            factors, pivots, singular = factorize(self._matrix)
            if singular or not condition(factors, largest)[0] * SQUARE > 1:
                return None
            return solve(factors, pivots, self.target)[0]
        from scipy.sparse import linalg

        sparse: Any = linalg
        try:
            factors = sparse.splu(self._matrix.tocsc())
        except RuntimeError:  # exactly singular
            return None
        inverse = sparse.LinearOperator(
            self._matrix.shape, matvec=factors.solve, rmatvec=lambda v: factors.solve(v, "T"), dtype=float
        )
        return factors.solve(self.target) if largest * sparse.onenormest(inverse) < SQUARE else None


def _sound(f: np.ndarray, jacobian: Matrix) -> bool:
    values = jacobian if isinstance(jacobian, np.ndarray) else jacobian.data
    return bool(np.all(np.isfinite(f)) and np.all(np.isfinite(values)))


def _longest(point: np.ndarray, step: np.ndarray) -> float:
    """The share of a step that may be taken at once."""
    reach = np.maximum(LONGEST_STEP, np.abs(point))
    return float(1.0 / np.max(np.abs(step) / reach, initial=1.0))
