"""Masses: a point, and a rigid body that may move freely."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from gantrytau import Model, Parameter, Real, der, dot, outer, require, root
from gantrytau.language.self_description.appearance import Ball, Lump, Shape
from gantrytau.mechanics.multibody.frames import Frame, World
from gantrytau.mechanics.multibody.orientation import of_quaternion, spin_of_quaternion

MASSLESS = "the body has no mass or inertia against this motion"


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

    def shapes(self):
        yield Ball(at="frame_a.r", mass="m")


class Body(Model):
    """A rigid body. Where no joint leads from the world to it, or with free=True, it moves freely.

    A free body has its own coordinates: the position r of its frame and the unit quaternion q of its
    orientation. Start values of those, of v and of w say how it starts.
    """

    free = False
    m = Parameter(1.0, unit="kg", min=0.0, description="mass")
    r_cm = Parameter([0.0, 0.0, 0.0], unit="m", description="centre of mass, resolved in frame_a")
    J = Parameter(
        np.diag([0.1, 0.1, 0.1]),
        unit="kg.m2",
        description="inertia about the centre of mass, in frame_a",
        assumed="nobody gave the inertia, 0.1 kg.m2 about each axis is taken; give J, zeros for a mass in one point",
    )
    r = Real(3, unit="m", description="position of frame_a, resolved in the world", undetermined=MASSLESS)
    v = Real(3, unit="m/s", description="velocity of frame_a, resolved in the world", undetermined=MASSLESS)
    w = Real(3, unit="rad/s", description="angular velocity, resolved in the world")
    q = Real(
        4,
        unit="1",
        description="orientation of a free body as a unit quaternion",
        start=[1.0, 0.0, 0.0, 0.0],
        undetermined=MASSLESS,
    )
    z = Real(3, unit="rad/s2", description="angular acceleration of a free body, resolved in the world")
    world = outer(World)
    frame_a = Frame()

    def equations(self):
        a = self.frame_a
        yield root(
            a,
            R=of_quaternion(self.q),
            w=spin_of_quaternion(self.q, der(self.q)),
            coordinates=None if self.free else ca.vertcat(self.q, self.z),
            equations=[dot(self.q, self.q) == 1, self.z == der(self.w)],
        )
        yield require(
            no_negative_eigenvalue(self.J),
            "expected a symmetric, positive definite inertia, or semidefinite for a rod",
        )
        yield require(
            # printed inertias are rounded
            no_negative_eigenvalue(ca.trace(self.J) * ca.SX.eye(3) / 2 - self.J, least=-1e-3),
            "expected principal moments of which none exceeds the sum of the other two; no body has such an inertia",
        )
        yield self.r == a.r
        yield self.v == der(self.r)
        yield self.w == a.w
        arm, spin, gain = a.R @ self.r_cm, a.R.T @ a.w, a.R.T @ der(a.w)
        centre = der(self.v) + ca.cross(der(a.w), arm) + ca.cross(a.w, ca.cross(a.w, arm))
        # Newton's law for the centre of mass, Euler's in axes fixed to the body
        yield a.f == self.m * (centre - self.world.gravity)
        yield a.t == a.R @ (self.J @ gain + ca.cross(spin, self.J @ spin)) + ca.cross(arm, a.f)

    def shapes(self) -> Iterator[Shape]:
        yield Lump(at="frame_a.r", R="frame_a.R", mass="m", r_cm="r_cm", J="J")


def no_negative_eigenvalue(A: ca.SX, least: float = -1e-12) -> ca.SX:
    """Whether a (3, 3) matrix is symmetric and its principal minors, relative to its trace, exceed `least`."""
    B = A / (ca.fabs(ca.trace(A)) + 1e-300)
    pairs = [(0, 1), (0, 2), (1, 2)]
    minors = [B[i, i] for i in range(3)] + [B[i, i] * B[j, j] - B[i, j] ** 2 for i, j in pairs] + [ca.det(B)]
    return ca.logic_and(ca.norm_fro(B - B.T) < 1e-9, ca.mmin(ca.vertcat(*minors)) > least)
