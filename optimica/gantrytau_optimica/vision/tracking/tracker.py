"""A pattern that moves, found anew in each image where a predictor expects it: at 250 Hz, where detection alone has 15."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import rotation_vector, turned
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.detection.detections import homography
from gantrytau_optimica.vision.detection.quincunx import find_quincunx, noise_of
from gantrytau_optimica.vision.detection.square_edges import measure_edges
from gantrytau_optimica.vision.image_series import grey_of
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.reconstruction.relative_orientation import plates, plates_of_one, triangulated
from gantrytau_optimica.vision.tracking.pose_fit import fitted_pose

Array = np.ndarray
MARGIN = 0.5  # of the extent of the pattern in the image, around which edges are looked for
NEAR = 1.0  # pixel, by which corners may be off where they were expected to be measured once only
SIGMA = 0.1  # pixel, of a corner
COASTED = 25  # images without the pattern, after which it is looked for everywhere
UNKNOWN = 10.0  # m/s and rad/s, of a velocity before there is one


@dataclass(frozen=True, eq=False)
class Tracked(Record):
    """Where a pattern is at one instant, filtered: r (3,) in m, R (3, 3), v (3,) in m/s, w (3,) in rad/s, in the world.

    seen: whether this image showed it, else it is where it was expected; deviation: of r, in m; searched: whether it was
    looked for in the whole image.
    """

    r: Array
    R: Array
    v: Array
    w: Array
    seen: bool
    deviation: float
    searched: bool


@dataclass(eq=False)
class PatternTracker(Record):
    """Follows a quincunx with cameras that are known.

        tracker = PatternTracker(Pattern.quincunx(0.06), found.cameras)
        for left, right in images:
            here = tracker.update([left, right])

    cameras: where they stand (`Reconstruction.cameras`, `PlacedCamera.looking`); period: between images, s; acceleration:
    standard deviation of what a predictor of constant velocity does not expect, m/s2, and rad/s2 for turns; up: of the
    pattern in the image, as of `detect`. Filtered by Kalman with the covariance of each pose.
    Raises ModelError for another pattern, cameras that stand nowhere and images that are not as many.
    """

    pattern: Pattern
    cameras: Sequence[PlacedCamera]
    period: float = 0.004
    acceleration: float = 5.0
    turning: float = 20.0
    up: float = 0.0
    _state: tuple[Array, Array, Array] | None = field(default=None, init=False, repr=False)
    _axes: Array = field(default_factory=lambda: np.eye(3), init=False, repr=False)
    _missed: int = field(default=0, init=False, repr=False)

    def __post_init__(self):
        for name in ("period", "acceleration", "turning"):
            number("PatternTracker", name, getattr(self, name), above=0.0)
        number("PatternTracker", "up", self.up)
        if not isinstance(self.pattern, Pattern) or self.pattern.kind != "quincunx":
            raise ModelError(
                "expected Pattern.quincunx(side); its edges are followed",
                place="PatternTracker",
                found=Given("pattern", self.pattern),
            )
        self.cameras = tuple(self.cameras)
        if not self.cameras or not all(isinstance(camera, PlacedCamera) for camera in self.cameras):
            raise ModelError(
                "expected those of a Reconstruction, or PlacedCamera.looking(r, at)",
                place="PatternTracker",
                found=Given("cameras", self.cameras),
            )

    def update(self, images: Sequence[Any]) -> Tracked | None:
        """The pattern in the images of all cameras at the next instant; None until it was seen once.

        images: (height, width) of 8 or 16 bits each. A pattern that is hidden coasts for 25 images, then it is sought anew.
        """
        if len(images) != len(self.cameras):
            raise ModelError(
                f"found {len(images)} images, expected one of each of {len(self.cameras)} cameras",
                place="PatternTracker.update",
                argument="images",
            )
        searched = self._state is None or self._missed > COASTED
        if searched:
            measured = self._anywhere(images)
            if measured is not None:
                self._begin(*measured)
        else:
            self._predict()
            measured = self._expected(images)
            if measured is not None:
                self._correct(*measured)
        if self._state is None:
            return None
        self._missed = 0 if measured is not None else self._missed + 1
        r, moved, P = self._state
        deviation = float(np.sqrt(np.trace(P[:3, :3])))
        return Tracked(
            r.copy(),
            self._axes.copy(),
            moved[:3].copy(),
            moved[3:].copy(),
            measured is not None,
            deviation,
            searched,
        )

    def _begin(self, r: Array, R: Array, covariance: Array) -> None:
        P = np.zeros((12, 12))
        P[:6, :6] = covariance
        P[6:, 6:] = UNKNOWN**2 * np.eye(6)
        self._state, self._axes = (r, np.zeros(6), P), R

    def _predict(self) -> None:
        assert self._state is not None
        r, moved, P = self._state
        h = self.period
        F = np.eye(12)
        F[:6, 6:] = h * np.eye(6)
        noise = np.diag([self.acceleration**2] * 3 + [self.turning**2] * 3)
        Q = np.block([[h**4 / 4 * noise, h**3 / 2 * noise], [h**3 / 2 * noise, h**2 * noise]])
        self._axes = turned(self._axes[None], h * moved[None, 3:])[0]
        self._state = (r + h * moved[:3], moved, F @ P @ F.T + Q)

    def _correct(self, r: Array, R: Array, covariance: Array) -> None:
        assert self._state is not None
        expected, moved, P = self._state
        off = np.concatenate([r - expected, rotation_vector((R @ self._axes.T)[None])[0]])
        gain = P[:, :6] @ np.linalg.inv(P[:6, :6] + covariance)
        step = gain @ off
        self._axes = turned(self._axes[None], step[None, 3:6])[0]
        self._state = (expected + step[:3], moved + step[6:], P - gain @ P[:6])

    def _expected(self, images: Sequence[Any]) -> tuple[Array, Array, Array] | None:
        """The pose by edges that are looked for where it is expected."""
        assert self._state is not None
        corners = np.full((len(self.cameras), len(self.pattern.points), 2), np.nan)
        for c, (camera, image) in enumerate(zip(self.cameras, images, strict=True)):
            places = camera.project(self._state[0] + self.pattern.points @ self._axes.T)
            if not np.all(np.isfinite(places)):
                continue
            around = MARGIN * np.ptp(places, axis=0).max()
            low = np.maximum(np.floor(places.min(axis=0) - around).astype(int), 0)
            high = np.ceil(places.max(axis=0) + around).astype(int) + 1
            part = np.asarray(image)[low[1] : high[1], low[0] : high[0]]
            if min(part.shape[:2]) < 16:
                continue
            grey = grey_of(part, f"camera {c + 1}")
            H = homography(self.pattern.points[:, :2], places - low)
            edges = measure_edges(grey, H, self.pattern, noise_of(grey), 0.0, settled=NEAR)
            if edges is not None:
                corners[c] = edges.corners + low
        if not np.isfinite(corners).any():
            return None
        return self._fitted(corners, self._state[0], self._axes)

    def _anywhere(self, images: Sequence[Any]) -> tuple[Array, Array, Array] | None:
        """The pose by detection in whole images."""
        corners = np.full((len(self.cameras), len(self.pattern.points), 2), np.nan)
        for c, image in enumerate(images):
            grey = grey_of(np.asarray(image), f"camera {c + 1}")
            found = find_quincunx(grey, self.pattern, None, True, self.up)
            if found.edges is not None:
                corners[c] = found.edges.corners
        seen = np.isfinite(corners).any(axis=(1, 2))
        if not seen.any():
            return None
        chosen = np.flatnonzero(seen).tolist()
        directions = np.stack([_directions(self.cameras[c], corners[c]) for c in chosen])
        if len(chosen) > 1:
            flat = tuple(self.cameras[c] for c in chosen)
            r, R = plates(triangulated(flat, directions[:, None]), self.pattern.points)
            r, R = r[0], R[0]
        else:
            camera = self.cameras[chosen[0]]
            r, R = plates_of_one(directions, self.pattern.points)
            r, R = camera.r + camera.R @ r[0], camera.R @ R[0]
        return self._fitted(corners, r, R)

    def _fitted(self, corners: Array, r: Array, R: Array) -> tuple[Array, Array, Array] | None:
        try:
            found = fitted_pose(self.cameras, corners, self.pattern.points, r, R, SIGMA)
        except np.linalg.LinAlgError:
            return None
        return found if all(np.all(np.isfinite(each)) for each in found) else None


def _directions(camera: PlacedCamera, corners: Array) -> Array:
    """Directions at depth 1 of corners (P, 2) in the axes of a camera."""
    fx, fy = camera.focal
    K = [[fx, 0, camera.centre[0]], [0, fy, camera.centre[1]], [0, 0, 1]]
    return Camera(K, camera.distortion, camera.size).directions(corners)
