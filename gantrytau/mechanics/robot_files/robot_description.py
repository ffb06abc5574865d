"""A robot as its file states it, whatever the format: links, joints, loops in m, kg, s, rad, and what was left out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

NOWHERE = (0.0, 0.0, 0.0)
MOVING = ("revolute", "continuous", "prismatic")  # joints with one coordinate
LOOP_KINDS = ("fixed", "revolute", "prismatic", "cylindrical", "universal", "spherical")


@dataclass(frozen=True)
class Placement:
    """Pose of a frame in another: xyz (3,) in m; rpy (3,) in rad about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll)."""

    xyz: tuple[float, ...] = NOWHERE
    rpy: tuple[float, ...] = NOWHERE

    @staticmethod
    def of(r: Iterable[float], R: np.ndarray) -> "Placement":
        """The pose of an origin r (3,) and an orientation R (3, 3), upright ones included."""
        roll = np.arctan2(R[2, 1], R[2, 2])
        roll -= np.pi * np.round(roll / np.pi)  # a turn about y alone stays one, beyond 90 degrees too
        rest = R @ _about_x(-roll)  # Rz(yaw) Ry(pitch): holds whatever the roll is where it is not determined
        pitch, yaw = np.arctan2(-rest[2, 0], rest[2, 2]), np.arctan2(-rest[0, 1], rest[1, 1])
        return Placement(tuple(map(float, r)), (float(roll), float(pitch), float(yaw)))

    @staticmethod
    def of_quaternion(r: Iterable[float], q: tuple[float, ...]) -> "Placement":
        """The pose of an origin r (3,) and a quaternion, scalar first, of any length."""
        return Placement.of(r, turned(np.array(q[1:]), 2 * np.arctan2(np.linalg.norm(q[1:]), q[0])))

    @property
    def R(self) -> np.ndarray:
        """Its orientation, (3, 3): columns are its axes."""
        (_, b, c), (_, y, z) = np.cos(self.rpy), np.sin(self.rpy)
        about_y = np.array([[b, 0, y], [0, 1, 0], [-y, 0, b]])
        about_z = np.array([[c, -z, 0], [z, c, 0], [0, 0, 1]])
        return about_z @ about_y @ _about_x(self.rpy[0])

    def __matmul__(self, inner: "Placement") -> "Placement":
        """The pose of a frame that stands in this one."""
        if not any(self.rpy):  # keeps angles as they are written
            return Placement(tuple(map(float, np.add(self.xyz, inner.xyz))), inner.rpy)
        return Placement.of(np.array(self.xyz) + self.R @ inner.xyz, self.R @ inner.R)

    @property
    def meant(self) -> "Placement":
        """The same with quarter turns in place of angles that are these but for their last digit, such as 3.1416."""
        return Placement(self.xyz, tuple(map(_meant, self.rpy)))

    @property
    def inverse(self) -> "Placement":
        """The pose of the outer frame in this one."""
        return Placement.of(-self.R.T @ self.xyz, self.R.T)


def turned(n: np.ndarray, angle: float) -> np.ndarray:
    """The rotation by an angle about an axis of any length; none about 0 0 0."""
    length = np.linalg.norm(n)
    cross = np.cross(np.eye(3), n / length if length > 0 else n)
    return np.eye(3) + np.sin(angle) * cross + 2 * np.sin(angle / 2) ** 2 * cross @ cross


def _meant(angle: float) -> float:
    """A quarter turn, or several, that an angle is written for, cut or rounded after three digits or more; else itself."""
    exact = np.pi / 2 * np.round(angle / (np.pi / 2))
    digits = len(repr(float(angle)).partition(".")[2])
    return float(exact) if exact and digits > 2 and abs(angle - exact) <= 10.0**-digits else angle


def _about_x(angle: float) -> np.ndarray:
    a, x = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, a, -x], [0, x, a]])


@dataclass(frozen=True)
class Visual:
    """Shape of a link. kind: box, with size (3,) m; cylinder or, without its caps, capsule, along z, with size (radius,
    length); sphere, (radius,); ellipsoid, with its semi-axes; mesh, with its file and size (3,), m for a unit of the file.
    """

    kind: str
    placement: Placement
    size: tuple[float, ...]
    file: str = ""


@dataclass(frozen=True)
class RobotLink:
    """A body, or a frame if it has no mass. m: kg; J: (3, 3) kg.m2 about the centre of mass, along the axes of `centre`."""

    name: str
    m: float = 0.0
    J: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    centre: Placement = Placement()
    visuals: tuple[Visual, ...] = ()


@dataclass(frozen=True)
class Coupling:
    """Coordinate of a joint as multiplier times that of another, and offset; with no other one it is held there."""

    other: str | None
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class RobotJoint:
    """Joint between a link and its parent.

    placement: of the joint in the parent link; seat: of the child link in the joint; axis: in the joint, of a universal
    joint the first one, axis_b its second; limits: of the coordinate, m or rad; effort, velocity: N or N.m, m/s or rad/s;
    damping, friction: viscous and Coulomb; armature: kg or kg.m2 of the drive; stiffness, rest: of a spring, N/m or
    N.m/rad, and the coordinate at which it is slack; start: of the coordinate; chosen: whether somebody asks for this start.
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Placement = Placement()
    seat: Placement = Placement()
    axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    axis_b: tuple[float, ...] = (0.0, 1.0, 0.0)
    limits: tuple[float, float] | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    mimic: Coupling | None = None
    start: float | None = None
    chosen: bool = False

    @property
    def moves(self) -> bool:
        """Whether it has one coordinate."""
        return self.kind in MOVING


