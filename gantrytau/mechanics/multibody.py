"""Bodies and joints in space, as far as point masses need them.

| quantity | meaning | resolved in |
|---|---|---|
| frame.r | position of the frame's origin, m | world |
| frame.R | orientation: columns are the frame's axes, world = R @ local | - |
| frame.f | cut force, positive into the component, N | world |
| frame.t | cut torque about the frame's origin, positive into the component, N.m | world |
| s, v, f | coordinate, speed and driving force of a prismatic joint | its axis |

frame_a is the side towards the base, frame_b the other.
"""

import casadi as ca
import numpy as np

from gantrytau import Connector, Flow, Model, Parameter, Propagated, Real, branch, der, outer, root
from gantrytau.declarations import StateSelect
from gantrytau.mechanics import translational


class Frame(Connector):
    """A coordinate system fixed to a body."""

    r = Real(3, unit="m", description="position of the origin, resolved in the world")
    R = Propagated((3, 3), unit="1", description="orientation, world = R @ local", start=np.eye(3))
    f = Flow(3, unit="N", description="cut force, resolved in the world")
    t = Flow(3, unit="N.m", description="cut torque, resolved in the world")


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
        yield root(self.frame_b, R=np.eye(3))
        yield self.frame_b.r == 0


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
        yield branch(a, b, forward=dict(R=a.R), backward=dict(R=b.R))
        yield b.r == a.r + arm
        yield a.f + b.f == 0
        yield a.t + b.t + ca.cross(arm, b.f) == 0


class Prismatic(TwoFrames):
    """A joint that slides along an axis fixed in frame_a, driven through its flange `axis`."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis of motion, resolved in frame_a", evaluate=True)
    e = Parameter(
        lambda self: self.n / ca.norm_2(self.n),
        shape=3,
        unit="1",
        description="motion of frame_b for a unit of s; along n, of length one unless set otherwise",
    )
    s = Real(unit="m", description="coordinate along the axis", prefer=StateSelect.PREFER)
    v = Real(unit="m/s", description="speed along the axis", prefer=StateSelect.PREFER)
    f = Real(unit="N", description="driving force along the axis")
    axis = translational.Flange()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        way = a.R @ self.e
        yield branch(a, b, forward=dict(R=a.R), backward=dict(R=b.R))
        yield b.r == a.r + way * self.s
        yield self.v == der(self.s)
        yield a.f + b.f == 0
        yield a.t + b.t + ca.cross(way * self.s, b.f) == 0
        # what the axis drives is the part of the cut force that does work
        yield self.f == -ca.dot(way, b.f)
        yield self.axis.s == self.s
        yield self.axis.f == self.f

    def failure_hint(self, variable: str) -> str:
        return "nothing holds the sliding along its axis" if variable in ("s", "v") else ""


class PointMass(Model):
    """A mass without extension."""

    m = Parameter(1.0, unit="kg", min=0.0, description="mass")
    v = Real(3, unit="m/s", description="velocity, resolved in the world")
    world = outer(World)
    frame_a = Frame()

    def equations(self):
        a = self.frame_a
        yield self.v == der(a.r)
        yield self.m * (der(self.v) - self.world.gravity) == a.f
        yield a.t == 0


class SphericalSpherical(TwoFrames):
    """A rod of constant length with a ball joint at each end and a point mass in its middle."""

    L = Parameter(1.0, unit="m", min=0.0, description="length between the centres of the ball joints")
    m = Parameter(0.0, unit="kg", min=0.0, description="mass, in the middle of the rod")
    tension = Real(unit="N/m", description="force along the rod, divided by its length; positive when pulled")
    world = outer(World)

    def equations(self):
        a, b = self.frame_a, self.frame_b
        rod = b.r - a.r
        middle = (a.r + b.r) / 2
        # half of the force that the mass needs comes through each end
        inertial = self.m * (der(der(middle)) - self.world.gravity) / 2
        yield self.L**2 == ca.dot(rod, rod)
        yield a.f == -self.tension * rod + inertial
        yield b.f == self.tension * rod + inertial
        yield a.t == 0
        yield b.t == 0

    def failure_hint(self, variable: str) -> str:
        return "the rod has no direction in which it could push" if variable == "tension" else ""
