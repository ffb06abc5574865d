"""Rotation vectors, whose direction is the axis and whose length the angle in rad."""

import numpy as np

SMALL = 1e-6  # rad, below which series to second order are exact in double precision


def skew(a: np.ndarray) -> np.ndarray:
    """The matrix of a x, (3, 3)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rotation(w: np.ndarray) -> np.ndarray:
    """exp([w]x), (3, 3) (Rodrigues)."""
    angle, K = float(np.linalg.norm(w)), skew(w)
    if angle < SMALL:
        return np.eye(3) + K + K @ K / 2
    return np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K


def rotations(w: np.ndarray) -> np.ndarray:
    """exp([w]x) of many, (N, 3) -> (N, 3, 3)."""
    angle = np.linalg.norm(w, axis=1)
    safe = np.where(angle < SMALL, 1.0, angle)
    first = np.where(angle < SMALL, 1.0, np.sin(safe) / safe)
    second = np.where(angle < SMALL, 0.5, (1 - np.cos(safe)) / safe**2)
    K = np.zeros((len(w), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -w[:, 2], w[:, 1], -w[:, 0]
    K -= K.transpose(0, 2, 1)
    return np.eye(3) + first[:, None, None] * K + second[:, None, None] * (K @ K)


def left_jacobian(w: np.ndarray) -> np.ndarray:
    """J of exp([w + dw]x) = exp([J dw]x) exp([w]x) to first order, (3, 3)."""
    angle, K = float(np.linalg.norm(w)), skew(w)
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


def turning(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation that turns the direction of a into that of b, (3, 3)."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-12:  # opposite: half a turn about any axis across
        across = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return rotation(np.pi * across / np.linalg.norm(across))
    K = skew(axis)
    return np.eye(3) + K + K @ K / (1 + cosine)
