"""Frames, the world, and rigid offsets between frames."""

import casadi as ca
import numpy as np

from gantrytau import Connector, Flow, Model, Parameter, Propagated, Real, branch, der, root
from gantrytau.language.self_description.appearance import Stick
from gantrytau.mechanics.multibody.orientation import about, turning, unit


class Frame(Connector):
    """A coordinate system fixed to a body."""

    r = Real(3, unit="m", description="position of the origin, resolved in the world")
    R = Propagated(
        (3, 3),
        unit="1",
        description="orientation, world = R @ local",
        start=np.eye(3),
        rate=lambda self: ca.skew(self.w) @ self.R,
    )
    w = Propagated(3, unit="rad/s", description="angular velocity, resolved in the world", start=np.zeros(3))
    f = Flow(3, unit="N", description="cut force, resolved in the world")
    t = Flow(3, unit="N.m", description="cut torque, resolved in the world")

    def closing(self, other):
        """Two frames that coincide: the cut force holds the origins together, the cut torque the axes.

        Resolved in this frame: what is redundant in a planar loop stays so when the plane turns.
        """
        R, gap = self.R, self.r - other.r
        yield "position", "f", R, R.T @ gap, R.T @ der(gap)
        yield "orientation", "t", R, turning(other.R.T @ R), R.T @ (self.w - other.w)


class World(Model):
    """The inertial frame and gravity, which pulls along -z of it."""

    g = Parameter(9.81, unit="m/s2", description="acceleration of gravity")
    gravity = Parameter(
        lambda self: ca.vertcat(0, 0, -self.g),
        shape=3,
        unit="m/s2",
        description="gravity as a vector, resolved in the world",
    )
    frame_b = Frame()

    def equations(self):
        yield root(self.frame_b)
        yield self.frame_b.r == 0


class Fixed(Model):
    """A frame that does not move, turned by phi about n."""

    r = Parameter([0.0, 0.0, 0.0], unit="m", description="position, resolved in the world")
    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis of the rotation", evaluate=True)
    phi = Parameter(0.0, unit="rad", description="angle of the rotation", evaluate=True)
    frame_b = Frame()

    def equations(self):
        yield root(self.frame_b, R=about(unit(self.n), self.phi))
        yield self.frame_b.r == self.r


class TwoFrames(Model):
    """Base of components with two frames."""

    frame_a = Frame()
    frame_b = Frame()


class FixedTranslation(TwoFrames):
    """A massless rigid bar from frame_a to frame_b."""

    r = Parameter([0.0, 0.0, 0.0], unit="m", description="from frame_a to frame_b, resolved in frame_a")

    def equations(self):
        a, b = self.frame_a, self.frame_b
        arm = a.R @ self.r
        yield branch(a, b, forward=dict(R=a.R, w=a.w), backward=dict(R=b.R, w=b.w))
        yield b.r == a.r + arm
        yield a.f + b.f == 0
        yield a.t + b.t + ca.cross(arm, b.f) == 0

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")


class FixedRotation(TwoFrames):
    """frame_b is frame_a turned by a constant angle phi about n, at the same place."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis, resolved in frame_a", evaluate=True)
    phi = Parameter(0.0, unit="rad", description="angle of the rotation", evaluate=True)

    def equations(self):
        a, b = self.frame_a, self.frame_b
        turn = about(unit(self.n), self.phi)
        yield branch(a, b, forward=dict(R=a.R @ turn, w=a.w), backward=dict(R=b.R @ turn.T, w=b.w))
        yield b.r == a.r
        yield a.f + b.f == 0
        yield a.t + b.t == 0
