"""What images of a robot tell of its poses and of the cameras."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau.border.checks import array
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.fitting.diagnostics import Diagnostics
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.vision.scenes.scene import AHEAD

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Reconstruction(Record):
    """Poses of a pattern from images, in the axes of the first camera: x right, y down, z ahead.

    r: middle of the pattern, (N, 3) in m, NaN where it was not seen; R: its orientation, (N, 3, 3); covariance: of r after
    the best motion of all poses, (N, 3, 3) in m2; shared: what poses have in common of it, by the cameras, (N, 3, S) in m;
    cameras: where they stand, with the lenses of the fit; rms: of what is
    left of image points, in pixels; residuals: (C, N, P, 2) in pixels; scale: the size of the pattern as a multiple of what
    its side says, where spacing tells lengths; lens_deviations: (C, 5) standard deviations of ln focal length, centre in
    pixels, k1, k2, zero where lenses are given; turning: whether orientations differ from pose to pose; seconds: of the
    adjustment; steps: how many; findings: what was noticed, rows from 0;
    diagnostics: what is left of image points.
    """

    r: Array = field(repr=False)
    R: Array = field(repr=False)
    covariance: Array = field(repr=False)
    shared: Array = field(repr=False)
    cameras: tuple[PlacedCamera, ...] = field(repr=False)
    rms: float
    residuals: Array = field(repr=False)
    scale: float
    lens_deviations: Array = field(repr=False)
    turning: bool
    numbers: Array = field(repr=False)
    diagnostics: Diagnostics = field(repr=False)
    steps: int = 0
    seconds: float = 0.0
    findings: tuple[Finding, ...] = ()

    @property
    def found(self) -> Array:
        """Which poses there are, (N,)."""
        return np.isfinite(self.r[:, 0])

    @cached_property
    def expected(self) -> float:
        """The error of a place that covariance foretells after the best motion, rms in m."""
        return float(np.sqrt(np.mean(np.trace(self.covariance[self.found], axis1=1, axis2=2))))

    def measurements(
        self, q: Any, *, place: Any = (0.0, 0.0, 0.0), R: Any = AHEAD, turning: bool | None = None
    ) -> Measurements:
        """What `calibrate` takes: poses of the plate at positions q (N, n) of the actuators, of the rows that were found.

        place: middle of the pattern in the frame of the plate, (3,) in m; R: axes of the pattern in the frame of the plate,
        (3, 3); turning: whether orientations go along, by default where they were free. One camera ahead of the pattern
        tells its tilt badly: leave them out for robots that do not turn their plate.
        Raises ModelError for q of another number of rows.
        """
        q = array("measurements", "q", q, (len(self.r), None), finite=False)
        turning = self.turning if turning is None else turning
        rows = np.flatnonzero(self.found)
        axes = self.R[rows] @ np.asarray(R, dtype=float).T
        r = self.r[rows] - axes @ np.asarray(place, dtype=float)
        found = Measurements(q[rows], r, axes if turning else None, numbers=self.numbers[rows])
        return found.uncertain(self.covariance[rows], self.shared[rows])

    def __str__(self) -> str:
        lines = [
            f"{np.count_nonzero(self.found)} of {len(self.found)} poses by {len(self.cameras)} cameras, image points within "
            f"{self.rms:.3g} pixel (rms)",
            f"foretold error of a place: {1e3 * self.expected:.3g} mm (rms)",
        ]
        for c, camera in enumerate(self.cameras):
            turn = np.degrees(np.linalg.norm(rotation_vector(camera.R[None])[0]))
            focal, unsure = camera.focal[0], camera.focal[0] * self.lens_deviations[c, 0]
            lines.append(
                f"camera {c + 1}: focal length {focal:.1f} +- {unsure:.1f} pixel, "
                f"centre {camera.centre[0]:.1f}, {camera.centre[1]:.1f}, k1 {camera.distortion[0]:.4f}, "
                f"{np.linalg.norm(camera.r):.4f} m from the first, turned by {turn:.2f} deg"
            )
        return "\n".join([*lines, *(str(finding) for finding in self.findings)])
