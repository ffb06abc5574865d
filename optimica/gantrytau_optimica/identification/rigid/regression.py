"""Linear least squares of a robot's forces, reduced to triangular factors, with and without limits.

A p = b + e,  A (rows, k),  [A b] = Q [R d; 0 r]: all that is asked later needs R, d and r only
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from gantrytau_optimica.identification.rigid.base_parameters import BaseParameters, base_parameters


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


@dataclass(frozen=True, eq=False)
class LimitedFit:
    """Parameters p (k,), of those that are not determined the nominal value.

    active: at a limit; inflation: deviation of each over that if it were alone (inf where not determined);
    condition: of the normed columns that are determined.
    """

    p: np.ndarray
    base: BaseParameters
    active: np.ndarray
    inflation: np.ndarray
    condition: float


def fit(factors: Factors, nominal: np.ndarray, least: np.ndarray) -> LimitedFit:
    """Least squares with lower limits, -inf for none."""
    from scipy.optimize import lsq_linear

    base = base_parameters(factors.R)
    free, held = base.independent, base.dependent
    p = np.array(nominal, dtype=float)
    p[held] = np.maximum(p[held], least[held])
    norms = np.linalg.norm(factors.R[:, free], axis=0)
    normed, right = factors.R[:, free] / norms, factors.d - factors.R[:, held] @ p[held]
    best = np.linalg.lstsq(normed, right, rcond=None)[0]
    limits = least[free] * norms
    if np.any(best < limits):
        found = lsq_linear(normed, right, bounds=(limits, np.inf), method="bvls", tol=1e-14)
        best = np.maximum(found.x, limits)
        at_limit = best <= limits + 1e-12 * np.max(np.abs(best))
    else:
        at_limit = np.zeros(len(free), dtype=bool)
    p[free] = best / norms
    active = np.zeros(len(p), dtype=bool)
    active[free] = at_limit
    p[active] = least[active]
    inflation = np.full(len(p), np.inf)
    if len(free):
        inverse = np.linalg.inv(np.linalg.qr(normed, mode="r"))
        inflation[free] = np.linalg.norm(inverse, axis=1)
    condition = float(np.linalg.cond(normed)) if len(free) else np.nan
    return LimitedFit(p, base, active, inflation, condition)
