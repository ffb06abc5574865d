"""Periodic motions as finite Fourier series that begin at rest.

    r(t) = r_0 + sum over k of a_k sin(k w t) + b_k cos(k w t),  sum k a_k = 0 and sum k^2 b_k = 0

Swevers, Ganseman et al. (1997), Optimal robot excitation and identification, IEEE Trans. Robotics and Automation 13.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record


@dataclass(frozen=True, eq=False)
class FourierSeries(Record):
    """Series of m coordinates; coefficients (m, 2 H + 1): r_0, a_1 .. a_H, b_1 .. b_H in m; period in s."""

    coefficients: np.ndarray
    period: float

    def motion(self, t: np.ndarray) -> np.ndarray:
        """Positions, speeds and accelerations (N, 3 m) at times (N,)."""
        harmonics = (self.coefficients.shape[1] - 1) // 2
        return np.hstack([part @ self.coefficients.T for part in series_columns(t, harmonics, self.period)])


def series_columns(t: np.ndarray, harmonics: int, period: float) -> Sequence[np.ndarray]:
    """Columns (N, 2 H + 1) of positions, speeds and accelerations at times (N,)."""
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    angle = np.outer(t, w)
    one, zero = np.ones((len(t), 1)), np.zeros((len(t), 1))
    sine, cosine = np.sin(angle), np.cos(angle)
    return (
        np.hstack([one, sine, cosine]),
        np.hstack([zero, w * cosine, -w * sine]),
        np.hstack([zero, -(w**2) * sine, -(w**2) * cosine]),
    )


def at_rest(harmonics: int) -> np.ndarray:
    """Coefficients (2 H + 1, 2 H - 1) of the series that begin at rest, as columns that are orthonormal."""
    k = np.arange(1.0, harmonics + 1)
    rows = np.zeros((2, 2 * harmonics + 1))
    rows[0, 1 : harmonics + 1], rows[1, harmonics + 1 :] = k, k**2
    return np.linalg.svd(rows)[2][2:].T
