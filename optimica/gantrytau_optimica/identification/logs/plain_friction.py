"""How forces follow motion whatever the robot: masses, weight and friction of each actuator by least squares.

    f_i = sum_j m_ij q_j'' + c_i sign(q_i') + d_i q_i' + sum_j k_ij q_j + b_i

A robot's masses change with its pose, so this is no model of it; but power that friction takes is positive with the right
sign of the force, and the fit is best where forces and motion are of the same time.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.fitting.linear import column_norms

LAGS = 25  # samples, to either side, among which the best is looked for
BETTER = 0.97  # of the squares without lag, which a lag must leave to be told; one sample rarely does
ENOUGH = 0.5  # of the forces' variance, that must be explained before anything is said
LEAST_POWER = 0.02  # of the mean of |f v|, below which friction has no sign


@dataclass(frozen=True)
class PlainFits:
    """lag: samples by which forces come after the motion; reversed: whether all of them have the opposite sign."""

    lag: int
    reversed: bool


def plain_fits(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, f: np.ndarray, inner: np.ndarray
) -> PlainFits | None:
    """The fits of q, v, a (M, n) known in the rows `inner` (M,) of forces f (N, n); None where they explain too little."""
    kept = np.flatnonzero((inner >= LAGS) & (inner < len(f) - LAGS))
    if len(kept) < 10 * (2 * q.shape[1] + 4):
        return None
    q, v, a, rows = q[kept], v[kept], a[kept], inner[kept]
    bases = [_basis(_columns(q, v, a, k)) for k in range(q.shape[1])]
    left = {lag: _left(bases, f[rows + lag]) for lag in range(-LAGS, LAGS + 1)}
    lag = min(left, key=lambda one: left[one])
    total = float(np.sum((f[rows] - f[rows].mean(axis=0)) ** 2))
    if left[lag] > (1 - ENOUGH) * total or abs(lag) == LAGS:
        return None
    lag = lag if left[lag] < BETTER * left[0] else 0
    powers = [_power(_columns(q, v, a, k), f[rows + lag, k], v[:, k]) for k in range(q.shape[1])]
    return PlainFits(lag, all(power < -LEAST_POWER for power in powers))


def _columns(q: np.ndarray, v: np.ndarray, a: np.ndarray, k: int) -> np.ndarray:
    """The columns of the formula of one actuator, friction first."""
    return np.column_stack([np.sign(v[:, k]), v[:, k], a, q - q.mean(axis=0), np.ones(len(q))])


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns of the same span."""
    return np.linalg.qr(columns / column_norms(columns))[0]


def _left(bases: Sequence[np.ndarray], f: np.ndarray) -> float:
    """Sum of squares of the forces that the fits of all actuators leave."""
    return sum(float(np.sum((y - basis @ (basis.T @ y)) ** 2)) for basis, y in zip(bases, f.T, strict=True))


def _power(columns: np.ndarray, f: np.ndarray, v: np.ndarray) -> float:
    """Power that friction takes, as part of what goes in and out."""
    found = np.linalg.lstsq(columns, f, rcond=None)[0]
    return float(np.mean((columns[:, :2] @ found[:2]) * v) / max(float(np.mean(np.abs(f * v))), 1e-300))
