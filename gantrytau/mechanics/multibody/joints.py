"""Joints: one, two or three coordinates between frame_a and frame_b, and the rod with two ball joints."""

from collections.abc import Iterator
from typing import Any

import casadi as ca

from gantrytau import Parameter, Real, branch, connect, constraint, cross, der, dot, norm_2, outer, require
from gantrytau.language.declarations import StateSelect
from gantrytau.language.self_description.appearance import Ball, Cuboid, ForceArrow, Hinge, Slideway, Stick
from gantrytau.language.statements import Branch
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody.frames import Frame, TwoFrames, World
from gantrytau.mechanics.multibody.orientation import about, of_quaternion, spin_of_quaternion, unit

SLIDES = "nothing holds the sliding along its axis"
TURNS = "nothing holds the rotation about its axis"


class Prismatic(TwoFrames):
    """A joint that slides along an axis fixed in frame_a, driven through its flange `axis`."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis of motion, resolved in frame_a", evaluate=True)
    e = Parameter(
        lambda self: self.n / norm_2(self.n),
        shape=3,
        unit="1",
        description="motion of frame_b for a unit of s; along n, of length one unless set otherwise",
    )
    s = Real(
        unit="m", description="coordinate along the axis", prefer=StateSelect.PREFER, undetermined=SLIDES
    )
    v = Real(unit="m/s", description="speed along the axis", prefer=StateSelect.PREFER, undetermined=SLIDES)
    f = Real(unit="N", description="driving force along the axis")
    axis = translational.Flange()
    support = translational.Flange()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        way = a.R @ self.e
        yield require(norm_2(self.e) > 0, "expected an axis that is not zero")
        yield branch(a, b, forward=dict(R=a.R, w=a.w), backward=dict(R=b.R, w=b.w))
        yield b.r == a.r + way * self.s
        yield self.v == der(self.s)
        yield a.f + b.f == 0
        yield a.t + b.t + cross(way * self.s, b.f) == 0
        # what the axis drives is the part of the cut force that does work
        yield self.f == -dot(way, b.f)
        yield from _driven_along(self.s, self.f, self.axis, self.support)

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")
        yield Slideway(at="frame_a.r", direction="e", coordinate="s", R="frame_a.R")
        yield Cuboid(at="frame_b.r", size=4.0, R="frame_b.R")
        yield ForceArrow(at="frame_b.r", force="f", direction="e", R="frame_a.R")


class Revolute(TwoFrames):
    """A joint that turns about an axis fixed in both frames, driven through its flange `axis`."""

    n = Parameter(
        [0.0, 0.0, 1.0], unit="1", description="axis of rotation, resolved in frame_a", evaluate=True
    )
    phi = Real(
        unit="rad",
        display="deg",
        description="angle from frame_a to frame_b about n",
        prefer=StateSelect.PREFER,
        undetermined=TURNS,
    )
    w = Real(
        unit="rad/s",
        display="deg/s",
        description="angular velocity about n",
        prefer=StateSelect.PREFER,
        undetermined=TURNS,
    )
    tau = Real(unit="N.m", description="driving torque about n")
    axis = rotational.Flange()
    support = rotational.Flange()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        n = unit(self.n)
        yield require(norm_2(self.n) > 0, "expected an axis that is not zero")
        yield _turned(a, b, n, self.phi, self.w)
        yield b.r == a.r
        yield self.w == der(self.phi)
        yield a.f + b.f == 0
        yield a.t + b.t == 0
        # what the axis drives is the part of the cut torque that does work
        yield self.tau == -dot(a.R @ n, b.t)
        yield from _driven_about(self.phi, self.tau, self.axis, self.support)

    def shapes(self):
        yield Hinge(at="frame_a.r", axis="n", R="frame_a.R")


class Cylindrical(TwoFrames):
    """A joint that slides along and turns about an axis fixed in both frames, each driven through its own flange."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis, resolved in frame_a", evaluate=True)
    s = Real(unit="m", description="coordinate along n", prefer=StateSelect.PREFER, undetermined=SLIDES)
    v = Real(unit="m/s", description="speed along n", prefer=StateSelect.PREFER, undetermined=SLIDES)
    f = Real(unit="N", description="driving force along n")
    phi = Real(
        unit="rad", display="deg", description="angle about n", prefer=StateSelect.PREFER, undetermined=TURNS
    )
    w = Real(
        unit="rad/s", display="deg/s", description="its rate", prefer=StateSelect.PREFER, undetermined=TURNS
    )
    tau = Real(unit="N.m", description="driving torque about n")
    axis_s, support_s = translational.Flange(), translational.Flange()
    axis_phi, support_phi = rotational.Flange(), rotational.Flange()

    def equations(self):
        a, b, n = self.frame_a, self.frame_b, unit(self.n)
        yield require(norm_2(self.n) > 0, "expected an axis that is not zero")
        yield _turned(a, b, n, self.phi, self.w)
        yield b.r == a.r + a.R @ n * self.s
        yield ca.vertcat(self.v, self.w) == der(ca.vertcat(self.s, self.phi))
        yield a.f + b.f == 0
        yield a.t + b.t + cross(b.r - a.r, b.f) == 0
        yield self.f == -dot(a.R @ n, b.f)
        yield self.tau == -dot(a.R @ n, b.t)
        yield from _driven_along(self.s, self.f, self.axis_s, self.support_s)
        yield from _driven_about(self.phi, self.tau, self.axis_phi, self.support_phi)

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")
        yield Hinge(at="frame_b.r", axis="n", R="frame_a.R")


