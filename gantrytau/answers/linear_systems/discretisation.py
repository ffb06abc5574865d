"""Linear systems from sample to sample: inputs held, or joined by straight lines, in between; and back."""

import warnings

import numpy as np


def held(A: np.ndarray, B: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """exp(A T) and its integral times B: x(t + T) of x' = A x + B u with u held for T = period, s.

    Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978).
    """
    from scipy.linalg import expm

    n, m = B.shape
    whole = expm(period * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


def unheld(A: np.ndarray, B: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B of the continuous system that is A (n, n), B (n, m) from sample to sample, inputs held: the inverse of `held`.

    By the principal logarithm, which takes every mode to be below half of the sampling frequency. A must have no
    eigenvalue at zero or on the negative real axis: there is no real logarithm. NaN where rounding spoils all.
    """
    from scipy.linalg import logm

    n, m = B.shape
    whole = np.block([[A, B], [np.zeros((m, n)), np.eye(m)]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of 1e-13 already
        try:
            found = np.real(logm(whole)) / period
        except ValueError:  # lost on the way
            found = np.full_like(whole, np.nan)
    return found[:n, :n], found[:n, n:]


def ramped(A: np.ndarray, B: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phi, G0, G1 with x(t + T) = Phi x + G0 u(t) + G1 u(t + T), u on a straight line in between."""
    from scipy.linalg import expm

    n, m = B.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, : n + m] = period * np.hstack([A, B])
    whole[n : n + m, n + m :] = np.eye(m)
    found = expm(whole)
    first, slope = found[:n, n : n + m], found[:n, n + m :]
    return found[:n, :n], first - slope, slope
