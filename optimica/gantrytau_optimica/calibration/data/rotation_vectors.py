"""Rotation vectors, whose direction is the axis and whose length the angle in rad."""

import numpy as np

from gantrytau.kinematics.rotations import best_rotation, skewed, turned

NEAR_HALF_A_TURN = 0.05  # rad


def rotation(w: np.ndarray) -> np.ndarray:
    """exp([w]x), (3, 3) (Rodrigues)."""
    return rotations(np.asarray(w)[None])[0]


def rotations(w: np.ndarray) -> np.ndarray:
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
    axis = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axis, axis=-1) / 2
    cosine = (np.trace(R, axis1=-2, axis2=-1) - 1) / 2
    angle = np.arctan2(sine, cosine)
    found = axis / 2 * (angle / np.where(sine < 1e-12, 1.0, sine))[..., None]
    half_turn = (sine < 1e-6) & (cosine < 0)
    if np.any(half_turn):  # the axis is the column of R + I that is longest
        columns = (R + np.eye(3))[half_turn]
        best = np.argmax(np.linalg.norm(columns, axis=-2), axis=-1)
        axes = np.take_along_axis(columns, best[:, None, None], axis=-1)[..., 0]
        found[half_turn] = np.pi * axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    return found


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
        return rotation(np.pi * across / np.linalg.norm(across))
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
