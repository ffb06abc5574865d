"""What limits the poses of a robot: reach, strokes, ball joints, obstacles; and by how much poses keep these limits."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, instance, number
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import poses
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.rods.rod_robots import SixRods
from gantrytau.kinematics.rotations import angle_between
from gantrytau.kinematics.workspace.obstacles import Capsule, between_segments, segment_distance
from gantrytau.language.model import Model

REASONS = ("inside", "out of reach", "stroke", "ball joint", "collision", "passive joint", "near singular")
_MISS = 1e-6  # m by which links of a pose may miss their lengths
_BLOCK = 1024  # poses, whose links and their distances stay in the cache


@dataclass(frozen=True, eq=False, kw_only=True)
class Limits(Record):
    """Limits of the poses of a robot: strokes, joint angles, obstacles, link collisions. Lengths in m, angles in rad.

    A quantity without a value here is not limited.

    strokes: (n, 2), least and largest actuator coordinates; (2,) for all carts alike; (3, 2) for the carts of a robot
    with turntables; None takes the bounds of the model, as `carts=[dict(s=Bounds(0, 2)), ...]`.
    ball_joint: largest angle of a link from the axis of its joints. cart_axes, plate_axes: these axes, (3,) or one per
    link, in the frame of the cart or turntable and of the plate; None is the direction of each link at the start of
    the model, or at `home`, the tool (3,) there.
    obstacles: Box, Cylinder, Capsule or any convex Obstacle, one or several. link_radius: of the links as capsules;
    plate: capsules in plate axes that stand for plate and tool. With a radius links of different arms may not touch
    each other either, where they end in different joints of the plate.
    stroke_margin (m), turn_margin, angle_margin (rad), clearance (m): safety distance from each limit.
    For a robot without `rods()` strokes are (n, 2) in the order of its joints, ball joints are limited through `passive`,
    and the bars of its shapes stand for its links. passive: (least, largest) of other variables
    by name, such as {"elbows[0].phi": (0.2, 2.5)}. condition: largest ratio of the speeds of the tool in its quickest and
    its slowest direction for rates of the joints of one size; rotations count by `lever` m.
    """

    strokes: Any = None
    ball_joint: float = math.inf
    cart_axes: Any = None
    plate_axes: Any = None
    home: Any = None
    obstacles: Any = ()
    link_radius: float = 0.0
    plate: Any = ()
    stroke_margin: float = 0.0
    turn_margin: float = 0.0
    angle_margin: float = 0.0
    clearance: float = 0.0
    passive: Any = None
    condition: float = math.inf
    lever: float = 1.0

    def __post_init__(self):
        self._in_si(("link_radius", "stroke_margin", "clearance"), unit="m", least=0.0)
        self._in_si(("turn_margin", "angle_margin"), unit="rad", least=0.0)
        self._in_si(("lever",), unit="m", above=0.0)
        self._in_si(("ball_joint",), unit="rad", above=0.0, most=math.inf)
        if self.ball_joint != math.inf:
            self._in_si(("ball_joint",), unit="rad", above=0.0, most=math.pi)
        self._in_si(("condition",), above=1.0, most=math.inf)
        for name in ("obstacles", "plate"):
            bodies = getattr(self, name)
            bodies = tuple(bodies) if isinstance(bodies, (list, tuple)) else (bodies,)
            object.__setattr__(self, name, bodies)
        for body in self.obstacles:
            if isinstance(body, type) or not hasattr(body, "distance"):
                raise ModelError(f"Limits.obstacles: found {body!r}, expected Box, Cylinder or Capsule")
        for body in self.plate:
            instance("Limits", "plate", body, Capsule, "Capsule in plate axes")

    def _in_si(self, names: Iterable[str], **limits: Any) -> None:
        """Numbers in SI."""
        for name in names:
            object.__setattr__(self, name, number("Limits", name, getattr(self, name), **limits))


@dataclass(frozen=True, eq=False)
class Examined(Record):
    """N poses and what each leaves of the limits, less the margins for safety; negative where a limit is broken.

    r (N, 3) in m, R (N, 3, 3), q (N, n). reason: (N,), the first limit that is broken as a number of REASONS, 0 for
    none. stroke: of the cart that has least left, m; turn: of the turntable, rad; angle: of the ball joint, rad;
    clearance: of links and plate from obstacles and of links from each other, m. What is not limited is infinite;
    out of reach all are NaN, and clearance is NaN where another limit is broken, as it is not asked for there. condition:
    ratio of speeds, 1 where it is not limited.
    """

    r: np.ndarray
    R: np.ndarray
    q: np.ndarray
    reason: np.ndarray
    stroke: np.ndarray
    turn: np.ndarray
    angle: np.ndarray
    clearance: np.ndarray
    condition: np.ndarray

    @property
    def inside(self) -> np.ndarray:
        """Whether a pose keeps all limits, (N,)."""
        return self.reason == 0


class Examiner:
    """A robot made ready for many poses, with limits."""

    def __init__(self, robot: Model | Kinematics, limits: Limits):
        self.kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
        self.name = self.kinematics.dae.name
        self.limits = limits
        self.linked = self.kinematics.linked("workspace")
        if limits.passive is not None or math.isfinite(limits.condition):
            raise ModelError(
                f"{self.name}: found passive={limits.passive!r} and condition={limits.condition!r} for a robot whose links "
                "are known by rods(), expected neither; limit its ball joints by ball_joint= and cart_axes="
            )
        self.geometry: RodGeometry = self.linked.geometry
        self.carts = len(self.geometry.offset)
        self.strokes = strokes_of(self.kinematics, self.carts, limits.strokes)
        self.around, self.reach = self.geometry.reach()
        self._touching = touching_links(self.geometry) if limits.link_radius else []
        self._axes = self._joint_axes() if math.isfinite(limits.ball_joint) else None

    @property
    def rails(self) -> np.ndarray:
        """A point and the direction of each guideway, (arms, 2, 3)."""
        return np.stack([self.geometry.offset, self.geometry.direction], axis=1)

    def __call__(self, r: ArrayLike, R: ArrayLike | None = None) -> Examined:
        """See `examine`."""
        at = poses(r, R, self.name)

        def block(part: slice) -> dict[str, np.ndarray]:
            place, turn = at.r[part], None if at.R is None else at.R[part]
            q, turn = self._joints_and_orientation(place, turn)
            return self._of_block(q, place, turn)

        return in_blocks(at.r, block)

    def judge(self, q: ArrayLike, r: ArrayLike, R: ArrayLike) -> Examined:
        """The same for poses whose actuators are known, q (N, n), r (N, 3), R (N, 3, 3), such as `fk` gives them.

        Out of reach are NaN, poses in which links miss their lengths, and an arm on the other side of its cart than at
        the start of the model. Raises ModelError for other shapes.
        """
        at = poses(r, R, self.name)
        joints = array(self.name, "q", q, (len(at.r), len(self.kinematics.joints)), finite=False)
        turns = instance(self.name, "R", at.R, np.ndarray, "orientations; take them from Kinematics.fk")

        def block(part: slice) -> dict[str, np.ndarray]:
            known, place, turn = joints[part], at.r[part], turns[part]
            good = self._assembled(known, place, turn)
            return self._of_block(np.where(good[:, None], known, np.nan), place, turn)

        return in_blocks(at.r, block)

    def _assembled(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Whether links are as long as they are, each arm on its side, (N,)."""
        with np.errstate(invalid="ignore"):
            length, u, _, _ = self.geometry.slopes(q, r, R, joints=False)
            good: np.ndarray = np.all(np.abs(length - self.geometry.length) < _MISS, axis=1)
            along = np.sum(u * self.geometry.direction[self.geometry.arm], axis=2)
            for arm, side in enumerate(self.linked.sides):
                good = good & (along[:, self.geometry.links_of(arm)].mean(axis=1) * side > 0)
        return good

    def _of_block(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> dict[str, np.ndarray]:
        reached = np.isfinite(q).all(axis=1)
        reason = np.where(reached, 0, REASONS.index("out of reach"))
        stroke, turn = self._strokes_left(q)
        angle = self._angle_left(q, r, R)
        broken = (stroke < 0) | (turn < 0)
        reason[reached & broken] = REASONS.index("stroke")
        reason[reached & ~broken & (angle < 0)] = REASONS.index("ball joint")
        clearance = np.full(len(r), np.nan)
        free = reason == 0
        clearance[free] = self._clearance(q[free], r[free], R[free])
        reason[free & (clearance < 0)] = REASONS.index("collision")
        condition = np.where(reached, 1.0, np.nan)
        return dict(
            R=R,
            q=q,
            reason=reason,
            stroke=stroke,
            turn=turn,
            angle=angle,
            clearance=clearance,
            condition=condition,
        )

    def _joints_and_orientation(self, r: np.ndarray, R: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Actuators (N, n), NaN rows out of reach, and the orientation (N, 3, 3) that is given or follows."""
        turned = self.kinematics.turning
        if R is None and isinstance(self.linked, SixRods) and not turned:
            q, R, _ = self.linked.follow(r, self.linked.sides)
            return q, R
        R_home = self.linked.repeated(len(r))
        if R is None:
            R = R_home if turned else None
        return self.kinematics.ik(r, R), R_home if R is None else R

    def _strokes_left(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of carts in m and of turntables in rad, (N,) each."""
        left = np.minimum(q - self.strokes[:, 0], self.strokes[:, 1] - q)
        unlimited = np.where(np.isnan(q[:, :1]), np.nan, np.inf)
        turn = np.hstack([unlimited, left[:, self.carts :]]).min(axis=1)
        return left[:, : self.carts].min(axis=1) - self.limits.stroke_margin, turn - self.limits.turn_margin

    def _angle_left(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Of the ball joint that is nearest to its limit, on cart or plate, (N,) in rad."""
        if self._axes is None:
            return np.where(np.isnan(q[:, 0]), np.nan, np.inf)
        angles = [
            angle_between(u, axes)
            for u, axes in zip(self.geometry.link_directions(q, r, R), self._axes, strict=True)
        ]
        return self.limits.ball_joint - np.max(angles, axis=(0, 2)) - self.limits.angle_margin

    def _joint_axes(self) -> list[np.ndarray]:
        """Axes of the ball joints on carts and on the plate, (m, 3) each: as given, or along the links at home."""
        home = self.linked.home
        r = home.r if self.limits.home is None else self.limits.home
        at = poses(r, None, f"{self.name}: Limits.home").r[:1]
        q, R = self._joints_and_orientation(at, None)
        usual = [directions[0] for directions in self.geometry.link_directions(q, at, R)]
        found = []
        for name, along in zip(("cart_axes", "plate_axes"), usual, strict=True):
            given = getattr(self.limits, name)
            axes = along if given is None else array("Limits", name, given, (3,), along.shape)
            if not (np.linalg.norm(axes, axis=-1) > 0).all():
                raise ModelError(
                    f"found {name} = {axes.tolist()}, expected directions, none of them zero; where they follow from "
                    "Limits(home=...), take a place in reach",
                    place=self.name,
                    argument=name,
                )
            found.append(np.broadcast_to(axes, along.shape))
        return found

    def _clearance(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Of links and plate from obstacles, and of links from each other, (N,) in m."""
        least = np.full(len(r), np.inf)
        if not len(r):
            return least
        start, end = self.geometry.cart_joints(q), self.geometry.plate_joints(r, R)
        for obstacle in self.limits.obstacles:
            links = segment_distance(obstacle, start, end) - self.limits.link_radius
            least = np.minimum(least, links.min(axis=1))
            for body in self.limits.plate:
                plate = segment_distance(obstacle, r + R @ body.start, r + R @ body.end) - body.radius
                least = np.minimum(least, plate)
        for i, j in self._touching:
            apart = between_segments(start[:, i], end[:, i], start[:, j], end[:, j])
            least = np.minimum(least, apart - 2 * self.limits.link_radius)
        return least - self.limits.clearance


def in_blocks(r: np.ndarray, block: Callable[[slice], dict[str, np.ndarray]], size: int = _BLOCK) -> Examined:
    """What `block` finds of so many poses at a time, put together."""
    parts = [slice(k, k + size) for k in range(0, len(r), size)] or [slice(0)]
    blocks = [block(part) for part in parts]
    return Examined(r=r, **{name: np.concatenate([each[name] for each in blocks]) for name in blocks[0]})


def touching_links(geometry: RodGeometry) -> list[tuple[int, int]]:
    """Links of different arms that end in different joints of the plate: those that could touch."""
    arm, joint, count = geometry.arm, geometry.on_plate, len(geometry.length)
    return [
        (i, j)
        for i in range(count)
        for j in range(i)
        if arm[i] != arm[j] and not np.allclose(joint[i], joint[j])
    ]


def strokes_of(kinematics: Kinematics, carts: int, strokes: Any) -> np.ndarray:
    """Least and largest coordinate of each actuator, (n, 2)."""
    if strokes is None:
        return kinematics.limits
    actuators = len(kinematics.joints)
    found = array("Limits", "strokes", strokes, (2,), (carts, 2), (actuators, 2), finite=False)
    if found.shape == (2,):
        found = np.tile(found, (carts, 1))
    if found.shape == (carts, 2):
        found = np.vstack([found, kinematics.limits[carts:]])
    if not (found[:, 0] < found[:, 1]).all():
        raise ModelError(
            f"expected (least, largest) coordinates of {kinematics.dae.name} in m and rad",
            place="Limits",
            found=Given("strokes", strokes),
        )
    return found
