"""The pose of a pattern from its corners in images of cameras that are known."""

from collections.abc import Sequence

import numpy as np

from gantrytau.kinematics.rotations import skewed, turned
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera

Array = np.ndarray
ROUNDS = 6
SETTLED = 1e-5  # m and rad: what a last step leaves is of the order of its square


def fitted_pose(
    cameras: Sequence[PlacedCamera], corners: Array, points: Array, r: Array, R: Array, sigma: float
) -> tuple[Array, Array, Array]:
    """Place (3,), orientation (3, 3) and covariance (6, 6) of a pattern, by Gauss-Newton from one near to it.

    corners: (C, P, 2) in pixels, NaN where missing; points: of the pattern, (P, 3) in m; sigma: of a corner in pixels.
    Raises LinAlgError where corners do not determine it.
    """
    covariance = np.full((6, 6), np.nan)
    for _ in range(ROUNDS):
        lever = points @ R.T
        errors, rows = [], []
        for camera, seen in zip(cameras, corners, strict=True):
            images, slopes = camera.slopes(r + lever)
            there = np.isfinite(seen[:, 0]) & np.isfinite(images[:, 0])
            errors.append((images - seen)[there].ravel())
            both = np.concatenate([slopes, slopes @ -skewed(lever)], axis=2)
            rows.append(both[there].reshape(-1, 6))
        J = np.vstack(rows)
        covariance = np.linalg.inv(J.T @ J)
        step = -covariance @ (J.T @ np.concatenate(errors))
        r, R = r + step[:3], turned(R[None], step[None, 3:])[0]
        if np.abs(step).max() < SETTLED:
            break
    return r, R, sigma**2 * covariance
