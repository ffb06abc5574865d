"""Contact: laws of the normal force, a point or sphere on a plane, a peg in a hole. Nothing in it ever pulls.

Contact begins and ends where a condition switches, so that simulations stop there and start anew.
"""

from typing import Any, NamedTuple

import casadi as ca

from gantrytau import Model, Parameter, Real, cross, der, dot, fmax, if_else, norm_2, require, sqrt
from gantrytau.mechanics.multibody.frames import TwoFrames
from gantrytau.mechanics.multibody.orientation import unit


class ContactLaw(Model):
    """Base of laws of the normal force; replace it to choose another."""

    p = Real(unit="m", description="depth of the contact, negative when apart")
    v = Real(unit="m/s", description="rate of the depth")
    f = Real(unit="N", description="normal force, pushes apart")


class HuntCrossley(ContactLaw):
    """f = k p^n (1 + 3/2 a v) (Hunt and Crossley 1975): no jump where contact begins, elastic for a = 0.

    What hits with v_0 leaves with e v_0, log((1 + x) / (1 - e x)) = (1 + e) x, x = 3/2 a v_0, whatever k, n and masses are.
    """

    k = Parameter(1e8, min=0.0, description="stiffness, N/m^n; of spheres 4/3 E* sqrt(R) (Hertz)")
    n = Parameter(1.5, unit="1", min=1.0, description="exponent, 1.5 of spheres, 1 of flat punches")
    a = Parameter(0.0, unit="s/m", min=0.0, description="dissipation, slope of the loss 1 - e over the speed")

    def equations(self):
        # p^n, which goes on smoothly where integrators look beyond the end of the contact
        spring = self.k * self.p * (self.p**2 + 1e-300) ** ((self.n - 1) / 2)
        # the bracket is below zero where something pulls the bodies apart
        yield self.f == if_else(self.p > 0, fmax(spring * (1 + 1.5 * self.a * self.v), 0), 0)


class LinearContact(ContactLaw):
    """A spring beside a damper (Kelvin-Voigt), cut where they would pull; the damper's force begins with a jump."""

    c = Parameter(1e6, unit="N/m", min=0.0, description="stiffness")
    d = Parameter(0.0, unit="N.s/m", min=0.0, description="damping")

    def equations(self):
        yield self.f == if_else(self.p > 0, fmax(self.c * self.p + self.d * self.v, 0), 0)


class SurfaceContact(TwoFrames):
    """A sphere about the origin of frame_b, or that point itself, on a plane through the origin of frame_a.

    Normal force after `law`, Coulomb friction against the slip, mu f slip / sqrt(slip^2 + v_s^2), both at the foot of the
    normal from the centre on the plane; with `point=True` at frame_b itself, which then need not have an orientation, as
    that of a PointMass. On the far side of the plane all is solid.
    """

    point = False
    n = Parameter([0.0, 0.0, 1.0], unit="1", description="outward normal, resolved in frame_a", evaluate=True)
    radius = Parameter(0.0, unit="m", min=0.0, description="radius of the sphere; zero for a point")
    mu = Parameter(0.0, unit="1", min=0.0, description="coefficient of friction")
    v_s = Parameter(1e-3, unit="m/s", min=0.0, description="smoothing speed of the friction")
    slip = Real(3, unit="m/s", description="speed of the sphere along the plane, resolved in the world")
    f = Real(3, unit="N", description="force on the sphere, resolved in the world")
    law = HuntCrossley()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        n, gap = a.R @ unit(self.n), b.r - a.r
        height = dot(n, gap)
        rate = der(gap) - cross(a.w, gap)
        lever = 0 * n if self.point else -height * n  # from frame_b to where the force acts
        speed = der(gap) - cross(a.w, gap + lever)
        if not self.point:
            speed += cross(b.w, lever)
        yield require(norm_2(self.n) > 0, "expected a normal that is not zero")
        yield require(self.v_s > 0, "expected a smoothing speed above zero")
        yield self.law.p == self.radius - height
        yield self.law.v == -dot(n, rate)
        yield self.slip == speed - dot(n, speed) * n
        yield self.f == self.law.f * n + friction(self.mu * self.law.f, self.slip, self.v_s)
        yield b.f == -self.f
        yield b.t == -cross(lever, self.f)
        yield a.f + b.f == 0
        yield a.t + b.t + cross(gap, b.f) == 0


class Face(NamedTuple):
    """Depth below a face, m; how it grows less with the motion of the point, (3,); the length of that."""

    depth: Any
    out: Any
    size: Any = 1.0


