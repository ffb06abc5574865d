"""Responses of linear systems: over frequency, and over time to samples."""

import numpy as np

from gantrytau.answers.linear_systems.discretisation import ramped
from gantrytau.border.checks import array
from gantrytau.border.refusal import ModelError

AT_ONCE = 4_000_000  # numbers in the matrices that are solved in one call


def frequency_response(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """C (s I - A)^-1 B + D at points s (N,), (k, m, N) complex; infinite at a pole."""
    n = len(A)
    found = np.repeat(D[:, :, None].astype(complex), len(points), axis=2)
    chunk = max(1, AT_ONCE // max(1, n * n))
    for first in range(0, len(points) if n else 0, chunk):
        some = slice(first, first + chunk)
        matrices = points[some, None, None] * np.eye(n) - A
        try:
            found[:, :, some] += np.moveaxis(C @ np.linalg.solve(matrices, B), 0, 2)
        except np.linalg.LinAlgError:  # one of them is exactly singular
            poles = np.linalg.matrix_rank(matrices) < n
            matrices[poles] = np.eye(n)
            found[:, :, some] += np.moveaxis(C @ np.linalg.solve(matrices, B), 0, 2)
            found[:, :, some][:, :, poles] = np.inf
    return found


def stepped(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, u: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """y[k] = C x[k] + D u[k] with x[k + 1] = A x[k] + B u[k], for u (N, m) from x (n,); (N, k)."""
    states = np.empty((len(u), len(A)))
    driven = u @ B.T
    for k, push in enumerate(driven):
        states[k] = x
        x = A @ x + push
    return states @ C.T + u @ D.T


def driven(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, t: np.ndarray, u: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Y (N, k) at times t (N,) of x' = A x + B u, y = C x + D u, exactly, for u (N, m) joined by straight lines."""
    states = np.empty((len(t), len(A)))
    known: dict[float, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    states[0] = x
    for k, h in enumerate(np.diff(t).tolist()):
        if h not in known:
            known[h] = ramped(A, B, h)
        Phi, first, last = known[h]
        states[k + 1] = Phi @ states[k] + first @ u[k] + last @ u[k + 1]
    return states @ C.T + u @ D.T


def checked_inputs(name: str, u: object, count: int) -> np.ndarray:
    """Samples of `count` inputs as (N, count), N > 0; ModelError for another shape or what is not finite."""
    found = array(name, "u", u, (None, count), *([(None,)] if count == 1 else []))
    if not len(found):
        raise ModelError(f"{name}: found no samples, expected at least one", argument="u")
    return found.reshape(len(found), count)
