"""Contact of a slender peg, which bends, with a hole: at the tip, at the edge of the hole, or at both.

The peg is a beam that is clamped at its far end, and has no mass: where it touches, it is in equilibrium. The forces of
both places make the least energy of beam and faces, which is one point; it is found by 16 steps of a bracketed Newton
iteration, from the pose alone, without a memory.
"""

from typing import Any, NamedTuple

import casadi as ca

from gantrytau import Parameter, Real, cross, der, dot, fmax, if_else, norm_2, require, sqrt
from gantrytau.mechanics.multibody.contact import friction
from gantrytau.mechanics.multibody.frames import TwoFrames

STEPS = 16  # with random poses 10 end at rounding, 16 where the clearance is 1e-6 of the rest


class Compliance(NamedTuple):
    """Deflections per force, m/N: at the tip, at the edge by a force there, and of each by the other's force."""

    tip: Any
    edge: Any
    mixed: Any


class ElasticPegContact(TwoFrames):
    """A slender round peg, clamped at one end, in a round hole or on the block around it.

    frame_a is the hole: origin in the middle of its mouth, z out of it. frame_b is the peg as it is where nothing
    touches it: origin in the middle of its tip, z from there along its axis to the clamp. Walls push across the hole,
    at the tip and where the shaft passes the mouth; block and floor push along it, at the tip. A tip below the mouth
    is where less energy holds it, in the hole or on the block. Bending is that of small tilts, right to the square
    of its sine; friction does not bend, and compression, buckling and the widths of the peg beside its clearance
    are left out. Forces have an energy but for friction, which is smoothed below `v_s`.
    """

    length = Parameter(0.095, unit="m", min=0.0, description="length of the peg from clamp to tip")
    bending = Parameter(
        236.0, unit="N/m", min=0.0, description="stiffness of the peg at its tip, 3 E I / length^3"
    )
    wall = Parameter(5e3, unit="N/m", min=0.0, description="stiffness of walls, edge, block and floor")
    clearance = Parameter(3e-4, unit="m", min=0.0, description="radius of the hole less that of the peg")
    depth = Parameter(0.03, unit="m", min=0.0, description="depth of the hole")
    mu = Parameter(0.0, unit="1", min=0.0, description="coefficient of friction")
    v_s = Parameter(1e-3, unit="m/s", min=0.0, description="smoothing speed of the friction")
    r = Real(3, unit="m", description="middle of the tip where nothing bends it, resolved in frame_a")
    tilt = Real(2, unit="1", description="x and y of the peg's axis in frame_a, sines of its tilt")
    inserted = Real(unit="m", description="length of the shaft in the hole, zero beside it")
    f_tip = Real(2, unit="N", description="force of the wall on the tip, x and y of frame_a")
    f_edge = Real(2, unit="N", description="force of the edge on the shaft, x and y of frame_a")
    f_end = Real(unit="N", description="force of block or floor on the tip, along the hole")
    f = Real(3, unit="N", description="force on the peg, resolved in frame_a")
    t = Real(3, unit="N.m", description="torque on the peg about the origin of frame_b, in frame_a")

    def equations(self):
        a, b = self.frame_a, self.frame_b
        gap, r, z = b.r - a.r, self.r, ca.SX([0, 0, 1])
        axis = a.R.T @ b.R[:, 2]
        yield require(self.clearance > 0, "expected a clearance above zero")
        yield require(self.bending > 0, "expected a stiffness above zero")
        yield require(self.wall > 0, "expected a stiffness above zero")
        yield require(self.v_s > 0, "expected a smoothing speed above zero")
        yield require(self.depth < self.length, "expected a hole that is less deep than the peg is long")
        yield r == a.R.T @ gap
        yield self.tilt == axis[:2]

        height = fmax(axis[2], 0.1)
        along = 1 / self.wall + (1 - axis[2] ** 2) / self.bending  # a tilted peg bends when it is pushed
        beside = fmax(norm_2(r[:2]) - self.clearance, 0)
        below = if_else(r[2] < 0, -r[2], 0)
        inside = beside**2 * along <= below**2 * (1 / self.bending + 1 / self.wall)
        share = fmax(1 - below / (height * self.length), 0)  # of the shaft that is outside
        yield self.inserted == if_else(inside, below / height, 0)
        compliance = Compliance(
            1 / self.bending + 1 / self.wall,
            share**3 / self.bending + 1 / self.wall,
            share**2 * (3 - share) / (2 * self.bending),
        )
        tip, edge = two_points(r[:2], r[:2] + self.inserted * axis[:2], compliance, self.clearance)
        yield self.f_tip == if_else(inside, tip, 0)
        yield self.f_edge == if_else(inside, edge, 0)
        pressed = fmax(if_else(inside, below - self.depth, below), 0)
        yield self.f_end == pressed / along

        # the energy grows with the length inserted: the edge pushes across the shaft as that is bent there
        bent = dot(self.f_edge, self.f_edge) * share**2 + dot(self.f_tip, self.f_edge) * share * (2 - share)
        lean = 1.5 * bent / (self.bending * self.length) - dot(self.f_edge, axis[:2])
        aside = self.f_end / self.bending * (z - axis[2] * axis)  # of the tip, where it is pressed
        v, w = a.R.T @ (der(gap) - cross(a.w, gap)), a.R.T @ (b.w - a.w)
        places = (
            (0 * r, ca.vertcat(self.f_tip, 0)),
            (self.inserted * axis, ca.vertcat(self.f_edge, lean / height)),
            (aside, self.f_end * z),
        )
        loads = [(lever, rubbed(push, v + cross(w, lever), self.mu, self.v_s)) for lever, push in places]
        yield self.f == sum(force for _, force in loads)
        yield self.t == sum(cross(lever, force) for lever, force in loads)
        yield b.f == -(a.R @ self.f)
        yield b.t == -(a.R @ self.t)
        yield a.f + b.f == 0
        yield a.t + b.t + cross(gap, b.f) == 0


