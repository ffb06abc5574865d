"""What cameras look at: a robot that carries a pattern, what stands about it, and the light on it."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import array, instance, number, one_of, whole
from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.poses import poses
from gantrytau.kinematics.rods.rod_robots import ThreeRods
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.calibration.devices.devices import checked_rotation
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.vision.boards import Pattern

Array = np.ndarray
# the pattern looks along x of the plate
AHEAD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
LINK = 0.02  # m, radius of a link
GREATEST = {8: 255, 16: 65535}


@dataclass(frozen=True)
class Light:
    """The light on a scene and what a camera makes of it. Grey values are those of 8 bits, whatever `bits` says.

    gain: of all light, 1 in good light; tilt: standard deviation of a gradient over the image that differs from image
    to image, as a part of the light; lamp: a gradient that stays, half of it on each side; vignetting: what is lost in
    the corners; blur: standard deviation in pixels; noise: standard deviation in grey values; bits: 8 or 16 of an image.
    Raises ModelError for what is negative.
    """

    gain: float = 1.0
    _: KW_ONLY
    tilt: float = 0.1
    lamp: float = 0.3
    vignetting: float = 0.3
    blur: float = 0.8
    noise: float = 2.5
    bits: Literal[8, 16] = 8

    def __post_init__(self):
        for name in ("gain", "tilt", "lamp", "vignetting", "blur", "noise"):
            number("Light", name, getattr(self, name), least=0.0)
        one_of("Light", "bits", self.bits, GREATEST)


@dataclass(frozen=True, eq=False)
class Scene(Record):
    """A robot with a pattern on its tool, in front of a cluttered wall.

    pattern: what it carries; robot: a model that says of its links, or None for a pattern alone; place: middle of the
    pattern in the frame of the plate, (3,) in m; R: axes of the pattern in the frame of the plate (3, 3), by default x
    along y, y along z, looking along x. bars: what else stands before the wall, `Bars`. clutter, decoys: how many shapes
    and single black squares are on the wall, 1.5 m behind; seed: of these.
    """

    pattern: Pattern
    robot: Model | None = None
    _: KW_ONLY
    place: Any = (0.15, 0.0, 0.0)
    R: Any = field(default_factory=lambda: AHEAD.copy())
    bars: Sequence[Bars] = ()
    clutter: int = 160
    decoys: int = 12
    seed: int = 0

    def __post_init__(self):
        for name in ("clutter", "decoys", "seed"):
            whole("Scene", name, getattr(self, name), least=0)
        instance("Scene", "pattern", self.pattern, Pattern, "a Pattern, as Pattern.quincunx(0.06)")
        object.__setattr__(self, "place", array("Scene", "place", self.place, (3,), unit="m"))
        object.__setattr__(self, "R", checked_rotation("Scene", self.R))

    @cached_property
    def kinematics(self) -> Kinematics | None:
        """Kinematics of the robot."""
        return None if self.robot is None else Kinematics(self.robot)

    def poses(self, r: Any, R: Any = None) -> tuple[Array, Array]:
        """Poses of the plate, (N, 3) in m and (N, 3, 3), not turned where R is None; ModelError for what is out of reach."""
        found = poses(r, np.eye(3) if R is None else R, "render")
        assert found.R is not None
        if not np.all(np.isfinite(found.r)):
            raise ModelError("render: found poses that are not finite, expected numbers in m")
        return found.r, found.R

    def points(self, r: Array, R: Array) -> Array:
        """Corners of the pattern at poses of the plate, (N, P, 3) in m."""
        axes = R @ self.R
        return (r + R @ self.place)[:, None] + self.pattern.points @ axes.transpose(0, 2, 1)

    def links(self, r: Array, R: Array) -> Bars | None:
        """The links of the robot at poses of the plate; ModelError for poses out of reach."""
        kinematics = self.kinematics
        if kinematics is None:
            return None
        linked = kinematics.linked("render")
        q = kinematics.ik(r, None if isinstance(linked, ThreeRods) else R)
        lost = np.flatnonzero(~np.isfinite(q).all(axis=1))
        if lost.size:
            raise ModelError(
                f"render: the robot does not reach {lost.size} of {len(r)} poses, the first is row {lost[0]}, "
                f"r = {r[lost[0]].tolist()}; expected poses in its workspace"
            )
        geometry = linked.geometry
        return Bars(geometry.cart_joints(q), geometry.plate_joints(r, R), LINK)


def true_corners(scene: Scene, cameras: Sequence[PlacedCamera], r: Any, R: Any = None) -> Array:
    """Where the corners of the pattern are in the images, (C, N, P, 2) in pixels; NaN behind a camera."""
    points = scene.points(*scene.poses(r, R))
    return np.stack([camera.project(points) for camera in cameras])
