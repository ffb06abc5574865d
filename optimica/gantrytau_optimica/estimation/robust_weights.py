"""Weights of a robust fit: Huber (1981), Robust Statistics, chapter 7."""

import numpy as np

HUBER = (
    1.345  # standard deviations beyond which errors count linearly: 95 % as efficient where noise is normal
)
NORMAL = 1.4826  # standard deviation over median deviation of a normal distribution


def median_deviation(errors: np.ndarray) -> np.ndarray:
    """The standard deviation by the median of the amounts of errors (N, ...), which stray values do not move."""
    return NORMAL * np.median(np.abs(errors), axis=0)


def huber_weights(errors: np.ndarray, deviation: float | np.ndarray) -> np.ndarray:
    """Weights at most 1 of the squares of errors (N, ...) with this standard deviation."""
    return np.minimum(1.0, HUBER * deviation / np.maximum(np.abs(errors), 1e-300))
