"""The five-bar robot: two driven cranks on the ground, two couplers that meet in the tool, all in a plane.

    elbow_i = A_i + crank_i e(cranks[i].phi)       pivots A_i = -+ ground / 2 along e
    |tool - elbow_i| = coupler_i                   forward kinematics: two circles that meet

All five joints are plain revolutes (RRRRR); that the tool stays in the plane follows from them and is not assumed.
"""

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Parameter, Real, StateSelect, connect, cross, der, norm_2
from gantrytau.language.self_description.appearance import PathLine
from gantrytau.mechanics.multibody import FixedTranslation, Frame, PointMass, Revolute, TwoFrames, World
from gantrytau.mechanics.rotational import Torque
from gantrytau_models.mechanisms.planar.four_bar import Bar, Plane

PHI = (2.2, np.pi - 2.2)  # rad, of the cranks at the start: elbows outwards
PASSIVE = dict(phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))


class Crank(TwoFrames):
    """A bar on a driven pivot: frame_a at the ground, frame_b at the elbow."""

    length = Parameter(unit="m", min=0.0, description="from pivot to elbow")
    m = Parameter(0.5, unit="kg", min=0.0, description="mass of the bar")
    phi = Real(unit="rad", description="angle from the line of the pivots, about the normal")
    w = Real(unit="rad/s", description="angular velocity about the normal")
    tau = Input(unit="N.m", description="torque of the motor, about the normal", start=0.0)
    pivot = Revolute(**PASSIVE)
    bar = Bar(length=length, m=m)
    motor = Torque()

    def equations(self):
        yield connect(self.frame_a, self.pivot.frame_a)
        yield connect(self.pivot.frame_b, self.bar.frame_a)
        yield connect(self.bar.frame_b, self.frame_b)
        yield connect(self.motor.flange, self.pivot.axis)
        yield self.motor.tau == self.tau
        yield self.phi == self.pivot.phi
        yield self.bar.phi == self.phi
        yield self.w == der(self.phi)


class Tip(Model):
    """The tool, a point mass where the couplers meet."""

    m = Parameter(unit="kg", min=0.0, description="mass of tool and load")
    r = Real(3, unit="m", description="position, resolved in the world", prefer=StateSelect.PREFER)
    v = Real(3, unit="m/s", description="velocity, resolved in the world", prefer=StateSelect.PREFER)
    body = PointMass(m=m)
    frame = Frame()

    def equations(self):
        yield connect(self.frame, self.body.frame_a)
        yield self.r == self.frame.r
        yield self.v == der(self.r)

    def shapes(self):
        yield PathLine(at="r")


class FiveBar(Model):
    """A five-bar robot, driven by the torques `cranks[i].tau`; its tool `tool.r` moves in a plane.

    Lengths are the same on both sides unless `cranks=[dict(length=0.4), {}]` or `couplers=[...]` says otherwise. `n` is the
    normal of the plane and `e` the direction from pivot 0 to pivot 1; angles count from e about n. It starts with
    the elbows outwards and the tool away from the ground, unless start values of `tool.r` say otherwise.
    """

    ground = Parameter(0.2, unit="m", min=0.0, description="distance of the pivots")
    crank_length = Parameter(0.3, unit="m", min=0.0, description="from a pivot to its elbow")
    coupler_length = Parameter(0.4, unit="m", min=0.0, description="from an elbow to the tool")
    tool_mass = Parameter(0.5, unit="kg", min=0.0, description="mass of tool and load")
    n = Parameter([0.0, 0.0, 1.0], unit="1", description="normal of the plane, resolved in the world")
    e = Parameter([1.0, 0.0, 0.0], unit="1", description="from pivot 0 to pivot 1, resolved in the world")
    world = World()
    plane = Plane(n=n, e=e)
    pivots = Array(
        FixedTranslation,
        [
            dict(r=lambda self: ca.vertcat(-self.ground / 2, 0, 0)),
            dict(r=lambda self: ca.vertcat(self.ground / 2, 0, 0)),
        ],
    )
    cranks = Array(Crank, [dict(phi=dict(start=PHI[0])), dict(phi=dict(start=PHI[1]))], length=crank_length)
    elbows = Array(Revolute, 2, **PASSIVE)
    couplers = Array(Bar, 2, length=coupler_length, m=0.4)
    joint = Revolute(**PASSIVE)
    tool = Tip(m=tool_mass, r=dict(start=lambda self: self.ahead()), v=dict(start=0.0))

    def ahead(self) -> ca.SX:
        """The tool where the circles about the elbows meet, away from the ground, (3,) in m."""
        one, two = (
            ca.vertcat(side * self.ground / 2 + crank.length * np.cos(phi), crank.length * np.sin(phi))
            for side, crank, phi in zip((-1, 1), self.cranks, PHI, strict=True)
        )
        across = two - one
        distance = norm_2(across)
        a, b = (coupler.length for coupler in self.couplers)
        along = (a**2 - b**2 + distance**2) / (2 * distance)
        # out of reach: some height, so that it is clear on which side the tool is
        height = ca.sqrt(ca.fmax(a**2 - along**2, 0.01 * a**2))
        flat = one + (along * across + height * ca.vertcat(-across[1], across[0])) / distance
        n, e = self.n / norm_2(self.n), self.e
        y = cross(n, e)
        x = cross(y, n)
        return (flat[0] * x + flat[1] * y) / norm_2(x)

    def equations(self):
        yield connect(self.world.frame_b, self.plane.frame_a)
        for pivot, crank, elbow, coupler in zip(
            self.pivots, self.cranks, self.elbows, self.couplers, strict=True
        ):
            yield connect(self.plane.frame_b, pivot.frame_a)
            yield connect(pivot.frame_b, crank.frame_a)
            yield connect(crank.frame_b, elbow.frame_a)
            yield connect(elbow.frame_b, coupler.frame_a)
            yield coupler.phi == crank.phi + elbow.phi
        yield connect(self.couplers[0].frame_b, self.joint.frame_a)
        yield connect(self.joint.frame_b, self.couplers[1].frame_b)
        yield connect(self.couplers[0].frame_b, self.tool.frame)
