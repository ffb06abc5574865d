"""Rows of a linear regression reduced to triangular factors.

A p = b + e,  A (rows, k),  [A b] = Q [R d; 0 r]: all that is asked later needs R, d and r only
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr


@dataclass(frozen=True, eq=False)
class Factors:
    """Triangular factor (k, k), right side (k,) and sum of squares beside them, of so many rows."""

    R: np.ndarray
    d: np.ndarray
    rest: float
    rows: int

    @classmethod
    def of(cls, A: np.ndarray, b: np.ndarray) -> "Factors":
        """Factors of columns A (rows, k) and b (rows,); fewer rows than columns are filled up by zeros."""
        k = A.shape[1]
        whole = np.column_stack([A, b])
        filled = np.vstack([whole, np.zeros((max(0, k + 1 - len(whole)), k + 1))])
        (R,) = qr(filled, mode="r", overwrite_a=True, check_finite=False)[-1:]
        return cls(R[:k, :k], R[:k, k], float(R[k, k] ** 2), len(b))

    def __add__(self, other: "Factors") -> "Factors":
        joined = Factors.of(np.vstack([self.R, other.R]), np.concatenate([self.d, other.d]))
        return Factors(joined.R, joined.d, joined.rest + self.rest + other.rest, self.rows + other.rows)

    def squares(self, p: np.ndarray) -> float:
        """Sum of squares that p leaves."""
        return float(np.sum((self.R @ p - self.d) ** 2) + self.rest)
