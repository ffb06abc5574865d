"""The F1: a six-link Gantry-Tau whose joints on two of the carts turn, so that the plate moves in six ways.

Dressler (2012), section 4.5. The guideways are vertical. A turntable on cart 2 carries the links 2a and 2b; one on
cart 3 carries another one, which carries the links 3a, 3b and 3c.
"""

import math

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Parameter, Real, StateSelect, branch, connect
from gantrytau.border.refusal import ModelError
from gantrytau.language.self_description.rods import Rods
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, TwoFrames, World
from gantrytau.mechanics.multibody.orientation import of_quaternion
from gantrytau.mechanics.rotational import Torque
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.mechanisms.clusters import Arm, ThreeLinks, TwoLinks, arm_of_rods
from gantrytau_models.mechanisms.gantry_tau import Cart, check_record, driven_carts, forces_on_carts
from gantrytau_models.mechanisms.six_link import Plate, quaternion
from gantrytau_models.prototypes import RotatingArm, RotatingPrototype

STRUCTURE = ((0, 1), (1, 2), (2, 3))  # turntables and links of each arm
# m, carts at the start, turntables at 0: with the tool below them the plate then turns by 30 deg about both axes of
# the turntables either way (condition of the plate Jacobian below 62); from 0, or above the carts, it meets singular poses
START = (0.4, 0.0, 0.0)


class Seat(TwoFrames):
    """frame_b is frame_a turned by a constant unit quaternion, at the same place."""

    orientation = Parameter(
        [1.0, 0.0, 0.0, 0.0], unit="1", description="unit quaternion, scalar first, frame_a = R(u) @ frame_b"
    )

    def equations(self):
        a, b = self.frame_a, self.frame_b
        turn = of_quaternion(self.orientation)
        yield branch(a, b, forward=dict(R=a.R @ turn, w=a.w), backward=dict(R=b.R @ turn.T, w=b.w))
        yield b.r == a.r
        yield a.f + b.f == 0
        yield a.t + b.t == 0


class Turntable(TwoFrames):
    """A joint support plate and the motor that turns it: frame_b is the frame H of (4.21) or (4.23).

    The motor sits on what carries the turntable, so its torque acts back there.
    """

    offset = Parameter(shape=3, unit="m", description="origin of frame_b, resolved in frame_a")
    orientation = Parameter(
        shape=4, unit="1", description="frame_b in frame_a at angle 0 as a unit quaternion, scalar first"
    )
    axis = Parameter(shape=3, unit="1", description="axis of rotation, resolved in frame_b", evaluate=True)
    m = Parameter(unit="kg", min=0.0, description="mass, centred in the origin of frame_b")
    J = Parameter(shape=(3, 3), unit="kg.m2", description="inertia about the origin, resolved in frame_b")
    phi = Real(
        unit="rad", display="deg", description="angle against what carries it", prefer=StateSelect.PREFER
    )
    w = Real(
        unit="rad/s",
        display="deg/s",
        description="angular velocity against what carries it",
        prefer=StateSelect.PREFER,
    )
    tau = Input(unit="N.m", description="torque of the motor", start=0.0)
    base = FixedTranslation(r=offset)
    seat = Seat(orientation=orientation)
    joint = Revolute(n=axis, phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))
    body = Body(m=m, J=J)
    motor = Torque()

    def equations(self):
        yield connect(self.frame_a, self.base.frame_a)
        yield connect(self.base.frame_b, self.seat.frame_a)
        yield connect(self.seat.frame_b, self.joint.frame_a)
        yield connect(self.joint.frame_b, self.body.frame_a)
        yield connect(self.joint.frame_b, self.frame_b)
        yield connect(self.motor.flange, self.joint.axis)
        yield self.motor.tau == self.tau
        yield self.phi == self.joint.phi
        yield self.w == self.joint.w


