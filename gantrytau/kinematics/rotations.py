"""Rotations of many poses at once, the first axis is the pose: matrices, unit quaternions, rotation vectors.

The direction of a rotation vector is the axis, its length the angle in rad.
"""

import numpy as np

SMALL = 1e-8  # rad, below which sin(x) / x is 1 to the last digit
NEAR_HALF_A_TURN = 0.05  # rad


def skewed(v: np.ndarray) -> np.ndarray:
    """The matrix of the cross product with v: (..., 3) -> (..., 3, 3)."""
    found = np.zeros((*v.shape, 3))
    found[..., 0, 1], found[..., 0, 2] = -v[..., 2], v[..., 1]
    found[..., 1, 0], found[..., 1, 2] = v[..., 2], -v[..., 0]
    found[..., 2, 0], found[..., 2, 1] = -v[..., 1], v[..., 0]
    return found


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The cross product (..., 3), several times as quick as that of NumPy for many short vectors."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def turned(R: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """R (N, 3, 3) turned further by rotation vectors (N, 3), rad, resolved in the world (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=-1)
    safe = np.where(angle < SMALL, 1.0, angle)
    once = np.where(angle < SMALL, 1.0, np.sin(safe) / safe)
    twice = np.where(angle < SMALL, 0.5, 2.0 * np.sin(safe / 2) ** 2 / safe**2)
    u = skewed(vector)
    return R + (once[:, None, None] * u + twice[:, None, None] * (u @ u)) @ R


def about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotations about one unit axis (3,) by angles (N,): (N, 3, 3)."""
    u = skewed(axis)
    return np.eye(3) + np.sin(angle)[:, None, None] * u + (1.0 - np.cos(angle))[:, None, None] * (u @ u)


def of_quaternion(q: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion, scalar first, (3, 3)."""
    return of_quaternions(np.asarray(q)[None])[0]


def of_quaternions(q: np.ndarray) -> np.ndarray:
    """Rotations of unit quaternions (N, 4), scalar first: (N, 3, 3)."""
    u = skewed(q[:, 1:])
    return np.eye(3) + 2 * q[:, 0, None, None] * u + 2 * (u @ u)


def quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotations (N, 3, 3), scalar first and not negative: (N, 4)."""
    d = np.einsum("nii->ni", R)
    trace = d.sum(axis=1)
    squares = 1 + np.stack([trace, *(2 * d[:, k] - trace for k in range(3))], axis=1)
    w = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    symmetric = R + R.transpose(0, 2, 1)
    table = np.empty((len(R), 4, 4))  # row k is 4 q_k q: the largest is safe to divide by (Shepperd, 1978)
    table[:, 0, 0], table[:, 0, 1:], table[:, 1:, 0], table[:, 1:, 1:] = squares[:, 0], w, w, symmetric
    for k in range(3):
        table[:, k + 1, k + 1] = squares[:, k + 1]
    largest = np.argmax(np.nan_to_num(squares), axis=1)
    rows = table[np.arange(len(R)), largest]
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    return np.where(rows[:, :1] < 0, -rows, rows)


def best_rotation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotations R (N, 3, 3) that bring vectors b (N, k, 3) nearest to a (N, k, 3), in squares (Kabsch, 1976)."""
    finite = np.asarray(np.isfinite(a).all(axis=(1, 2)) & np.isfinite(b).all(axis=(1, 2)))
    moments = np.where(finite[:, None, None], np.swapaxes(a, 1, 2) @ b, 0.0)
    u, _, v = np.linalg.svd(moments)
    u[:, :, 2] *= np.linalg.det(u @ v)[:, None]
    return np.where(finite[:, None, None], u @ v, np.nan)


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between vectors (..., 3) and (..., 3), rad, exact where it is small as well."""
    return np.arctan2(np.linalg.norm(cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def of_vector(w: np.ndarray) -> np.ndarray:
    """exp([w]x), (3, 3) (Rodrigues)."""
    return of_vectors(np.asarray(w)[None])[0]


def of_vectors(w: np.ndarray) -> np.ndarray:
    """exp([w]x) of many, (N, 3) -> (N, 3, 3)."""
    return turned(np.broadcast_to(np.eye(3), (len(w), 3, 3)), w)


def left_jacobian(w: np.ndarray) -> np.ndarray:
    """J of exp([w + dw]x) = exp([J dw]x) exp([w]x) to first order, (3, 3)."""
    angle, K = float(np.linalg.norm(w)), skewed(w)
    if angle < 1e-4:  # the quotient below loses digits
        return np.eye(3) + K / 2 + K @ K / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * K @ K


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """The rotation vector of rotation matrices, (..., 3, 3) -> (..., 3), angles from 0 to pi."""
    q = quaternions(R.reshape(-1, 3, 3))
    sine = np.linalg.norm(q[:, 1:], axis=1)  # of half the angle
    share = np.where(sine < SMALL, 2.0, 2.0 * np.arctan2(sine, q[:, 0]) / np.where(sine < SMALL, 1.0, sine))
    return (share[:, None] * q[:, 1:]).reshape(R.shape[:-1])


def told_vector(R: np.ndarray) -> np.ndarray:
    """The rotation vector by which a rotation (3, 3) is reported: near half a turn that whose largest element is positive.

    There noise would change its sign; so its angle may be a little above pi.
    """
    w = rotation_vector(R)
    angle = float(np.linalg.norm(w))
    near = angle > np.pi - NEAR_HALF_A_TURN
    return w * (1 - 2 * np.pi / angle) if near and w[np.argmax(np.abs(w))] < 0 else w


def turning(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation that turns the direction of a into that of b, (3, 3)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-12:  # opposite: half a turn about any axis across
        across = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return of_vector(np.pi * across / np.linalg.norm(across))
    K = skewed(axis)
    return np.eye(3) + K + K @ K / (1 + cosine)


def mean_rotation(R: np.ndarray) -> np.ndarray:
    """The rotation nearest to the mean of many, in squares, (N, 3, 3) -> (3, 3)."""
    return best_rotation(R.mean(axis=0).T[None], np.eye(3)[None])[0]


def motion(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rotation (3, 3) and shift (3,) that bring points a (N, 3) nearest to b, in squares."""
    centre_a, centre_b = a.mean(axis=0), b.mean(axis=0)
    turn = best_rotation((b - centre_b)[None], (a - centre_a)[None])[0]
    return turn, centre_b - turn @ centre_a
