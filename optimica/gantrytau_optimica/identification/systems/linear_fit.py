"""The rest of a linear system, when A and C are known: outputs are linear in B, D, the first state and a constant.

y[k] = C A^k x0 + sum_j C A^(k-1-j) B u[j] + D u[k] + y0
"""

import numpy as np

from gantrytau_optimica.fitting.linear import linear_least_squares


def input_matrices(
    A: np.ndarray, C: np.ndarray, u: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """B (n, m) and D (p, m) of least squares of the simulated outputs, u (N, m), y (N, p)."""
    n, m, p = len(A), u.shape[1], len(C)
    powers = free_responses(A, C, len(u))  # (N, p, n)
    forced = np.stack([_convolved(powers[:-1], u[:-1, j]) for j in range(m)], axis=3)  # (N - 1, p, n, m)
    rows = np.zeros((len(u), p, n * m + p * m))
    rows[1:, :, : n * m] = forced.reshape(len(u) - 1, p, n * m)
    for i in range(p):
        rows[:, i, n * m + i * m : n * m + (i + 1) * m] = u
    rows = np.concatenate([rows, _starts(powers)], axis=2).reshape(len(u) * p, -1)
    found = linear_least_squares(rows, y.ravel())
    return found[: n * m].reshape(n, m), found[n * m : (n + p) * m].reshape(p, m)


def followed(system: tuple[np.ndarray, ...], u: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Outputs (N, p) of A, B, C, D with the inputs, from the first state and about the constants that suit y best.

    Outputs count in units of their motion about the mean.
    """
    A, B, C, D = system
    sizes = np.linalg.norm(y - y.mean(axis=0), axis=0)
    C, D, y = C / sizes[:, None], D / sizes[:, None], y / sizes
    powers = free_responses(A, C, len(u))
    found = u @ D.T
    for j, pulses in enumerate(np.moveaxis(powers[:-1] @ B, 2, 0)):
        found[1:] += _convolved(pulses, u[:-1, j])
    free = _starts(powers).reshape(-1, len(A) + len(C))
    return (found + (free @ linear_least_squares(free, (y - found).ravel())).reshape(y.shape)) * sizes


def free_responses(A: np.ndarray, C: np.ndarray, count: int) -> np.ndarray:
    """C A^k for k = 0 to count - 1, (count, p, n), by doubling."""
    found, power = C[None], A
    while len(found) < count:
        found = np.concatenate([found, found @ power])
        power = power @ power
    return found[:count]


def _starts(powers: np.ndarray) -> np.ndarray:
    """What first states and constants add to the outputs, (N, p, n + p)."""
    count, p, _ = powers.shape
    return np.concatenate([powers, np.tile(np.eye(p), (count, 1, 1))], axis=2)


def _convolved(h: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Sum over j of h[k - j] u[j], like h (N, ...), for u (N,)."""
    length = 2 ** int(np.ceil(np.log2(2 * len(u))))
    spectrum = np.fft.rfft(u, length).reshape(-1, *[1] * (h.ndim - 1))
    product = np.fft.rfft(h, length, axis=0) * spectrum
    return np.fft.irfft(product, length, axis=0)[: len(u)]
