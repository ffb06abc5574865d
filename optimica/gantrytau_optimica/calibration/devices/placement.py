"""Where a device stands best: candidates compared by the accuracy that their own models foretell.

    sigma_k(T)^2 = tr cov(T) + |b(T)|^2        cov: of the measured position by noise, b: what wrong lenses shift it by

Of candidates that see as many poses that one is best whose sigma, as root mean square over these poses, is least.
Dressler (2012), section 5.6, leaves the pose of the camera to be optimised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.poses import poses
from gantrytau_optimica.calibration.devices.cameras import Cameras
from gantrytau_optimica.calibration.devices.devices import Array, Device, LaserTracker
from gantrytau_optimica.calibration.devices.sight import Bars


@dataclass(frozen=True, eq=False)
class Placement(Record):
    """Candidates (k,) for a device, over N poses.

    seen: (k, N), whether each sees each pose; position: foretold deviation of the measured position, (k, N) in m, NaN where
    it is not seen; order: candidates from the best to the worst, (k,).
    """

    devices: tuple[Device, ...]
    seen: Array
    position: Array
    order: Array

    @property
    def best(self) -> Device:
        """The candidate to take."""
        return self.devices[self.order[0]]

    @property
    def share(self) -> Array:
        """Share of the poses that each candidate sees, (k,)."""
        return self.seen.mean(axis=1)

    @property
    def error(self) -> Array:
        """Root mean square of `position` over the poses seen, (k,) in m; NaN where there are none."""
        return _root_mean_square(self.seen, self.position)

    def __repr__(self) -> str:
        k = self.order[0]
        return (
            f"<Placement: of {len(self.devices)} candidates number {k}, which sees {self.share[k]:.0%} of the poses, each "
            f"to {self.error[k] * 1e3:.3g} mm>"
        )


def place_device(
    candidates: Sequence[Cameras | LaserTracker], r: Any, R: Any = None, *, bars: Bars | None = None
) -> Placement:
    """Compare candidates for a device over the poses r (N, 3) in m, R (N, 3, 3), default no rotation, that it will measure.

        place_device([stereo_cameras((4.0, y, 0.0), (0.5, 2.8, -0.6)) for y in (2, 3, 4)], r, R).best

    bars: links that may hide the target, as of `Device.sees`. A candidate that sees more poses comes first, however sure it
    is of them. Raises ModelError for no candidates, those that are no cameras or laser trackers, and where none sees a pose.
    """
    found = tuple(candidates) if isinstance(candidates, Sequence) else ()
    if not found or not all(isinstance(one, Cameras | LaserTracker) for one in found):
        raise ModelError(
            "expected a sequence of Cameras, LaserTracker or TMac, one or more",
            place="place_device",
            found=Given("candidates", candidates),
        )
    tool = poses(r, np.eye(3) if R is None else R, "place_device")
    assert tool.R is not None  # one orientation was given at least
    seen = np.array([one.sees(tool.r, tool.R, bars=bars) for one in found])
    if not seen.any():
        raise ModelError(
            f"place_device: found no candidate that sees one of {seen.shape[1]} poses; look at `facing`, into which the "
            "target looks, and at what the device looks at",
            argument="candidates",
        )
    position = np.full(seen.shape, np.nan)
    for one, rows, row in zip(found, seen, position, strict=True):
        row[rows] = _deviation(one, tool.r[rows], tool.R[rows])
    error = _root_mean_square(seen, position)
    return Placement(found, seen, position, np.lexsort((error, -seen.sum(axis=1))))


def _deviation(device: Cameras | LaserTracker, r: Array, R: Array) -> Array:
    """Foretold deviation of the position at poses that the device sees, (N,) in m."""
    squares = np.trace(device.covariance(r, R)[:, :3, :3], axis1=1, axis2=2)
    if isinstance(device, Cameras):
        shifted = replace(device, noise=0.0).measure(r, R).r - r
        squares = squares + np.sum(shifted**2, axis=1)
    return np.sqrt(squares)


def _root_mean_square(seen: Array, position: Array) -> Array:
    count = seen.sum(axis=1)
    squares = np.where(seen, position**2, 0.0).sum(axis=1)
    return np.sqrt(np.where(count > 0, squares, np.nan) / np.maximum(count, 1))
