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
BALANCE = 1e-3  # between residuals and unknowns that are solved together: singular values as small keep their digits
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
        if not isinstance(self._matrix, np.ndarray):
            step = self._sparse(damping)
            if step is not None:
                return step
        step = np.zeros(self._matrix.shape[1])
        largest = max((float(sizes[0]) for _, _, sizes, _ in self._singular), default=0.0)
        for columns, along, sizes, right in self._singular:
            known = sizes > NOTHING * largest
            shares = np.where(known, sizes / np.maximum(sizes**2 + damping, 1e-300), 0.0)
            step[columns] = right.T @ (shares * along)
        return step

    @cached_property
    def _singular(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Of each part of the equations that shares no unknown with others: its columns, the target along its left singular
        vectors, its singular values, and its right singular vectors.
        """
        found = []
        for rows, columns in self._parts():
            part = self._matrix[rows][:, columns]
            part = part if isinstance(part, np.ndarray) else part.toarray()
            left, sizes, right = np.linalg.svd(part, full_matrices=False)
            found.append((columns, left.T @ self.target[rows], sizes, right))
        return found

    def _parts(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows and columns of the parts of a sparse matrix that share nothing; all of a dense one."""
        m, n = self._matrix.shape
        if isinstance(self._matrix, np.ndarray):
            return [(np.arange(m), np.arange(n))] if m and n else []
        from scipy.sparse import block_array
        from scipy.sparse.csgraph import connected_components

        there = self._matrix.copy()
        there.data = (there.data != 0).astype(float)
        there.eliminate_zeros()
        _, part = connected_components(block_array([[None, there], [there.T, None]]), directed=False)
        both = np.intersect1d(part[:m], part[m:])
        return [(np.flatnonzero(part[:m] == k), np.flatnonzero(part[m:] == k)) for k in both]

    def _sparse(self, damping: float) -> np.ndarray | None:
        """The step by elimination of residuals and unknowns together; None where that would lose its digits.

        With r = target - matrix @ step, either matrix.T @ r = damping * step, or step = matrix.T @ r of the least length.
        """
        from scipy.sparse import block_array, csc_array, eye_array

        m, n = self._matrix.shape
        wide = n > m and not damping  # of many solutions the shortest
        first, second, matrix = (n, m, self._matrix.T) if wide else (m, n, self._matrix)
        lower = None if not damping else -damping / BALANCE * eye_array(second)
        whole = csc_array(block_array([[BALANCE * eye_array(first), matrix], [matrix.T, lower]]))
        solve = _well_conditioned(whole)
        if solve is None:
            return None
        if wide:
            return solve(np.concatenate([np.zeros(n), self.target]))[:n]
        return solve(np.concatenate([self.target, np.zeros(n)]))[m:]

    @cached_property
    def _only(self) -> np.ndarray | None:
        """The solution by elimination of a square system that has one; else None."""
        rows, columns = self._matrix.shape
        if rows != columns or rows < LARGE:
            return None
        if isinstance(self._matrix, np.ndarray):
            from scipy.linalg import get_lapack_funcs

            factorize, condition, solve = get_lapack_funcs(("getrf", "gecon", "getrs"), (self._matrix,))
            largest = float(np.abs(self._matrix).sum(axis=0).max())
            factors, pivots, singular = factorize(self._matrix)
            if singular or not condition(factors, largest)[0] * SQUARE > 1:
                return None
            return solve(factors, pivots, self.target)[0]
        solve = _well_conditioned(self._matrix.tocsc())
        return None if solve is None else solve(self.target)


def _well_conditioned(matrix: Any) -> Callable[[np.ndarray], np.ndarray] | None:
    """The solution of a square sparse system by elimination, where its condition leaves digits."""
    from scipy.sparse import linalg

    sparse: Any = linalg
    try:
        factors = sparse.splu(matrix)
    except RuntimeError:  # exactly singular
        return None
    inverse = sparse.LinearOperator(
        matrix.shape, matvec=factors.solve, rmatvec=lambda v: factors.solve(v, "T"), dtype=float
    )
    largest = float(abs(matrix).sum(axis=0).max())
    return factors.solve if largest * sparse.onenormest(inverse) < SQUARE else None


def _sound(f: np.ndarray, jacobian: Matrix) -> bool:
    values = jacobian if isinstance(jacobian, np.ndarray) else jacobian.data
    return bool(np.all(np.isfinite(f)) and np.all(np.isfinite(values)))


def _longest(point: np.ndarray, step: np.ndarray) -> float:
    """The share of a step that may be taken at once."""
    reach = np.maximum(LONGEST_STEP, np.abs(point))
    return float(1.0 / np.max(np.abs(step) / reach, initial=1.0))
