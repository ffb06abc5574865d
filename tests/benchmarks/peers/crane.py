"""A crane with a hoist whose two forces change at a limited rate: from components, and by hand.

m_trolley s'' = f + h sin(phi)                            trolley, pulled by its motor and by the rope
m (l'' - l phi'^2 + s'' sin(phi) - g cos(phi)) = -h       load along the rope
l phi'' + 2 l' phi' + s'' cos(phi) + g sin(phi) = 0       load across it
"""

import casadi as ca
import numpy as np

from gantrytau import Input, Model, Parameter, Real, between, cos, der, sin
from gantrytau_optimica import Free, Optimization, final, initial
from tests.benchmarks.gta import trapezoid
from tests.benchmarks.peers.written import Columns, Motion

TROLLEY, LOAD, G = 200.0, 120.0, 9.81  # kg, kg, m/s2
FORCE, HOIST, RATE = 600.0, 2000.0, 800.0  # N, N, N/s
NEWTON = 1000.0  # forces by hand are written in kN
START, END = (0.0, 4.0), (6.0, 2.5)  # m, place of the trolley and length of the rope


class HoistCrane(Model):
    """A trolley on a straight rail, a load on a rope that the hoist shortens."""

    s = Real(unit="m", start=START[0], description="place of the trolley")
    v = Real(unit="m/s", description="its speed")
    length = Real(unit="m", start=START[1], description="length of the rope")
    rate = Real(unit="m/s", description="rate of the length")
    phi = Real(unit="rad", description="angle of the rope, 0 straight down")
    w = Real(unit="rad/s", description="angular velocity of the rope")
    f = Input(unit="N", min=-FORCE, max=FORCE, description="force on the trolley")
    h = Input(unit="N", min=0.0, max=HOIST, start=LOAD * G, description="force in the rope")
    trolley = Parameter(TROLLEY, unit="kg", description="mass of the trolley")
    load = Parameter(LOAD, unit="kg", description="mass of the load")
    g = Parameter(G, unit="m/s2", description="acceleration of gravity")

    def equations(self):
        s, c = sin(self.phi), cos(self.phi)
        yield der(self.s) == self.v
        yield der(self.length) == self.rate
        yield der(self.phi) == self.w
        yield self.trolley * der(self.v) == self.f + self.h * s
        along = der(self.rate) - self.length * self.w**2 + der(self.v) * s - self.g * c
        yield self.load * along == -self.h
        yield self.length * der(self.w) + 2 * self.rate * self.w + der(self.v) * c + self.g * s == 0


class CraneMotion(Optimization):
    """From rest to rest, the load hanging still, as fast as forces and their rates allow."""

    crane = HoistCrane()
    final_time = Free(8.0, unit="s", min=1.0, max=30.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        crane = self.crane
        for at, (s, length) in ((initial, START), (final, END)):
            yield at(crane.s) == s
            yield at(crane.length) == length
            for still in (crane.v, crane.rate, crane.phi, crane.w, crane.f):
                yield at(still) == 0
            yield at(crane.h) == LOAD * G
        for force in (crane.f, crane.h):
            yield between(-RATE, der(force), RATE)


def motion() -> Motion:
    """By hand: the forces are states, their rates are chosen; both in the unit of NEWTON."""
    x, u = ca.SX.sym("x", 8), ca.SX.sym("u", 2)
    _, v, length, rate, phi, w, *forces = ca.vertsplit(x)
    f, h = (NEWTON * force for force in forces)
    a = (f + h * ca.sin(phi)) / TROLLEY
    along = length * w**2 + G * ca.cos(phi) - a * ca.sin(phi) - h / LOAD
    across = -(a * ca.cos(phi) + G * ca.sin(phi) + 2 * rate * w) / length

    hanging = LOAD * G / NEWTON

    def guess(shares: np.ndarray) -> Columns:
        position, speed, _ = trapezoid(shares)
        states = np.zeros((8, shares.size))
        for row, first, last in zip((0, 2), START, END, strict=True):
            states[row] = first + (last - first) * position
            states[row + 1] = (last - first) * speed / 8.0
        states[7] = hanging
        return states, np.zeros((0, shares.size)), np.zeros((2, shares.size))

    upper = np.array([*(np.inf,) * 6, *(np.array([FORCE, HOIST, RATE, RATE]) / NEWTON)])
    lower = np.array([*(-np.inf,) * 6, *(np.array([-FORCE, 0.0, -RATE, -RATE]) / NEWTON)])
    return Motion(
        x=x, z=ca.SX(0, 1), u=u,
        ode=ca.vertcat(v, a, rate, along, w, across, u), residual=ca.SX(0, 1), path=ca.SX(0, 1), path_limits=(0.0, 0.0),
        limits=(lower, upper), start=np.array([START[0], 0, START[1], 0, 0, 0, 0, hanging]),
        end=np.array([END[0], 0, END[1], 0, 0, 0, 0, hanging]),
        guess=guess, guessed_time=8.0, times=(1.0, 30.0), ramps=True,
    )  # fmt: skip