def rubbed(push: Any, v: Any, mu: Any, v_s: Any) -> Any:
    """A force (3,) of a face and its friction against the speed v (3,) along that face."""
    square = dot(push, push)
    load = if_else(square > 0, sqrt(square), 0, smooth=True)
    out = push / if_else(square > 0, load, 1, smooth=True)
    return push + friction(mu * load, v - dot(out, v) * out, v_s)


def two_points(tip: Any, edge: Any, compliance: Compliance, clearance: Any) -> tuple[Any, Any]:
    """Forces (2,) in N of a round hole on a beam at two places, (2,) in m from its axis where nothing bends it.

    Forces f_1, f_2 along unit vectors -n_1, -n_2 leave both places in the hole, or just as deep in the wall as they push:
    p_1 + C_11 f_1 + C_12 f_2 = clearance n_1, the stiffness of the wall being part of C_11, and the same of the other.
    """
    c = compliance

    def alone(p: Any, soft: Any) -> Any:
        distance = norm_2(p)
        return if_else(distance > clearance, (clearance / distance - 1) / soft, 0) * p

    only_tip, only_edge = alone(tip, c.tip), alone(edge, c.edge)
    no_edge = norm_2(edge + c.mixed * only_tip) <= clearance
    no_tip = norm_2(tip + c.mixed * only_edge) <= clearance
    at_tip, at_edge = both_points(tip, edge, c, clearance)
    return (
        if_else(no_edge, only_tip, if_else(no_tip, 0, at_tip)),
        if_else(no_edge, 0, if_else(no_tip, only_edge, at_edge)),
    )


def both_points(tip: Any, edge: Any, compliance: Compliance, clearance: Any) -> tuple[Any, Any]:
    """The same where both places touch: N_2 such that n_2, which N_1 and N_2 leave, has length one; N_1 is that with which
    n_1 has length one. D n_1 = (C_22 N_2 + c) p_1 - C_12 N_2 p_2, D n_2 = (C_11 N_1 + c) p_2 - C_12 N_1 p_1.
    """
    (a, g, b), c = compliance, clearance
    e = a * g - b**2
    low, high = 0 * c / a, (a * fmax(norm_2(edge) - c, 0) + b * norm_2(tip)) / e
    first, second = low, low
    for step in range(STEPS + 1):
        x, y = g * second + c, b * second
        n_1, q = x * tip - y * edge, e * second + c * a
        size = norm_2(n_1)
        touches = size > c * x
        first = if_else(touches, (size - c * x) / q, 0, smooth=True)
        if step == STEPS:
            break
        slope = if_else(
            touches, (dot(n_1, g * tip - b * edge) / (size + tiny(c)) - c * g - e * first) / q, 0, smooth=True
        )
        n_2 = (a * first + c) * edge - b * first * tip
        length = norm_2(n_2)
        rest = length - (q * first + c * x)
        rate = dot(n_2, a * edge - b * tip) / (length + tiny(c)) * slope - (e * first + q * slope + c * g)
        low = if_else(rest > 0, second, low, smooth=True)
        high = if_else(rest > 0, high, second, smooth=True)
        newton = second - rest / rate
        middle = (low + high) / 2
        second = if_else(
            newton >= low, if_else(newton <= high, newton, middle, smooth=True), middle, smooth=True
        )
    whole = (a * first + c) * (g * second + c) - b**2 * first * second
    return (
        -first * ((g * second + c) * tip - b * second * edge) / whole,
        -second * ((a * first + c) * edge - b * first * tip) / whole,
    )


def tiny(clearance: Any) -> Any:
    """A square of lengths that is nothing beside that of a clearance, and not zero."""
    return 1e-30 * clearance**2