@dataclass(frozen=True)
class LoopJoint:
    """A joint between two links of the tree: frame_a is at `origin_a` of link_a, frame_b at `origin_b` of link_b.

    axis: of the joint, in frame_a, of a universal joint the first one; axis_b: its second, in frame_b.
    """

    name: str
    kind: str
    link_a: str
    link_b: str
    origin_a: Placement = Placement()
    origin_b: Placement = Placement()
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    axis_b: tuple[float, ...] = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class RobotSensor:
    """Where a sensor of the file is found: `position`, `speed` or `force` of a joint, or a variable, `r`, of a link."""

    name: str
    kind: str
    part: str
    quantity: str


@dataclass(frozen=True)
class RobotDescription:
    """A robot. root: the link that stands in the world; driven: joints that the file drives, None if it does not say;
    closed: whether joints close loops; gravity: (3,) in m/s2; left_out: what the file has and the model has not.
    """

    file: str
    name: str
    root: str
    links: tuple[RobotLink, ...]
    joints: tuple[RobotJoint, ...]
    driven: tuple[str, ...] | None = None
    loops: tuple[LoopJoint, ...] = ()
    closed: bool = False
    gravity: tuple[float, ...] | None = None
    sensors: tuple[RobotSensor, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def moving(self) -> list[str]:
        """Names of the joints with one coordinate."""
        return [joint.name for joint in self.joints if joint.moves]

    def completed(
        self, loops: Iterable[LoopJoint], driven: tuple[str, ...] | None, start: Mapping[str, float]
    ) -> "RobotDescription":
        """The same with further loops, other driven joints and other starts."""
        joints = tuple(
            replace(one, start=start[one.name], chosen=True) if one.name in start else one
            for one in self.joints
        )
        driven = self.driven if driven is None else driven
        return replace(self, joints=joints, loops=(*self.loops, *loops), driven=driven)

    @property
    def meant(self) -> "RobotDescription":
        """The same with quarter turns in all joints where the file has these rounded."""
        joints = (replace(one, placement=one.placement.meant, seat=one.seat.meant) for one in self.joints)
        loops = (replace(one, origin_a=one.origin_a.meant, origin_b=one.origin_b.meant) for one in self.loops)
        return replace(self, joints=tuple(joints), loops=tuple(loops))
