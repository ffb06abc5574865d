"""Poses in Study's coordinates, in which every link of a hexapod is one quadric.

A pose is a pair of quaternions z = (x, y), (8,), scalar first, up to a common factor, with

    R v = x v x* / x.x,   r = y x* / x.x,   x.y = 0 (Study's quadric),   x.x not zero.

A link of length L from A (base) to B (platform), |r + R B - A| = L, times x.x becomes

    y.y + (A.A + B.B - L^2) x.x + 2 y.(x B - A x) + 2 x.(A x B) = 0,

where A and B stand for quaternions without scalar part. Six of them and Study's quadric have 40 common points in
general: Wampler (1996), Forward displacement analysis of general six-in-parallel SPS (Stewart) platform
manipulators using soma coordinates, Mechanism and Machine Theory 31(3). Components may be complex; products are
bilinear, without conjugation.
"""

import numpy as np

STUDY = np.zeros((8, 8))  # x.y as a symmetric matrix
STUDY[:4, 4:] = STUDY[4:, :4] = np.eye(4) / 2

# quaternion product p q: of a unit vector as p, and of a unit vector as q, as matrices on the other factor
_LEFT = np.zeros((3, 4, 4))
_RIGHT = np.zeros((3, 4, 4))
for _k in range(3):
    _LEFT[_k, 1 + _k, 0] = _RIGHT[_k, 1 + _k, 0] = 1.0
    _LEFT[_k, 0, 1 + _k] = _RIGHT[_k, 0, 1 + _k] = -1.0
    for _sign, _after in ((1.0, (_k + 1) % 3), (-1.0, (_k + 2) % 3)):
        _other = 3 - _k - _after
        _LEFT[_k, 1 + _other, 1 + _after] = _sign
        _RIGHT[_k, 1 + _other, 1 + _after] = -_sign


def cross_matrices(v: np.ndarray) -> np.ndarray:
    """[v]x of vectors (n, 3), (n, 3, 3)."""
    K = np.zeros((len(v), 3, 3), v.dtype)
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = v[:, 0], v[:, 1], v[:, 2]
    return K - K.swapaxes(1, 2)


def quadrics(base: np.ndarray, platform: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """The quadrics of the links as symmetric matrices on z, (n, 8, 8), for joints (n, 3) and lengths (n,), in m."""
    left, right = np.einsum("nk,kij->nij", base, _LEFT), np.einsum("nk,kij->nij", platform, _RIGHT)
    reach = (base * base).sum(1) + (platform * platform).sum(1) - lengths**2
    found = np.zeros((len(base), 8, 8), np.result_type(left, right, reach))
    found[:, :4, :4] = reach[:, None, None] * np.eye(4) + 2 * left @ right
    found[:, 4:, :4] = right - left
    found[:, :4, 4:] = (right - left).swapaxes(1, 2)
    found[:, 4:, 4:] = np.eye(4)
    return found


def pose(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position (n, 3) and rotation (n, 3, 3) of the points z (n, 8) with x.x not zero."""
    x, y = z[:, :4], z[:, 4:]
    size = (x * x).sum(1)[:, None]
    K = cross_matrices(x[:, 1:])
    R = np.eye(3) + 2 * (x[:, :1, None] * K + K @ K) / size[:, :, None]
    r = (x[:, :1] * y[:, 1:] - y[:, :1] * x[:, 1:] - np.cross(y[:, 1:], x[:, 1:])) / size
    return r, R


def orthonormal(forms: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the space that the quadrics (n, 8, 8) span; they may be complex."""
    basis, _ = np.linalg.qr(forms.reshape(len(forms), 64).T)
    return basis.T.reshape(forms.shape)
