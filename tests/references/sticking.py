"""Stick-slip motions pieced together from solutions of the linear equations, and the models they are of."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from gantrytau import Array, Fixed, Model, Parameter, Real, connect, der, sin, stick_slip, time
from gantrytau.mechanics import translational
from gantrytau.mechanics.translational import StickSlipFriction

M, C, COULOMB, BREAKAWAY = 2.0, 800.0, 6.0, 9.0


class OnSpring(Model):
    """A mass on a spring and on a floor, let go at 0.05 m."""

    mass = translational.Mass(m=M, s=Fixed(0.05), v=Fixed(0.0))
    spring = translational.Spring(c=C)
    wall = translational.Fixed()
    floor = StickSlipFriction(f_c=COULOMB, f_s=BREAKAWAY)

    def equations(self):
        yield connect(self.mass.flange, self.spring.flange_b)
        yield connect(self.mass.flange, self.floor.flange)
        yield connect(self.wall.flange, self.spring.flange_a)


class Shaken(Model):
    """A mass on a floor, pushed to and fro."""

    amplitude = Parameter(10.0, unit="N", description="of the push")
    w = Parameter(8.0, unit="rad/s", description="angular frequency of the push")
    mass = translational.Mass(m=M, s=Fixed(0.0), v=Fixed(0.0))
    push = translational.Force()
    floor = StickSlipFriction(f_c=COULOMB, f_s=BREAKAWAY)

    def equations(self):
        yield connect(self.mass.flange, self.push.flange)
        yield connect(self.mass.flange, self.floor.flange)
        yield self.push.f == self.amplitude * sin(self.w * time)


class Chain(Model):
    """Three masses in a row on a floor, joined by springs, the first pushed to and fro."""

    amplitude = Parameter(20.0, unit="N", description="of the push")
    masses = Array(translational.Mass, 3, m=1.0)
    floors = Array(
        StickSlipFriction, [dict(f_c=3.0, f_s=4.0), dict(f_c=2.0, f_s=5.0), dict(f_c=1.0, f_s=1.5)]
    )
    springs = Array(translational.Spring, 2, c=200.0)
    push = translational.Force()

    def equations(self):
        for mass, floor in zip(self.masses, self.floors, strict=True):
            yield connect(mass.flange, floor.flange)
        for k in range(2):
            yield connect(self.masses[k].flange, self.springs[k].flange_a)
            yield connect(self.springs[k].flange_b, self.masses[k + 1].flange)
        yield connect(self.push.flange, self.masses[0].flange)
        yield self.push.f == self.amplitude * sin(9 * time)


class Plank(Model):
    """A block on a plank on a floor: two frictions, one of them of a speed against a speed."""

    m = Parameter(1.0, unit="kg", description="mass of the plank")
    n = Parameter(3.0, unit="kg", description="mass of the block")
    x = Real(unit="m", description="position of the plank", start=0.0, fixed=True)
    y = Real(unit="m", description="position of the block", start=0.0, fixed=True)
    v_x = Real(unit="m/s", description="speed of the plank", start=0.0, fixed=True)
    v_y = Real(unit="m/s", description="speed of the block", start=2.0, fixed=True)
    slip = Real(unit="m/s", description="speed of the block on the plank")
    above = Real(unit="N", description="friction between the two")
    below = Real(unit="N", description="friction on the floor")

    def equations(self):
        yield self.v_x == der(self.x)
        yield self.v_y == der(self.y)
        yield self.slip == self.v_y - self.v_x
        yield self.m * der(self.v_x) == self.above - self.below
        yield self.n * der(self.v_y) == -self.above
        yield stick_slip(self.above, self.slip, coulomb=4.0, smooth=0.0, breakaway=5.0)
        yield stick_slip(self.below, self.v_x, coulomb=1.0, smooth=0.0, breakaway=3.0)


def on_spring(t: np.ndarray) -> np.ndarray:
    """Half a period takes twice the friction over the stiffness off the amplitude, until the spring cannot pull it loose."""
    turns, sign, half = [0.05], 1, np.pi / np.sqrt(C / M)
    while C * abs(turns[-1]) > BREAKAWAY:
        turns.append(2 * sign * COULOMB / C - turns[-1])
        sign = -sign
    found = np.full(t.shape, turns[-1])
    for k, turn in enumerate(turns[:-1]):
        inside = (t >= k * half) & (t < (k + 1) * half)
        centre = (-1) ** k * COULOMB / C
        found[inside] = centre + (turn - centre) * np.cos(np.pi * (t[inside] / half - k))
    return found


def shaken(t: np.ndarray, amplitude: float = 10.0, w: float = 8.0) -> np.ndarray:
    """Sticks until the push breaks away, slides until the speed is zero, and so on to the other side."""
    away, half = np.arcsin(BREAKAWAY / amplitude) / w, np.pi / w

    def speed(now):
        return (amplitude / w * (np.cos(w * away) - np.cos(w * now)) - COULOMB * (now - away)) / M

    def way(now):
        gone = now - away
        swing = (np.sin(w * now) - np.sin(w * away)) / w
        return (amplitude / w * (np.cos(w * away) * gone - swing) - COULOMB * gone**2 / 2) / M

    rest: Any = brentq(speed, half / 2, half + away, xtol=1e-15)
    assert rest < half + away  # it rests before it is pushed back
    side, found, start = 1, np.zeros(t.shape), 0.0
    for k in range(int(t[-1] / half) + 1):
        gone = np.clip(t - k * half, away, rest)
        found = np.where(t >= k * half + away, start + side * way(gone), found)
        start, side = start + side * way(rest), -side
    return found
