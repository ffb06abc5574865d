"""Covariance of parameters from the residuals of forces, whose neighbouring rows are correlated.

    p = A^+ b:  cov p = A^+ cov(e) A^+T,  cov(e) of each joint and log by the spectrum of what is left

Filtered samples taken as independent would promise deviations up to three times too small.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau_optimica.fitting.covariance import averaged_spectrum, product_covariance

BAND = 5.0  # parts of the cutoff over which the spectrum is averaged


@dataclass(frozen=True, eq=False)
class LogRows:
    """Filtered rows of one log: A (N, n, k), b (N, n), moving (N, n): those that count; s between rows, Hz."""

    A: np.ndarray
    b: np.ndarray
    moving: np.ndarray
    period: float
    cutoff: float
    thinned: int

    def half(self, second: int) -> "LogRows":
        """The first half of the rows, or the second."""
        middle = len(self.b) // 2
        rows = slice(middle, None) if second else slice(middle)
        return replace(self, A=self.A[rows], b=self.b[rows], moving=self.moving[rows])

    def left(self, p: np.ndarray) -> np.ndarray:
        """Residuals of the forces, (N, n), zero where rows do not count."""
        return np.where(self.moving, self.b - self.A @ p, 0.0)


def covariance(logs: Sequence[LogRows], p: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Covariance (k, k) of the parameters; zero for those that are not free."""
    found = np.zeros((len(p), len(p)))
    if not len(free):
        return found
    scale = np.sqrt(
        sum(np.sum(np.where(r.moving[:, :, None], r.A[:, :, free], 0.0) ** 2, (0, 1)) for r in logs)
    )
    normal, middle = np.zeros((len(free),) * 2), np.zeros((len(free),) * 2)
    independent = sum(2 * r.cutoff * r.period * np.sum(r.moving) for r in logs)
    for rows in logs:
        left = rows.left(p)
        for i in range(left.shape[1]):
            x = np.where(rows.moving[:, i, None], rows.A[:, i, free], 0.0) / scale
            normal += x.T @ x
            if np.any(rows.moving[:, i]):
                width = round(rows.cutoff / BAND * len(left) * rows.period)
                spectrum = averaged_spectrum(left[:, i], width, float(np.mean(rows.moving[:, i])))
                middle += product_covariance(x, spectrum)
    inverse = np.linalg.inv(normal)
    # parameters have taken their share of what was there to be left
    share = independent / max(independent - len(free), 1.0)
    found[np.ix_(free, free)] = share * (inverse @ middle @ inverse) / np.outer(scale, scale)
    return found
