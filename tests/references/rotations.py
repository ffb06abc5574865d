"""Rotations: R takes vectors from body axes to world axes, w is the angular velocity in world axes, R' = [w]x R."""

from __future__ import annotations

import numpy as np


def skew(vector: np.ndarray) -> np.ndarray:
    """The matrix [a]x, (3, 3), with [a]x b = a x b."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turn(vector: np.ndarray) -> np.ndarray:
    """The rotation by |vector| rad about vector (3,), (3, 3); Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    half = np.sinc(angle / (2 * np.pi))  # sin(angle / 2) / (angle / 2), regular at zero
    K = skew(vector)
    return np.eye(3) + np.sinc(angle / np.pi) * K + half**2 / 2 * K @ K


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """A uniformly distributed rotation, (3, 3)."""
    Q, U = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(U))
    return Q * np.linalg.det(Q)