class Universal(TwoFrames):
    """Two revolute joints with crossing axes: first about n_a, fixed in frame_a, then about n_b."""

    n_a = Parameter([1.0, 0.0, 0.0], unit="1", description="first axis, resolved in frame_a", evaluate=True)
    n_b = Parameter([0.0, 1.0, 0.0], unit="1", description="second axis, resolved in frame_b", evaluate=True)
    phi_a = Real(unit="rad", display="deg", description="angle about n_a")
    phi_b = Real(unit="rad", display="deg", description="angle about n_b")
    first = Revolute(n=n_a)
    second = Revolute(n=n_b)
    axis_a = rotational.Flange()
    axis_b = rotational.Flange()

    def equations(self):
        yield connect(self.frame_a, self.first.frame_a)
        yield connect(self.first.frame_b, self.second.frame_a)
        yield connect(self.second.frame_b, self.frame_b)
        yield connect(self.axis_a, self.first.axis)
        yield connect(self.axis_b, self.second.axis)
        yield self.phi_a == self.first.phi
        yield self.phi_b == self.second.phi


class Spherical(TwoFrames):
    """A ball joint. Loops are opened here rather than elsewhere: it then has no coordinates of its own."""

    q = Real(
        4,
        unit="1",
        description="orientation of frame_b in frame_a as a unit quaternion",
        start=[1.0, 0.0, 0.0, 0.0],
        undetermined="nothing holds the rotation in the ball joint",
    )

    def equations(self):
        a, b = self.frame_a, self.frame_b
        turn = of_quaternion(self.q)
        spin = a.R @ spin_of_quaternion(self.q, der(self.q))
        yield branch(
            a,
            b,
            forward=dict(R=a.R @ turn, w=a.w + spin),
            backward=dict(R=b.R @ turn.T, w=b.w - spin),
            coordinates=self.q,
            equations=[dot(self.q, self.q) == 1, b.r == a.r],
            otherwise=[constraint(b.r == a.r, dual=b.f)],
        )
        yield a.f + b.f == 0
        yield a.t == 0
        yield b.t == 0

    def shapes(self):
        yield Ball(at="frame_a.r")


class SphericalSpherical(TwoFrames):
    """A rod of constant length with a ball joint at each end and a point mass in its middle."""

    L = Parameter(1.0, unit="m", min=0.0, description="length between the centres of the ball joints")
    m = Parameter(0.0, unit="kg", min=0.0, description="mass, in the middle of the rod")
    tension = Real(
        unit="N/m",
        description="force along the rod, divided by its length; positive when pulled",
        undetermined="the rod has no direction in which it could push",
    )
    world = outer(World)

    def equations(self):
        a, b = self.frame_a, self.frame_b
        rod = b.r - a.r
        middle = (a.r + b.r) / 2
        # half of the force that the mass needs comes through each end
        inertial = self.m * (der(der(middle)) - self.world.gravity) / 2
        yield require(
            self.L > 0, "expected a length above zero; connect the frames through a Spherical joint instead"
        )
        yield constraint(self.L**2 == dot(rod, rod), dual=self.tension)
        yield a.f == -self.tension * rod + inertial
        yield b.f == self.tension * rod + inertial
        yield a.t == 0
        yield b.t == 0

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")
        yield Ball(at="frame_a.r")
        yield Ball(at="frame_b.r")


def _turned(a: Frame, b: Frame, n: Any, phi: Any, w: Any) -> Branch:
    """Frame b turned against a by phi, at the rate w, about the unit axis n that is fixed in both."""
    spin = a.R @ n * w
    return branch(
        a,
        b,
        forward=dict(R=a.R @ about(n, phi), w=a.w + spin),
        backward=dict(R=b.R @ about(n, -phi), w=b.w - spin),
    )


def _driven_along(s: Any, f: Any, axis: translational.Flange, support: translational.Flange) -> Iterator[Any]:
    """The flanges of a joint that slides."""
    yield axis.s == s
    yield axis.f == f
    yield support.s == 0


def _driven_about(phi: Any, tau: Any, axis: rotational.Flange, support: rotational.Flange) -> Iterator[Any]:
    """The flanges of a joint that turns."""
    yield axis.phi == phi
    yield axis.tau == tau
    yield support.phi == 0
