"""Polynomials of order 5 by value, rate and second rate at both ends of an interval."""

from math import comb

import numpy as np

ORDER = 5
BINOMIALS = np.array([[comb(k, j) for k in range(6)] for j in range(6)])


def quintic(begin: np.ndarray, end: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Coefficients (n, 6), of the lowest power first, in the time behind the begin of intervals of length h (n,).

    begin, end: value, rate and second rate there, (n, 3).
    """
    h = h[:, None]
    scale = np.hstack([np.ones_like(h), h, h**2])
    (p, v, a), (q, w, b) = (begin * scale).T, (end * scale).T
    rest = q - p - v - a / 2, w - v - a, b - a  # of the three upper powers, in units of the interval
    third = 10 * rest[0] - 4 * rest[1] + rest[2] / 2
    fourth = -15 * rest[0] + 7 * rest[1] - rest[2]
    fifth = 6 * rest[0] - 3 * rest[1] + rest[2] / 2
    return np.stack([p, v, a / 2, third, fourth, fifth], axis=-1) / h ** np.arange(ORDER + 1)


def shifted(coefficients: np.ndarray, s: np.ndarray | float) -> np.ndarray:
    """The polynomials (..., 6) in the time after s, in their unit of time; s: (...)."""
    powers = np.arange(ORDER + 1)[None, :] - np.arange(ORDER + 1)[:, None]
    factors = BINOMIALS * np.asarray(s)[..., None, None] ** np.maximum(powers, 0)
    return np.einsum("...jk,...k->...j", factors, coefficients)


def values_and_rates(coefficients: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Value, rate and second rate of polynomials (n, 6) at s (n,), as (n, 3)."""
    return shifted(coefficients, s)[:, :3] * [1.0, 1.0, 2.0]