class F1GantryTau(Model):
    """The F1, driven by the actuator forces `carts[i].f` and the torques `turntables[k].tau`.

    The six actuator coordinates q1 to q6 of the thesis are `carts[0..2].s` (m) and `turntables[0..2].phi` (rad):
    turntables[0] is on cart 2 (q4), turntables[1] on cart 3 (q5), turntables[2] on turntables[1] (q6).

    prototype: a record such as `prototypes.F1`, of unit quaternions; friction: the class of friction of the carts,
    or None; the turntables turn without. Further keywords modify members. `tool.r`, `tool.v`, `tool.w` and `tool.R`
    are the pose of the plate and its rates. It starts below the carts, as joints under the carts and above the tool
    ask for, links uncrossed, near `prototype.plate_rotation`. Pose and actuators all have start values, which meet in
    the middle: `tool=dict(r=Fixed(...), q=Fixed(...))` holds a pose exactly.
    Raises ModelError for another kind of record, another structure, or turntables that are not rigid.
    """

    world = World()
    arms = Array(Arm, [Arm(), TwoLinks(), ThreeLinks()])
    carts = Array(Cart, 3)
    turntables = Array(Turntable, 3)
    tool = Plate(r=dict(prefer=StateSelect.PREFER), v=dict(prefer=StateSelect.PREFER))

    def __init__(
        self, prototype: RotatingPrototype, *, friction: type[Friction] | None = TanhFriction, **modifications
    ):
        name = type(self).__name__
        _check_prototype(prototype, name)
        carts = driven_carts(prototype, friction, name, RotatingPrototype)
        for cart, s in zip(carts, START, strict=True):
            cart["s"] = dict(start=s)
        defaults = dict(
            arms=[_arm(arm) for arm in prototype.arms],
            turntables=[_turntable(turntable) for arm in prototype.arms for turntable in arm.turntables],
            carts=carts,
            tool=dict(
                m=prototype.plate_mass,
                J=np.array(prototype.plate_inertia),
                r_cm=list(prototype.plate_centre),
                r=dict(start=_tool_below_carts(prototype)),
                v=dict(start=0.0),
                q=dict(start=quaternion(np.array(prototype.plate_rotation))),
            ),
        )
        super().__init__(defaults, **modifications)

    def equations(self):
        for arm, cart in zip(self.arms, self.carts, strict=True):
            yield connect(self.world.frame_b, arm.frame_a)
            yield connect(arm.frame_cart, cart.frame)
            yield connect(arm.axis, cart.axis)
            yield connect(arm.frame_b, self.tool.frame_a)
        one, two, three = self.arms
        q4, q5, q6 = self.turntables
        yield connect(one.frame_cart, one.frame_links)
        yield connect(two.frame_cart, q4.frame_a)
        yield connect(q4.frame_b, two.frame_links)
        yield connect(three.frame_cart, q5.frame_a)
        yield connect(q5.frame_b, q6.frame_a)
        yield connect(q6.frame_b, three.frame_links)

    def shapes(self):
        yield from forces_on_carts()

    def rods(self) -> Rods:
        """The links and the turntables that carry them. Where the joint on cart 1 (4.20) and the turntables on carts 2 and 3
        (4.21) are is given, as it stands in the offsets of the guideways.
        """
        arms = [arm_of_rods(0, 1), arm_of_rods(1, 2, [0]), arm_of_rods(2, 3, [1, 2])]
        on_carts = [arms[0].rods[0].offset, arms[1].turntables[0].offset, arms[2].turntables[0].offset]
        return Rods(arms, given=on_carts)


def _check_prototype(prototype: RotatingPrototype, robot: str) -> None:
    check_record(prototype, robot, RotatingPrototype)
    found = tuple((len(arm.turntables), len(arm.links)) for arm in prototype.arms)
    if found != STRUCTURE:
        raise ModelError(
            f"{robot}: found {prototype.name} with (turntables, links) {found} on its arms, expected {STRUCTURE}; "
            "write another structure as a Model of its own, of Arm and Turntable"
        )
    for i, arm in enumerate(prototype.arms):
        for k, turntable in enumerate(arm.turntables):
            norm = math.hypot(*turntable.orientation)
            if abs(norm - 1.0) > 1e-9:  # as records of unit quaternions allow
                raise ModelError(
                    f"{robot}: found {prototype.name}.arms[{i}].turntables[{k}].orientation of length {norm:.6g}, "
                    "expected a unit quaternion, as a turntable is rigid; take prototypes.F1, or normalise it"
                )


def _turntable(turntable) -> dict:
    return dict(
        offset=list(turntable.offset),
        orientation=list(turntable.orientation),
        axis=list(turntable.axis),
        m=turntable.mass,
        J=np.array(turntable.inertia),
        phi=dict(start=0.0),
    )


def _arm(arm: RotatingArm) -> dict:
    links = [
        dict(
            length=link.length,
            offset=list(link.cart_offset),
            plate_offset=list(link.plate_offset),
            mass=link.mass,
        )
        for link in arm.links
    ]
    return dict(offset=list(arm.offset), direction=list(arm.direction), links=links)


def _tool_below_carts(prototype: RotatingPrototype) -> list[float]:
    """The tool, were each arm one link, with the actuators at START: three spheres meet there, below the carts (4.26)."""
    R = np.array(prototype.plate_rotation)
    centres = np.array([_single_joint(arm, s, R) for arm, s in zip(prototype.arms, START, strict=True)])
    lengths = np.array([np.mean([link.length for link in arm.links]) for arm in prototype.arms])
    upwards = np.mean([arm.direction for arm in prototype.arms], axis=0)
    normal = np.cross(centres[1] - centres[0], centres[2] - centres[0])
    normal *= np.sign(normal @ upwards) / np.linalg.norm(normal)
    # differences of |T - c|^2 = L^2 hold on the line through both points, which is normal to the plane of the centres
    rows = np.vstack([2 * (centres[1:] - centres[0]), normal])
    squares = (centres**2).sum(axis=1) - lengths**2
    foot = np.linalg.solve(rows, [*(squares[1:] - squares[0]), normal @ centres[0]])
    height = math.sqrt(max(0.0, lengths[0] ** 2 - (foot - centres[0]) @ (foot - centres[0])))
    return list(foot - height * normal)


def _single_joint(arm: RotatingArm, s: float, R: np.ndarray) -> np.ndarray:
    """The mean joint on the arm, its cart at s, less the place of the mean joint on the plate (4.7); (3,) in m."""
    place, turned = np.array(arm.offset) + s * np.array(arm.direction), np.eye(3)
    for turntable in arm.turntables:
        place = place + turned @ turntable.offset
        turned = turned @ np.array(ca.evalf(of_quaternion(ca.DM(turntable.orientation))))
    on_arm = np.mean([link.cart_offset for link in arm.links], axis=0)
    on_plate = np.mean([link.plate_offset for link in arm.links], axis=0)
    return place + turned @ on_arm - R @ on_plate
