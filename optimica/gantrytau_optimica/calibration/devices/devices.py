"""Devices that measure a robot, as models: what they see from where, and with which errors.

A device stands at `r` with axes `R` in the world and looks at a target on the tool. `sees(r, R)` says for which poses
it can, `measure(r, R, seed)` what it then reads. Errors have two parts: noise, which differs in each reading, and what
is systematic (a scale, a lens), which does not average out however often one measures. Lengths in m, angles in rad.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, number, one_of
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.poses import poses
from gantrytau.kinematics.rotations import skewed, turned
from gantrytau.kinematics.workspace.obstacles import Obstacle
from gantrytau_optimica.calibration.devices.sight import Bars, clear

Array = np.ndarray
ORTHONORMAL = 1e-6  # what rounding to six decimals leaves of a rotation matrix


@dataclass(frozen=True, eq=False)
class MeasuredPoses(Record):
    """Readings of a device at N poses; unseen rows are NaN.

    r: positions (N, 3) in m, or None if the device finds none; R: orientations (N, 3, 3), or None; readings: (N, k) as
    the device delivers them, their names and units in `names`; seen: (N,) whether the device saw the target.
    """

    r: Any
    R: Any
    readings: Array
    names: tuple[str, ...]
    seen: Array

    def __repr__(self) -> str:
        return f"<MeasuredPoses: {np.count_nonzero(self.seen)} of {len(self.seen)} poses seen>"


@dataclass(frozen=True, eq=False)
class Device(Record):
    """Base of all devices: where it stands, what it looks at, what stands in between.

    r: place in the world, (3,) in m; R: its axes in the world, (3, 3). target: what is measured, in the frame of the
    tool, (3,) in m; facing: the direction into which the target looks, in the frame of the tool, (3,), or None if it can
    be seen from everywhere. obstacles: Box, Cylinder and others of `gantrytau.kinematics`, convex, in the world.
    """

    r: Any = (0.0, 0.0, 0.0)
    R: Any = field(default_factory=lambda: np.eye(3))
    _: KW_ONLY
    target: Any = (0.0, 0.0, 0.0)
    facing: Any = None
    obstacles: Sequence[Obstacle] = ()

    def __post_init__(self):
        kind = type(self).__name__
        self._vector("r")
        self._vector("target")
        object.__setattr__(self, "R", checked_rotation(kind, self.R))
        if not isinstance(self.obstacles, Sequence) or not all(
            hasattr(o, "distance") for o in self.obstacles
        ):
            raise ModelError(
                "expected a sequence of Box, Cylinder and others of gantrytau.kinematics; put a single one in a list",
                place=kind,
                found=Given("obstacles", self.obstacles),
            )
        if self.facing is not None:
            self._direction("facing")

    def sees(self, r: Any, R: Any = None, *, bars: Bars | None = None) -> Array:
        """Which of the poses r (N, 3), R (N, 3, 3) the device sees, (N,); bars: links that may hide the target."""
        r, R, single = self._poses(r, R)
        seen = self._sees(r, R, bars)
        return seen[0] if single else seen

    def measure(
        self,
        r: Any,
        R: Any = None,
        seed: int | np.random.Generator = 0,
        *,
        frame: Literal["world", "device"] = "world",
        bars: Bars | None = None,
    ) -> MeasuredPoses:
        """Readings of a tool at r (N, 3) in m with orientations R (N, 3, 3), default no rotation.

        seed: of the noise; the same seed gives the same noise. frame: in which positions and orientations are given,
        the world or the axes of the device, which is what devices deliver. bars: links that may hide the target.
        Raises ModelError for poses of other shapes.
        """
        one_of(type(self).__name__, "frame", frame, ("world", "device"))
        r, R, _ = self._poses(r, R)
        found = self._read(r, R, np.random.default_rng(seed))
        seen = self._sees(r, R, bars)
        position, rotation = found.r, found.R
        if frame == "world":
            position = None if position is None else position @ self.R.T + self.r
            rotation = None if rotation is None else self.R @ rotation
        lost = [None if a is None else np.where(_like(seen, a), a, np.nan) for a in (position, rotation)]
        return MeasuredPoses(
            lost[0], lost[1], np.where(seen[:, None], found.readings, np.nan), found.names, seen
        )

    def _sees(self, r: Array, R: Array, bars: Bars | None) -> Array:
        points = r + R @ self.target
        return self._within(points, R) & clear(self.r, points, self.obstacles, bars)

    def _within(self, points: Array, R: Array) -> Array:
        """Whether the target at points (N, 3) lies in the ranges of the device, (N,)."""
        raise NotImplementedError

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        """Readings with errors, in the axes of the device, seen or not."""
        raise NotImplementedError

    def _turned_away(self, eye: Array, points: Array, R: Array) -> Array:
        """Angle in rad between the direction into which the target looks and that to an eye (3,), (N,)."""
        if self.facing is None:
            return np.zeros(len(points))
        back = eye - points
        cosine = np.einsum("nk,nk->n", R @ self.facing, back) / np.linalg.norm(back, axis=1)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def _numbers(self, *names: str, **limits: Any) -> None:
        """Arguments as numbers; ModelError for those that are none within limits."""
        for name in names:
            object.__setattr__(self, name, number(type(self).__name__, name, getattr(self, name), **limits))

    def _vector(self, name: str) -> Array:
        found = array(type(self).__name__, name, getattr(self, name), (3,))
        object.__setattr__(self, name, found)
        return found

    def _direction(self, name: str) -> None:
        """Make a vector one of length 1; ModelError for one without a direction."""
        size = float(np.linalg.norm(found := self._vector(name)))
        if not size > 0:
            raise ModelError("expected a direction", place=type(self).__name__, found=Given(name, found))
        object.__setattr__(self, name, found / size)

    def _range(self, name: str) -> None:
        """ModelError unless an argument is (least, largest)."""
        found = array(type(self).__name__, name, getattr(self, name), (2,), finite=False)
        if not found[0] < found[1]:
            raise ModelError("expected (least, largest)", place=type(self).__name__, found=Given(name, found))

    def _poses(self, r: Any, R: Any) -> tuple[Array, Array, bool]:
        found = poses(r, np.eye(3) if R is None else R, type(self).__name__)
        assert found.R is not None  # one orientation was given at least
        return found.r, found.R, found.one


@dataclass(frozen=True, eq=False)
class LaserTracker(Device):
    """A laser tracker: range and two angles to a reflector, in its own axes (z up).

    Readings: range (m), azimuth and elevation (rad). `r` is the reflector, not the tool, unless `target` is zero.
    Standard deviations: range_noise + range_noise_per_metre * d along the beam, transverse_noise +
    transverse_noise_per_metre * d across it, in each of two directions, at the distance d. Defaults are half of the
    maximum permissible errors 10 um + 0.3 um/m and 15 um + 6 um/m that the manual of the Leica AT500 prints (section
    2.8.2, which says that typical results are half of them). scale: relative error of all ranges, systematic; air 1 K
    warmer than assumed gives 1e-6. nearest, farthest: m; elevation: limits in rad; acceptance: the largest angle in rad
    between `facing` and the beam, 30 deg as corner-cube reflectors have (assumed).
    """

    _: KW_ONLY
    range_noise: float = 5e-6
    range_noise_per_metre: float = 0.15e-6
    transverse_noise: float = 7.5e-6
    transverse_noise_per_metre: float = 3e-6
    scale: float = 0.0
    nearest: float = 0.5
    farthest: float = 30.0
    elevation: tuple[float, float] = (-np.pi / 4, np.pi / 4)
    acceptance: float = np.radians(30.0)

    def __post_init__(self):
        self._numbers("range_noise", "range_noise_per_metre", "transverse_noise", least=0.0)
        self._numbers("transverse_noise_per_metre", "nearest", "acceptance", least=0.0)
        self._numbers("scale")
        self._numbers("farthest", above=self.nearest, most=np.inf)
        self._range("elevation")
        super().__post_init__()

    def covariance(self, r: Any, R: Any = None) -> Array:
        """Covariance of the measured position in the world at poses r (N, 3), R (N, 3, 3), (N, 3, 3) in m2."""
        r, R, _ = self._poses(r, R)
        beam = r + R @ self.target - self.r
        distance = np.linalg.norm(beam, axis=1)
        unit = beam / distance[:, None]
        along, across = (s[:, None, None] ** 2 for s in self._deviations(distance))
        return across * np.eye(3) + (along - across) * unit[:, :, None] * unit[:, None, :]

    def _deviations(self, distance: Array) -> tuple[Array, Array]:
        return (
            self.range_noise + self.range_noise_per_metre * distance,
            self.transverse_noise + self.transverse_noise_per_metre * distance,
        )

    def _within(self, points: Array, R: Array) -> Array:
        distance, _, elevation = _polar((points - self.r) @ self.R)
        return (
            (self.nearest <= distance)
            & (distance <= self.farthest)
            & (self.elevation[0] <= elevation)
            & (elevation <= self.elevation[1])
            & (self._turned_away(self.r, points, R) <= self.acceptance)
        )

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        distance, azimuth, elevation = _polar((r + R @ self.target - self.r) @ self.R)
        along, across = self._deviations(distance)
        noise = random.standard_normal((len(r), 3))
        safe = np.maximum(distance, 1e-12)
        readings = np.column_stack([
            distance * (1.0 + self.scale) + along * noise[:, 0],
            # an angle of azimuth moves the beam by the cosine of the elevation only
            azimuth + across / (safe * np.maximum(np.cos(elevation), 1e-9)) * noise[:, 1],
            elevation + across / safe * noise[:, 2],
        ])  # fmt: skip
        names = ("range [m]", "azimuth [rad]", "elevation [rad]")
        return MeasuredPoses(_cartesian(readings), None, readings, names, np.ones(len(r), dtype=bool))


@dataclass(frozen=True, eq=False)
class TMac(LaserTracker):
    """A laser tracker with a target whose orientation it sees too (Leica T-Mac): poses of the tool.

    `target` is the reflector in the frame of the tool; `r` and `R` are the tool's, computed from reflector and measured
    orientation, so that errors of orientation act on the lever arm. rotation_noise: standard deviation in rad about
    each axis, 0.005 deg: half of 0.01 deg (assumed); acceptance: 45 deg (assumed), nearest 1.5 m (assumed).
    """

    _: KW_ONLY
    rotation_noise: float = np.radians(0.005)
    acceptance: float = np.radians(45.0)
    nearest: float = 1.5

    def __post_init__(self):
        self._numbers("rotation_noise", least=0.0)
        super().__post_init__()

    def covariance(self, r: Any, R: Any = None) -> Array:
        """Covariance of position (m) and rotation vector (rad) in the world, (N, 6, 6)."""
        reflector = super().covariance(r, R)
        _, R, _ = self._poses(r, R)
        lever = skewed(R @ self.target)  # r = reflector - turn(w) R target, so dr = [R target]x w
        whole = np.zeros((len(reflector), 6, 6))
        square = self.rotation_noise**2
        whole[:, :3, :3] = reflector + square * lever @ lever.transpose(0, 2, 1)
        whole[:, :3, 3:] = square * lever
        whole[:, 3:, :3] = whole[:, :3, 3:].transpose(0, 2, 1)
        whole[:, 3:, 3:] = square * np.eye(3)
        return whole

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        found = super()._read(r, R, random)
        rotation = turned(self.R.T @ R, self.rotation_noise * random.standard_normal((len(r), 3)))
        position = found.r - rotation @ self.target
        return MeasuredPoses(position, rotation, found.readings, found.names, found.seen)


def numbers(value: Any) -> Array:
    """The value as an array of floats; NaN where it is no number at all, which no check lets pass."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return np.full((), np.nan)


def _polar(points: Array) -> tuple[Array, Array, Array]:
    """Range in m, azimuth from x and elevation from the xy plane in rad, (N,) each."""
    flat = np.hypot(points[:, 0], points[:, 1])
    return (
        np.hypot(flat, points[:, 2]),
        np.arctan2(points[:, 1], points[:, 0]),
        np.arctan2(points[:, 2], flat),
    )


def _cartesian(readings: Array) -> Array:
    distance, azimuth, elevation = readings.T
    flat = np.cos(elevation)
    return distance[:, None] * np.column_stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
    )


def _like(seen: Array, values: Array) -> Array:
    return seen.reshape(-1, *[1] * (values.ndim - 1))


def checked_rotation(what: str, R: Any) -> Array:
    """An orientation, (3, 3); ModelError if it is none."""
    found = array(what, "R", R, (3, 3))
    if not np.allclose(found @ found.T, np.eye(3), atol=ORTHONORMAL) or np.linalg.det(found) < 0:
        raise ModelError(
            "expected a rotation matrix, its columns the axes of the device in the world",
            place=what,
            found=Given("R", found.round(6)),
        )
    return found
