"""Linear least squares in columns of unit length, since parameters differ in units.

    A = B diag(n),  |B_j| = 1,  B = U diag(s) V'      p = diag(1 / n) V diag(1 / s) U' b
    (A'A)^-1 = W W',  W = diag(1 / n) V diag(1 / s)

Scaling columns to equal length is within sqrt(k) of the best scaling there is (van der Sluis, 1969).
"""

import numpy as np


def column_norms(A: np.ndarray) -> np.ndarray:
    """Euclidean lengths (k,) of the columns of A (N, k), with 1 for a column of zeros."""
    norms = np.linalg.norm(A, axis=0)
    return np.where(norms > 0, norms, 1.0)


def linear_least_squares(A: np.ndarray, b: np.ndarray, smallest: float | None = None) -> np.ndarray:
    """Parameters p (k,) of least |A p - b|, of least norm |diag(n) p| where the columns are dependent.

    smallest: singular value of the scaled columns over the largest, below which a direction is left at zero; by default
    the rounding error of the matrix.
    """
    norms = column_norms(A)
    return np.linalg.lstsq(A / norms, b, rcond=smallest)[0] / norms


def inverse_root(A: np.ndarray) -> np.ndarray:
    """W (k, k) with W W' = (A'A)^-1, for independent columns of A (N, k)."""
    norms = column_norms(A)
    _, singular, right = np.linalg.svd(A / norms, full_matrices=False)
    return right.T / singular / norms[:, None]
