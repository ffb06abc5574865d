"""Robust standard deviations of residuals, and weights of strays.

s = 1.4826 median |e|          standard deviation of e where noise is normal (Huber, 1981)
Huber   w = min(1, k / |u|)    u = e / s; the weight of u^2, linear beyond k
Tukey   sqrt w = 1 - (u / c)^2 for |u| < c, else 0: gross errors do not count
"""

import numpy as np

NORMAL = 1.4826  # standard deviation over median deviation of a normal distribution
OUTLIER = 7.0  # robust standard deviations; of 100,000 normal errors the largest has 4.5
CHANCE = 1e-6  # that noise of few values exceeds the limit
ROUNDS = 10  # of weighing anew
HUBER, BISQUARE = 1.345, 4.685  # deviations k and c: 95 % as efficient as squares where noise is normal


def limit(freedom: float) -> float:
    """Limit of noise in robust standard deviations, these estimated with `freedom` degrees of freedom."""
    from scipy.special import stdtrit

    return max(OUTLIER, float(stdtrit(max(1.0, freedom), 1.0 - CHANCE)))


def robust_deviation(left: np.ndarray, taken: int = 0) -> float:
    """Standard deviation of residuals (N,) by the median of their amounts; taken: number of fitted parameters."""
    return NORMAL * float(np.median(np.abs(left))) * float(np.sqrt(len(left) / max(len(left) - taken, 1)))


def robust_deviations(left: np.ndarray, axis: int = 0) -> np.ndarray:
    """Robust standard deviations along an axis of an array."""
    return NORMAL * np.median(np.abs(left), axis=axis)


def huber_weights(sizes: np.ndarray, beyond: float = HUBER) -> np.ndarray:
    """Huber's weights of squares, at most 1; sizes: residuals over their standard deviation."""
    return np.minimum(1.0, beyond / np.maximum(np.abs(sizes), 1e-300))


def tukey_roots(sizes: np.ndarray) -> np.ndarray:
    """Roots of Tukey's weights, factors of residuals; sizes: residuals over their standard deviation."""
    return np.maximum(1 - (sizes / BISQUARE) ** 2, 0.0)


def without_strays(left: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    """Residuals (N,) of a robust fit, from the residuals (N,) of least squares and their Jacobian (N, k).

    Tukey's bisquare from the median of the amounts, to first order.
    """
    sizes = np.linalg.norm(jacobian, axis=0)
    X = jacobian[:, sizes > 0] / sizes[sizes > 0]
    if not X.size or len(X) <= X.shape[1]:
        return left
    found, scale = left, robust_deviation(left)
    for _ in range(ROUNDS):
        if not scale > 0:
            break
        weights = tukey_roots(found / scale)
        step = np.linalg.lstsq(X * weights[:, None], left * weights, rcond=1e-9)[0]
        found = left - X @ step
        scale = robust_deviation(found, X.shape[1])
    return found
