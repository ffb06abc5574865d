"""A serial wrist of two degrees of freedom on the plate, for five axes on the three guideways of a Gantry-Tau.

Dressler (2012), chapter 2, mentions such a wrist for the robots whose plate keeps its orientation, and prints no data
of it: all numbers here are assumed, of the size of a small spindle head.
"""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, ModelError, Parameter, Real, StateSelect, connect, der
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, TwoFrames
from gantrytau.mechanics.rotational import Torque
from gantrytau_models.mechanisms.f1 import F1GantryTau, Seat
from gantrytau_models.mechanisms.six_link import Plate, SixLinkGantryTau


def small_turn(tilt: Any) -> ca.SX:
    """Unit quaternion, scalar first, of a turn by 2 atan(|tilt| / 2) about tilt (3,): a rotation vector in rad if small."""
    return ca.vertcat(1, tilt / 2) / ca.sqrt(1 + ca.sumsqr(tilt) / 4)


class WristJoint(TwoFrames):
    """One axis of a wrist: its motor sits in what carries it and turns a body with the origin of frame_b on the axis."""

    offset = Parameter(
        [0.0, 0.0, -0.1], unit="m", description="from frame_a to the axis, resolved in frame_a"
    )
    axis = Parameter(
        [0.0, 0.0, 1.0], unit="1", description="axis of rotation, resolved in frame_a", evaluate=True
    )
    tilt = Parameter(
        [0.0, 0.0, 0.0],
        unit="rad",
        description="small turn of the whole joint against frame_a, resolved there",
    )
    m = Parameter(2.0, unit="kg", min=0.0, description="mass of what it turns")
    r_cm = Parameter([0.0, 0.0, 0.0], unit="m", description="centre of that mass, resolved in frame_b")
    J = Parameter(
        np.diag([0.01, 0.01, 0.006]),
        unit="kg.m2",
        description="inertia about the centre of mass, resolved in frame_b",
    )
    phi = Real(unit="rad", display="deg", description="angle about the axis", prefer=StateSelect.PREFER)
    w = Real(
        unit="rad/s",
        display="deg/s",
        description="angular velocity about the axis",
        prefer=StateSelect.PREFER,
    )
    tau = Input(unit="N.m", description="torque of the motor", start=0.0)
    arm = FixedTranslation(r=offset)
    seat = Seat(orientation=lambda joint: small_turn(joint.tilt))
    joint = Revolute(n=axis, phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))
    body = Body(m=m, r_cm=r_cm, J=J)
    motor = Torque()

    def equations(self):
        yield connect(self.frame_a, self.arm.frame_a)
        yield connect(self.arm.frame_b, self.seat.frame_a)
        yield connect(self.seat.frame_b, self.joint.frame_a)
        yield connect(self.joint.frame_b, self.body.frame_a)
        yield connect(self.joint.frame_b, self.frame_b)
        yield connect(self.motor.flange, self.joint.axis)
        yield self.motor.tau == self.tau
        yield self.phi == self.joint.phi
        yield self.w == self.joint.w


class SerialWrist(TwoFrames):
    """Two joints in series between the plate (frame_a) and the tool flange (frame_b), driven by `joints[k].tau`.

    Unless modified, the first turns about z of the plate, the second about y of what the first turns, and the
    flange points along -z. r, v, R, w: the flange and its rates.
    """

    offset = Parameter(
        [0.0, 0.0, -0.15], unit="m", description="from the second axis to the flange, in frame_b"
    )
    joints = Array(
        WristJoint,
        [
            dict(m=2.0, r_cm=[0.0, 0.0, -0.05]),
            dict(offset=[0.0, 0.0, -0.12], axis=[0.0, 1.0, 0.0], m=1.5, r_cm=[0.0, 0.0, -0.06]),
        ],
    )
    flange = FixedTranslation(r=offset)
    r = Real(3, unit="m", description="position of the flange, resolved in the world")
    v = Real(3, unit="m/s", description="velocity of the flange, resolved in the world")
    R = Real((3, 3), unit="1", description="orientation of the flange, world = R @ flange")
    w = Real(3, unit="rad/s", description="angular velocity of the flange, resolved in the world")

    def equations(self):
        first, second = self.joints
        yield connect(self.frame_a, first.frame_a)
        yield connect(first.frame_b, second.frame_a)
        yield connect(second.frame_b, self.flange.frame_a)
        yield connect(self.flange.frame_b, self.frame_b)
        yield self.r == self.frame_b.r
        yield self.v == der(self.r)
        yield self.R == self.frame_b.R
        yield self.w == self.frame_b.w


class WithWrist(Model):
    """A wrist on the plate of any robot whose `tool` is a `Plate`: `class Mine(WithWrist, SixLinkGantryTau)`.

    Stands before the robot, whose equations it adds to; ModelError if it stands behind.
    """

    tool: Plate
    wrist = SerialWrist()

    def __init_subclass__(cls, **keywords):
        super().__init_subclass__(**keywords)
        if WithWrist in cls.__bases__[1:]:
            raise ModelError(
                f"{cls.__name__}: found WithWrist behind {cls.__bases__[0].__name__}, which would leave the wrist "
                f"unconnected; expected class {cls.__name__}(WithWrist, {cls.__bases__[0].__name__})"
            )

    def equations(self):
        yield from super().equations()
        yield connect(self.tool.frame_a, self.wrist.frame_a)


class SixLinkWithWrist(WithWrist, SixLinkGantryTau):
    """The six-link robot with a wrist: three guideways and two axes."""


class F1WithWrist(WithWrist, F1GantryTau):
    """The F1 with a wrist: three guideways, three turntables and two axes more than a pose needs."""
