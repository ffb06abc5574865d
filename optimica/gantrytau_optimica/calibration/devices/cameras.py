"""Cameras that measure the pose of a pattern on the tool: one, two or more pinholes with lens distortion.

A camera has what it is and what it is `believed` to be. Images come from the first, poses are computed with the second:
the difference is a warp of space that stays the same in each measurement and does not average out, while the noise of
the image points does. One camera finds a pose from the known pattern, depth from its size; two find depth from their
distance.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import skewed, turned
from gantrytau_optimica.calibration.devices.devices import (
    Array,
    Device,
    MeasuredPoses,
    checked_rotation,
)
from gantrytau_optimica.calibration.devices.sight import Bars, clear

ROUNDS = 20  # steps from the true pose; three or four are enough where the pattern is seen well
RIDGE = 1e-13  # of the squares of slopes: a pattern that is seen from its edge does not tell all of its pose
SETTLED = 1e-8  # m and rad; a thousandth of it is left
BLOCK = 1024  # poses at once: more take memory and no less time
LEAST_POINTS = 4  # three leave up to four poses
LENS_ERROR = 0.033  # of k1, for all that is wrong with a camera: fitted, see stereo_cameras
UP = (0.0, 0.0, 1.0)
STRAIGHT_AHEAD = 1e-3  # m, points nearer to the plane of the lens or behind it are not imaged


@dataclass(frozen=True, eq=False)
class PlacedCamera(Record):
    """A pinhole camera with lens distortion.

    r: centre of projection in the world, (3,) in m; R: its axes in the world, x to the right, y down, z ahead. focal:
    in pixels, a number or (x, y); centre: image of the axis, pixels, default the middle; size: (width, height) in
    pixels. distortion: k1, k2, p1, p2, k3 of Brown and Conrady: with x, y at depth 1 and s = x2 + y2 the image is at
    x (1 + k1 s + k2 s2 + k3 s3) + 2 p1 x y + p2 (s + 2 x2), and y likewise. Raises ModelError for other shapes.
    """

    r: Any
    R: Any
    _: KW_ONLY
    focal: Any = 1800.0
    size: tuple[int, int] = (1600, 1200)
    centre: Any = None
    distortion: Any = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self):
        if not np.all(array("PlacedCamera", "size", self.size, (2,)) > 0):
            raise ModelError(
                "expected (width, height) in pixels above 0",
                place="PlacedCamera",
                found=Given("size", self.size),
            )
        width, height = self.size
        middle = ((width - 1) / 2, (height - 1) / 2)
        focal = array("PlacedCamera", "focal", self.focal, (), (2,))
        if not np.all(focal > 0):
            raise ModelError(
                "expected pixels above 0", place="PlacedCamera", found=Given("focal", self.focal)
            )
        for name, value in (
            ("r", array("PlacedCamera", "r", self.r, (3,))),
            ("R", checked_rotation("PlacedCamera", self.R)),
            ("focal", np.broadcast_to(focal, 2)),
            ("centre", array("PlacedCamera", "centre", middle if self.centre is None else self.centre, (2,))),
            ("distortion", array("PlacedCamera", "distortion", self.distortion, (5,))),
        ):
            object.__setattr__(self, name, value)

    @property
    def border(self) -> float:
        """Square of x and y at depth 1, up to which the lens images one direction to one point; often infinite.

        Beyond the first zero of d(rho (1 + k1 s + k2 s2 + k3 s3)) / d rho with s = rho2 the polynomial, which describes a
        lens only inside, folds the world back into the image.
        """
        k1, k2, _, _, k3 = self.distortion
        roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
        folds = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
        return float(folds.min(initial=np.inf))

    @classmethod
    def looking(cls, r: Any, at: Any, *, up: Any = UP, **lens: Any) -> "PlacedCamera":
        """A camera at r that looks at a point, the upper edge of its image towards `up`; lens: as of PlacedCamera."""
        r, at, up = (array("PlacedCamera", n, a, (3,)) for n, a in (("r", r), ("at", at), ("up", up)))
        ahead = at - r
        right = np.cross(ahead, up)
        if np.linalg.norm(right) < 1e-9 * np.linalg.norm(ahead) * np.linalg.norm(up) or not np.any(ahead):
            raise ModelError(
                f"along the view {ahead.tolist()}, expected another direction; name the one that is up in the image",
                place="PlacedCamera",
                found=Given("up", up),
            )
        axes = [right, np.cross(ahead, right), ahead]
        return cls(r, np.column_stack([a / np.linalg.norm(a) for a in axes]), **lens)

    def project(self, points: Any) -> Array:
        """Image points (..., 2) in pixels of points (..., 3) in m in the world; NaN behind it and beyond `border`."""
        x, y, _ = self._flat(np.asarray(points, dtype=float))
        return self._distorted(x, y)

    def inside(self, pixels: Array) -> Array:
        """Whether image points (..., 2) lie on the sensor, (...,)."""
        return np.all((pixels >= -0.5) & (pixels <= np.array(self.size) - 0.5), axis=-1)

    def slopes(self, points: Array) -> tuple[Array, Array]:
        """Image points (..., 2) and their derivatives with respect to points in the world, (..., 2, 3) in 1/m."""
        x, y, depth = self._flat(points)
        k1, k2, p1, p2, k3 = self.distortion
        s = x * x + y * y
        radial, slope = 1 + s * (k1 + s * (k2 + s * k3)), k1 + s * (2 * k2 + s * 3 * k3)
        cross = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        lens = np.stack([
            radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, cross,
            cross, radial + 2 * y * y * slope + 2 * p2 * x + 6 * p1 * y,
        ], axis=-1).reshape(*x.shape, 2, 2)  # fmt: skip
        zero, one = np.zeros_like(x), np.ones_like(x)
        perspective = np.stack([one, zero, -x, zero, one, -y], axis=-1).reshape(*x.shape, 2, 3)
        local = self.focal[:, None] * (lens @ perspective) / depth[..., None, None]
        return self._distorted(x, y), local @ self.R.T

    def _flat(self, points: Array) -> tuple[Array, Array, Array]:
        """Coordinates x and y at depth 1, and depth in m, of points in the world; NaN where it has no image."""
        local = (points - self.r) @ self.R
        x, y, depth = np.moveaxis(local, -1, 0)
        ahead = (depth > STRAIGHT_AHEAD) & (x * x + y * y < self.border * depth * depth)
        depth = np.where(ahead, depth, np.nan)
        return x / depth, y / depth, depth

    def _distorted(self, x: Array, y: Array) -> Array:
        """Image points in pixels of x and y at depth 1."""
        k1, k2, p1, p2, k3 = self.distortion
        s = x * x + y * y
        radial = 1 + s * (k1 + s * (k2 + s * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)
        v = y * radial + 2 * p2 * x * y + p1 * (s + 2 * y * y)
        return self.focal * np.stack([u, v], axis=-1) + self.centre


def squares(edge: float = 0.03, spacing: float = 0.06) -> Array:
    """Corners of five squares in a cross, (20, 3) in m, in the xy plane: a pattern as that of thesis section 5.5."""
    middle = spacing * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    corner = edge / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    flat = (middle[:, None] + corner).reshape(-1, 2)
    return np.column_stack([flat, np.zeros(len(flat))])


@dataclass(frozen=True, eq=False)
class Cameras(Device):
    """One, two or more cameras that find the pose of a pattern on the tool.

    cameras: as they are; believed: as they are held to be, default the same. The axes of the device are those of the
    first one believed; `r` and `R` are not given. pattern: points in the frame of the tool relative to `target`, (m, 3)
    in m, at least four; facing: the direction to which it looks, default its z axis, None if it is seen from behind as
    well. noise: standard deviation of image points in pixels (0.1, assumed). acceptance: largest angle in rad between
    `facing` and a camera (60 deg, assumed); smallest: extent of the pattern in the image that it takes to detect it,
    pixels (assumed). All cameras must see the whole pattern; obstacles hide it when they hide its target. Readings:
    image points in pixels.
    """

    _: KW_ONLY
    cameras: Sequence[PlacedCamera]
    believed: Sequence[PlacedCamera] = ()
    pattern: Any = None
    facing: Any = (0.0, 0.0, 1.0)
    noise: float = 0.1
    acceptance: float = np.radians(60.0)
    smallest: float = 40.0

    def __post_init__(self):
        self._numbers("noise", "smallest", "acceptance", least=0.0)
        for which in ("cameras", "believed"):
            value = getattr(self, which)
            if not isinstance(value, Sequence) or not all(isinstance(c, PlacedCamera) for c in value):
                raise ModelError(
                    "expected a sequence of PlacedCamera", place="Cameras", found=Given(which, value)
                )
        believed = tuple(self.believed) or tuple(self.cameras)
        if not self.cameras or len(believed) != len(self.cameras):
            raise ModelError(
                f"Cameras: found {len(self.cameras)} cameras and {len(believed)} believed, expected one or more, as many of "
                "each and in the same order"
            )
        pattern = array("Cameras", "pattern", squares() if self.pattern is None else self.pattern, (None, 3))
        flat = len(pattern) and np.linalg.matrix_rank(pattern - pattern.mean(axis=0), tol=1e-6) < 2
        if len(pattern) < LEAST_POINTS or flat:
            raise ModelError(
                f"expected {LEAST_POINTS} points or more that span a plane",
                place="Cameras",
                found=Given("pattern", pattern),
            )
        for name, value in (
            ("believed", believed),
            ("pattern", pattern),
            ("r", believed[0].r),
            ("R", believed[0].R),
        ):
            object.__setattr__(self, name, value)
        super().__post_init__()

    def covariance(self, r: Any, R: Any = None) -> Array:
        """Covariance of position (m) and rotation vector (rad) in the world by the noise of image points, (N, 6, 6)."""
        r, R, _ = self._poses(r, R)
        found = np.empty((len(r), 6, 6))
        for first in range(0, len(r), BLOCK):
            part = slice(first, first + BLOCK)
            rows = self._images(r[part], R[part])[1]
            found[part] = np.linalg.inv(rows.transpose(0, 2, 1) @ rows)
        return self.noise**2 * found

    def _points(self, r: Array, R: Array) -> Array:
        return r[:, None] + (self.pattern + self.target) @ R.transpose(0, 2, 1)

    def _sees(self, r: Array, R: Array, bars: Bars | None) -> Array:
        points, target = self._points(r, R), r + R @ self.target
        seen = np.ones(len(r), dtype=bool)
        for camera in self.cameras:
            pixels = camera.project(points)
            seen &= np.all(camera.inside(pixels), axis=1)
            seen &= np.linalg.norm(np.ptp(pixels, axis=1), axis=1) >= self.smallest
            seen &= self._turned_away(camera.r, target, R) <= self.acceptance
            seen &= clear(camera.r, target, self.obstacles, bars)
        return seen

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        points = self._points(r, R)
        true = np.concatenate([camera.project(points) for camera in self.cameras], axis=1)
        readings = (true + self.noise * random.standard_normal(true.shape)).reshape(len(r), true.shape[1] * 2)
        names = tuple(
            f"camera {c + 1} point {k + 1} {axis} [pixel]"
            for c in range(len(self.cameras)) for k in range(len(self.pattern)) for axis in "xy"
        )  # fmt: skip
        r, R = self._solved(r, R, readings)
        return MeasuredPoses(
            (r - self.r) @ self.R, self.R.T @ R, readings, names, np.ones(len(r), dtype=bool)
        )

    def _solved(self, r: Array, R: Array, readings: Array) -> tuple[Array, Array]:
        """Poses whose images by the believed cameras fit best, from those given, by Gauss-Newton on all at once."""
        r, R = r.copy(), R.copy()
        imaged = np.flatnonzero(np.isfinite(readings).all(axis=1))
        for first in range(0, len(imaged), BLOCK):
            part = imaged[first : first + BLOCK]
            for _ in range(ROUNDS):
                images, rows = self._images(r[part], R[part])
                missed, rows = (readings[part] - images)[:, :, None], np.nan_to_num(rows)
                normal = rows.transpose(0, 2, 1) @ rows
                least = RIDGE * np.trace(normal, axis1=1, axis2=2) + np.finfo(float).tiny
                right = rows.transpose(0, 2, 1) @ missed
                step = np.linalg.solve(normal + least[:, None, None] * np.eye(6), right)[:, :, 0]
                r[part] += step[:, :3]
                R[part] = turned(R[part], step[:, 3:])
                part = part[np.any(np.abs(step) >= SETTLED, axis=1)]  # nor NaN, of what is not imaged
                if not part.size:
                    break
        return r, R

    def _images(self, r: Array, R: Array) -> tuple[Array, Array]:
        """Image points by the believed cameras, (N, 2 m c), and their derivatives by position and rotation vector."""
        points = self._points(r, R)
        lever = -skewed(points - r[:, None])  # a turn w moves a point by w x lever
        images, rows = [], []
        for camera in self.believed:
            pixels, slopes = camera.slopes(points)
            images.append(pixels.reshape(len(r), -1))
            rows.append(np.concatenate([slopes, slopes @ lever], axis=3).reshape(len(r), -1, 6))
        return np.concatenate(images, axis=1), np.concatenate(rows, axis=1)


def single_camera(r: Any, at: Any, *, up: Any = UP, lens_error: float = LENS_ERROR, **policy: Any) -> Cameras:
    """One camera at r that looks at a point, (3,) in m each, with a lens that is not quite known.

    up: the direction of the upper edge of its image; lens_error: what is left of k1 after the camera was calibrated (see
    `stereo_cameras`); policy: as of Cameras.
    """
    lens_error = number("single_camera", "lens_error", lens_error)
    return _with_lens_error([PlacedCamera.looking(r, at, up=up)], lens_error, policy)


def stereo_cameras(
    r: Any, at: Any, *, base: float = 0.8, up: Any = UP, lens_error: float = LENS_ERROR, **policy: Any
) -> Cameras:
    """Two cameras, `base` m apart about r, that look at a point, with lenses that are not quite known.

    up: the direction of the upper edge of the images, across `base`; lens_error: what is left of k1 of each after
    calibration, with opposite signs: the default gives an error of about 1.7 mm in the mean over a workspace of 1 m at
    2.5 m, which thesis section 5.5 found of its two cameras against a laser tracker (fitted: lenses are not printed).
    policy: as of Cameras.
    """
    base = number("stereo_cameras", "base", base, least=0.0)
    lens_error = number("stereo_cameras", "lens_error", lens_error)
    middle = PlacedCamera.looking(r, at, up=up)
    aside = base / 2 * middle.R[:, 0]
    return _with_lens_error(
        [PlacedCamera.looking(middle.r + s * aside, at, up=up) for s in (-1, 1)], lens_error, policy
    )


def _with_lens_error(believed: list[PlacedCamera], lens_error: float, policy: dict[str, Any]) -> Cameras:
    cameras = [
        replace(camera, distortion=sign * lens_error * np.eye(5)[0])
        for camera, sign in zip(believed, (1.0, -1.0), strict=False)
    ]
    return Cameras(cameras=cameras, believed=believed, **policy)
