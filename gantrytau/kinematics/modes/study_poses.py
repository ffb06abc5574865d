"""Poses from Study's coordinates, real or complex, with links as exact as the longest numbers of the machine allow.

Poses far away are quotients of small differences, and their links differences of large squares: some 1e-16 |r|^2 / L
is lost in doubles. Newton in Study's coordinates, where z has length 1 wherever the pose is, with quadrics in longer
numbers, loses a two-thousandth of that on x86; elsewhere long numbers may be doubles.
"""

from typing import NamedTuple

import numpy as np

from gantrytau.kinematics.modes.study_coordinates import STUDY, pose, quadrics
from gantrytau.kinematics.modes.study_tracking import newton_step

STEPS = 3  # one makes 1e-16 of a root as small as its condition allows, the next ones what is left


class ExactPoses(NamedTuple):
    """Poses r (k, 3), R (k, 3, 3) in long numbers (np.clongdouble), and their link errors (k,) in m."""

    r: np.ndarray
    R: np.ndarray
    error: np.ndarray


def link_errors(r: np.ndarray, R: np.ndarray, base: np.ndarray, platform: np.ndarray, lengths: np.ndarray):
    """Largest ||r + R B - A| - L| over the links of poses r (k, 3), R (k, 3, 3), in m, (k,)."""
    gaps = r[:, None] + platform @ R.swapaxes(1, 2) - base
    return np.abs(np.sqrt((gaps * gaps).sum(2)) - lengths).max(1)


def exact_poses(
    z: np.ndarray, base: np.ndarray, platform: np.ndarray, lengths: np.ndarray, size: float
) -> ExactPoses:
    """The poses of roots z (k, 8), those of the hexapod about the middles of its joints and by its size.

    Roots must be regular: Newton does not know singular ones better than `z` does.
    """
    base, platform, lengths = (a.astype(np.longdouble) for a in (base, platform, lengths))
    low, high = base.mean(0), platform.mean(0)
    forms = np.concatenate(
        [quadrics((base - low) / size, (platform - high) / size, lengths / size), STUDY[None]]
    )
    forms = forms / np.sqrt((forms * forms).sum((1, 2)))[:, None, None]
    z = z.astype(np.clongdouble)
    for _ in range(STEPS):
        z = z + newton_step(np.einsum("nc,rcd->nrd", z, forms), z, z.conj())
    r, R = pose(z)
    r = r * size + low - R @ high
    return ExactPoses(r, R, link_errors(r, R, base, platform, lengths))
