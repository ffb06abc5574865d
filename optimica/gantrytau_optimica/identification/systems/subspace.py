"""A and C of a linear system from its inputs and outputs, by the space that its past and its future share.

Rows of block Hankel matrices are past and future inputs and outputs, one column for each instant,

    [1; U_f; U_p; Y_p; Y_f] = L Q,    Gamma X ~ L32 Q2,    W L32 = U S V',    Gamma = W^-1 U S^1/2

W = (Y_f P Y_f')^-1/2 with the future inputs projected out (P) makes the singular values S canonical correlations (CVA).
Gamma = [C; C A; ...] then gives C, and A by its shift. Van Overschee and De Moor (1996), chapter 4; Larimore (1990).
"""

from dataclasses import dataclass

import numpy as np

EMPTY = 1e-9  # of the largest singular value, below which data have no more directions


@dataclass(frozen=True, eq=False)
class SharedSpace:
    """Canonical correlations (k,) of past and future, the extended observability Gamma (p i, k), and what is excited.

    excited: rank of the 2 i rows of each input together, of `wanted`.
    """

    correlations: np.ndarray
    observability: np.ndarray
    outputs: int
    excited: int
    wanted: int

    def system(self, order: int) -> tuple[np.ndarray, np.ndarray]:
        """A (n, n) and C (p, n)."""
        gamma = self.observability[:, :order]
        A = np.linalg.lstsq(gamma[: -self.outputs], gamma[self.outputs :], rcond=None)[0]
        return A, gamma[: self.outputs]


def shared_space(u: np.ndarray, y: np.ndarray, rows: int) -> SharedSpace:
    """Space shared by past and future of inputs u (N, m) and outputs y (N, p), `rows` samples each."""
    m, p = u.shape[1], y.shape[1]
    parts = [_hankel(u, rows, rows), _hankel(u, 0, rows), _hankel(y, 0, rows), _hankel(y, rows, rows)]
    # constants of u and y are projected out with the future inputs
    stacked = np.hstack([np.ones((len(parts[0]), 1)), *parts])
    # L' of the transposed matrix, whose rows are instants
    L = np.asarray(np.linalg.qr(stacked, mode="r")).T
    future, past = 1 + m * rows, 1 + (2 * m + p) * rows
    sizes = np.linalg.svd(L[1 : 1 + 2 * m * rows, 1 : 1 + 2 * m * rows], compute_uv=False)
    L32, L33 = L[past:, future:past], L[past:, past:]
    U, s, _ = np.linalg.svd(np.hstack([L32, L33]), full_matrices=False)
    kept = s > EMPTY * s[0]
    U, s = U[:, kept], s[kept]
    V, correlations, _ = np.linalg.svd((U / s).T @ L32, full_matrices=False)
    return SharedSpace(
        correlations,
        (U * s) @ V * np.sqrt(correlations),
        p,
        int(np.sum(sizes > EMPTY * sizes[0])),
        len(sizes),
    )


def _hankel(x: np.ndarray, first: int, rows: int) -> np.ndarray:
    """Samples k + first to k + first + rows - 1 in row k, (N - 2 rows + 1, rows columns)."""
    windows = np.lib.stride_tricks.sliding_window_view(x, rows, axis=0)  # (N - rows + 1, columns, rows)
    part = windows[first : len(x) - 2 * rows + 1 + first]
    return part.transpose(0, 2, 1).reshape(len(part), -1)
