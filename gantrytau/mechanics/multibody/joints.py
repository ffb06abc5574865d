"""Joints: one, two or three coordinates between frame_a and frame_b, and the rod with two ball joints."""

from gantrytau import Parameter, Real, branch, connect, constraint, cross, der, dot, norm_2, outer, require
from gantrytau.language.declarations import StateSelect
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody.frames import TwoFrames, World
from gantrytau.mechanics.multibody.orientation import about, of_quaternion, spin_of_quaternion, unit


class Prismatic(TwoFrames):
    """A joint that slides along an axis fixed in frame_a, driven through its flange `axis`."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="axis of motion, resolved in frame_a", evaluate=True)
    e = Parameter(
        lambda self: self.n / norm_2(self.n),
        shape=3,
        unit="1",
        description="motion of frame_b for a unit of s; along n, of length one unless set otherwise",
    )
    s = Real(unit="m", description="coordinate along the axis", prefer=StateSelect.PREFER)
    v = Real(unit="m/s", description="speed along the axis", prefer=StateSelect.PREFER)
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
        yield self.axis.s == self.s
        yield self.axis.f == self.f
        yield self.support.s == 0

    def failure_hint(self, variable: str) -> str:
        return "nothing holds the sliding along its axis" if variable in ("s", "v") else ""


class Revolute(TwoFrames):
    """A joint that turns about an axis fixed in both frames, driven through its flange `axis`."""

    n = Parameter(
        [0.0, 0.0, 1.0], unit="1", description="axis of rotation, resolved in frame_a", evaluate=True
    )
    phi = Real(unit="rad", description="angle from frame_a to frame_b about n", prefer=StateSelect.PREFER)
    w = Real(unit="rad/s", description="angular velocity about n", prefer=StateSelect.PREFER)
    tau = Real(unit="N.m", description="driving torque about n")
    axis = rotational.Flange()
    support = rotational.Flange()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        n = unit(self.n)
        yield require(norm_2(self.n) > 0, "expected an axis that is not zero")
        spin = a.R @ n * self.w
        yield branch(
            a,
            b,
            forward=dict(R=a.R @ about(n, self.phi), w=a.w + spin),
            backward=dict(R=b.R @ about(n, -self.phi), w=b.w - spin),
        )
        yield b.r == a.r
        yield self.w == der(self.phi)
        yield a.f + b.f == 0
        yield a.t + b.t == 0
        # what the axis drives is the part of the cut torque that does work
        yield self.tau == -dot(a.R @ n, b.t)
        yield self.axis.phi == self.phi
        yield self.axis.tau == self.tau
        yield self.support.phi == 0

    def failure_hint(self, variable: str) -> str:
        return "nothing holds the rotation about its axis" if variable in ("phi", "w") else ""


class Universal(TwoFrames):
    """Two revolute joints with crossing axes: first about n_a, fixed in frame_a, then about n_b."""

    n_a = Parameter([1.0, 0.0, 0.0], unit="1", description="first axis, resolved in frame_a", evaluate=True)
    n_b = Parameter([0.0, 1.0, 0.0], unit="1", description="second axis, resolved in frame_b", evaluate=True)
    phi_a = Real(unit="rad", description="angle about n_a")
    phi_b = Real(unit="rad", description="angle about n_b")
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

    def failure_hint(self, variable: str) -> str:
        return "nothing holds the rotation in the ball joint" if variable == "q" else ""


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
        yield require(
            self.L > 0, "expected a length above zero; connect the frames through a Spherical joint instead"
        )
        yield constraint(self.L**2 == dot(rod, rod), dual=self.tension)
        yield a.f == -self.tension * rod + inertial
        yield b.f == self.tension * rod + inertial
        yield a.t == 0
        yield b.t == 0

    def failure_hint(self, variable: str) -> str:
        return "the rod has no direction in which it could push" if variable == "tension" else ""
