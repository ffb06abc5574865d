"""Poses, real or complex, brought to the lengths of the links as exactly as rounding allows.

Newton on |r + R B - A|^2 = L^2 with steps (dr, w), R turned by Cayley's rational form of a rotation, which holds for
complex w as well. Near rounding the steps wander; the best pose on the way is taken.
"""

import numpy as np

from gantrytau.kinematics.study import cross_matrices
from gantrytau.kinematics.study_tracking import solved

STEPS = 8  # two converge from the roots in Study's coordinates; of the others the best is taken


def link_errors(r: np.ndarray, R: np.ndarray, base: np.ndarray, platform: np.ndarray, lengths: np.ndarray):
    """Largest ||r + R B - A| - L| over the links of poses r (k, 3), R (k, 3, 3), in m, (k,)."""
    gaps = r[:, None] + platform @ R.swapaxes(1, 2) - base
    return np.abs(np.sqrt((gaps * gaps).sum(2)) - lengths).max(1)


def exact_poses(
    r: np.ndarray, R: np.ndarray, base: np.ndarray, platform: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The poses r (k, 3), R (k, 3, 3) after Newton, and their link errors (k,) in m.

    What remains is rounding: some 1e-16 |r|^2 / L, which only complex poses far away make visible.
    """
    R = R @ (3 * np.eye(3) - R.swapaxes(1, 2) @ R) / 2  # orthogonal again where x.x was a small difference
    best_r, best_R = r, R
    best = link_errors(r, R, base, platform, lengths)
    for _ in range(STEPS):
        r, R = _step(r, R, base, platform, lengths)
        error = link_errors(r, R, base, platform, lengths)
        better = error < best
        best_r = np.where(better[:, None], r, best_r)
        best_R = np.where(better[:, None, None], R, best_R)
        best = np.minimum(best, error)
    return best_r, best_R, best


def _step(r: np.ndarray, R: np.ndarray, base: np.ndarray, platform: np.ndarray, lengths: np.ndarray):
    arms = platform @ R.swapaxes(1, 2)
    gaps = r[:, None] + arms - base
    left = ((gaps * gaps).sum(2) - lengths**2) / 2
    change = -solved(np.concatenate([gaps, np.cross(arms, gaps)], axis=2), left[:, :, None])[:, :, 0]
    half = change[:, 3:] / 2
    K = cross_matrices(half)
    turn = np.eye(3) + 2 * (K + K @ K) / (1 + (half * half).sum(1))[:, None, None]
    return r + change[:, :3], turn @ R