class PegContact(TwoFrames):
    """A round peg in a round hole: the rim of its tip, and its shaft on the edge of the hole.

    frame_a is the hole: origin in the middle of its mouth, z out of it. frame_b is the peg: origin in the middle of its
    tip, z from there along its axis, tilted by less than 80 degrees. Aligned, the axes may be apart by the clearance. The
    rim meets the plane around the hole, a chamfer of 45 degrees, the wall and the floor; the edge below the chamfer meets
    the shaft. Where several faces are met at once the nearest pushes: forces have an energy. They act on the axis of the
    peg, friction at its surface.
    """

    radius = Parameter(0.005, unit="m", min=0.0, description="radius of the peg")
    clearance = Parameter(1e-4, unit="m", min=0.0, description="radius of the hole less that of the peg")
    chamfer = Parameter(0.0, unit="m", min=0.0, description="width and depth of the chamfer")
    depth = Parameter(0.03, unit="m", min=0.0, description="depth of the hole")
    mu = Parameter(0.0, unit="1", min=0.0, description="coefficient of friction")
    v_s = Parameter(1e-3, unit="m/s", min=0.0, description="smoothing speed of the friction")
    r = Real(3, unit="m", description="middle of the tip, resolved in frame_a")
    tilt = Real(2, unit="1", description="x and y of the peg's axis in frame_a, sines of its tilt")
    f = Real(3, unit="N", description="force on the peg, resolved in frame_a")
    t = Real(3, unit="N.m", description="torque on the peg about the middle of its tip, in frame_a")
    rim = HuntCrossley()
    edge = HuntCrossley()
    floor = HuntCrossley()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        gap, z = b.r - a.r, ca.SX([0, 0, 1])
        v, w = a.R.T @ (der(gap) - cross(a.w, gap)), a.R.T @ (b.w - a.w)
        r, axis = self.r, a.R.T @ b.R[:, 2]
        yield require(self.clearance > 0, "expected a clearance above zero")
        yield require(self.v_s > 0, "expected a smoothing speed above zero")
        yield require(self.depth > self.chamfer, "expected a hole deeper than its chamfer")
        yield r == a.R.T @ gap
        yield self.tilt == axis[:2]

        along, beside, apart = -r[2], *self._sideways(r)
        rim = nearest(
            Face(along, z),
            Face(apart, -beside),
            Face((apart + along - self.chamfer) / sqrt(2), (z - beside) / sqrt(2)),
        )
        # where the axis passes the edge, and how that point moves when the peg does
        height = fmax(axis[2], 0.1)
        reach = (-self.chamfer - r[2]) / height
        passing, overlap = self._sideways(r + reach * axis)
        lean = dot(passing, axis) / height
        edge = nearest(
            Face(reach, z / height, 1 / height), Face(overlap, lean * z - passing, sqrt(1 + lean**2))
        )
        floor = Face(-self.depth - r[2], z)
        forces, torques = [], []
        for law, face, lever, outside in (
            (self.rim, rim, 0 * z, self.radius * beside),
            (self.edge, edge, reach * axis, self.radius * passing),
            (self.floor, floor, 0 * z, 0 * z),
        ):
            load, out = law.f * face.size, face.out / face.size
            speed = v + cross(w, lever + outside)
            slowing = friction(self.mu * load, speed - dot(out, speed) * out, self.v_s)
            yield law.p == face.depth
            yield law.v == -dot(face.out, v + cross(w, lever))
            forces += [load * out, slowing]
            torques += [cross(lever, load * out), cross(lever + outside, slowing)]
        yield self.f == sum(forces)
        yield self.t == sum(torques)
        yield b.f == -(a.R @ self.f)
        yield b.t == -(a.R @ self.t)
        yield a.f + b.f == 0
        yield a.t + b.t + cross(gap, b.f) == 0

    def _sideways(self, point: Any) -> tuple[Any, Any]:
        """Direction from the axis of the hole to a point, of length one where they touch, and how deep it is in the wall."""
        aside = ca.vertcat(point[0], point[1], 0)
        distance = sqrt(fmax(dot(aside, aside), self.clearance**2))
        return aside / distance, distance - self.clearance


def nearest(first: Face, *others: Face) -> Face:
    """The face below which a point is the least."""
    found = first
    for face in others:
        less = face.depth < found.depth
        found = Face(*(if_else(less, new, old) for new, old in zip(face, found, strict=True)))
    return found


def friction(limit: Any, slip: Any, v_s: Any) -> Any:
    """Coulomb friction up to a limit against a slip (3,), smoothed below the speed v_s."""
    return -limit * slip / sqrt(dot(slip, slip) + v_s**2)
