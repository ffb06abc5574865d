"""Linear equations of many points: eliminated in one order for all, as expressions, or matrix by matrix."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

GOOD = 0.1  # of the largest in what is left of its row: a pivot that may be chosen for the zeros beside it


def order_of_pivots(numbers: np.ndarray) -> list[tuple[int, int]] | None:
    """(row, column) of the pivots of a matrix (n, n), which keep zeros and are large in it; None where it is singular."""
    left = np.array(numbers, dtype=float)
    rows, columns = list(range(len(left))), list(range(len(left)))
    order: list[tuple[int, int]] = []
    while rows:
        inside = np.abs(left[np.ix_(rows, columns)])
        largest = inside.max(axis=1, keepdims=True)
        if not (np.isfinite(inside).all() and (largest > 1e-12 * np.abs(numbers).max()).all()):
            return None
        beside = (inside > 0).sum(axis=1, keepdims=True) - 1
        below = (inside > 0).sum(axis=0, keepdims=True) - 1
        cost = np.where(inside >= GOOD * largest, beside * below - inside / largest / 2, np.inf)
        k, m = np.unravel_index(int(cost.argmin()), cost.shape)
        p, q = rows.pop(int(k)), columns.pop(int(m))
        order.append((p, q))
        for i in rows:
            if left[i, q]:
                left[i, columns] -= left[i, q] / left[p, q] * left[p, columns]
    return order


def eliminated(matrix: ca.SX, right: ca.SX, order: Sequence[tuple[int, int]]) -> ca.SX:
    """matrix^-1 right, (n, m), by these pivots whatever their numbers are; infinite or NaN where one of them vanishes."""
    n, m = right.shape
    a, b = _reduced(matrix, right, order)
    x = ca.SX(n, m)
    for place in reversed(range(n)):
        p, q = order[place]
        for k in range(m):
            total = b[p][k]
            for _, other in order[place + 1 :]:
                if not a[p][other].is_zero() and not x[other, k].is_zero():
                    total -= a[p][other] * x[other, k]
            x[q, k] = total / a[p][q]
    return x


def pivots_in_order(matrix: ca.SX, order: Sequence[tuple[int, int]]) -> ca.SX:
    """The numbers by which `eliminated` divides, (n, 1)."""
    a, _ = _reduced(matrix, ca.SX(matrix.shape[0], 0), order)
    return ca.vertcat(*(a[p][q] for p, q in order))


def _reduced(matrix: ca.SX, right: ca.SX, order: Sequence[tuple[int, int]]):
    """Elements of matrix and right-hand sides after each pivot has been eliminated from the rows behind it."""
    n, m = right.shape
    a = [[matrix[i, j] for j in range(n)] for i in range(n)]
    b = [[right[i, j] for j in range(m)] for i in range(n)]
    rows, columns = set(range(n)), set(range(n))
    for p, q in order:
        rows.remove(p)
        columns.remove(q)
        for i in rows:
            if a[i][q].is_zero():
                continue
            factor = a[i][q] / a[p][q]
            for j in columns:
                if not a[p][j].is_zero():
                    a[i][j] -= factor * a[p][j]
            for j in range(m):
                if not b[p][j].is_zero():
                    b[i][j] -= factor * b[p][j]
    return a, b


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """matrix^-1 right, (N, k) of (N, k, k) and (N, k) or (N, k, l) of (N, k, l); NaN where the matrix is singular."""
    stacked = right if right.ndim == 3 else right[:, :, None]
    try:
        found = np.linalg.solve(matrix, stacked)
    except np.linalg.LinAlgError:  # one singular matrix among many
        with np.errstate(all="ignore"):
            singular = ~(np.abs(np.linalg.det(matrix)) > 0.0)
        found = np.linalg.solve(np.where(singular[:, None, None], np.eye(matrix.shape[1]), matrix), stacked)
        found[singular] = np.nan
    return found if right.ndim == 3 else found[:, :, 0]
