"""Rectifiers of leaking diodes: monotone networks, which have one solution, against Newton's method on their potentials."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gantrytau import Array, Fixed, Model, Parameter, connect, if_else, simulate, sin
from gantrytau.electrical import Capacitor, Ground, Resistor, TwoPins, VoltageSource
from tests.families import first_of
from tests.mechanisms.rows import row

ON = 100.0  # S
V = 10.0


class Diode(TwoPins):
    on = Parameter(ON, unit="S", description="conductance")
    off = Parameter(1e-6, unit="S", description="leakage")

    def equations(self):
        yield from super().equations()
        yield self.i == if_else(self.v > 0, self.on * self.v, self.off * self.v)


class Rectifier(Model):
    """As many phases in a star as there are sources, each behind 1 Ohm, with two diodes each, on a load of 100 Ohm."""

    phases = 3
    s, r, D = Array(VoltageSource, 3), Array(Resistor, 3), Array(Diode, 6)
    load, ground = Resistor(R=100.0), Ground()

    def equations(self):
        plus, minus = self.load.pin_a, self.load.pin_b
        yield connect(minus, self.ground.pin)
        for k in range(self.phases):
            if k:
                yield connect(self.s[k].pin_b, self.s[0].pin_b)
            yield from row(self.s[k].pin_a, self.r[k], self.D[k], plus)
            yield from row(minus, self.D[self.phases + k], self.r[k].pin_b)


class Smoothed(Rectifier):
    """Two phases, as a bridge of four diodes, and a capacitor."""

    phases = 2
    s, r, D = Array(VoltageSource, 2), Array(Resistor, 2), Array(Diode, 4)
    C = Capacitor(C=1e-4, v=Fixed(0.0))

    def equations(self):
        yield from super().equations()
        yield connect(self.C.pin_a, self.load.pin_a)
        yield connect(self.C.pin_b, self.load.pin_b)


def potentials(e: np.ndarray, off: float, plus: float | None) -> tuple[float, float]:
    """The potential of plus, unless it is given, and the current into it, for the voltages of the phases."""
    n = e.size
    q = np.zeros(n + 2)  # behind the resistors, of the star point, of plus
    for _ in range(100):
        u, star, p = q[:n], q[n], q[n + 1] if plus is None else plus
        up, down = u - p, -u
        g, h = np.where(up > 0, ON, off), np.where(down > 0, ON, off)
        i = star + e - u
        rest = np.concatenate(
            [i + h * down - g * up, [-i.sum(), (g * up).sum() - p / 100 if plus is None else 0.0]]
        )
        slopes = np.zeros((n + 2, n + 2))
        slopes[:n, :n], slopes[:n, n], slopes[n, :n], slopes[n, n] = -np.diag(1 + g + h), 1.0, 1.0, -n
        slopes[n + 1, n + 1] = 1.0
        if plus is None:
            slopes[:n, n + 1], slopes[n + 1, :n], slopes[n + 1, n + 1] = g, g, -g.sum() - 1 / 100
        step = np.linalg.solve(slopes, rest)
        q = q - step
        if np.abs(step).max() < 1e-12 * V:
            return float(p), float((g * up).sum())
    raise AssertionError("Newton's method does not settle")


def phases(t: float, n: int, lead: float) -> np.ndarray:
    return V * np.sin(2 * math.pi * (50 * t - np.arange(n) / n) + lead)


def inputs(n: int, lead: float) -> dict:
    return {f"s[{k}].v": lambda t, k=k: V * sin(2 * math.pi * (50 * t - k / n) + lead) for k in range(n)}


@pytest.mark.parametrize("off", first_of([1e-9, 1e-6]))
def test_a_bridge_charges_its_capacitor(off):
    leaks = {f"D[{k}].off": off for k in range(4)}
    found = simulate(Smoothed(), stop=0.012, points=101, parameters=leaks, inputs=inputs(2, 0.0)).final("C.v")

    def charged(t, v):
        _, current = potentials(phases(t, 2, 0.0), off, v[0])
        return [(current - v[0] / 100) / 1e-4]

    exact = solve_ivp(charged, (0, 0.012), [0.0], rtol=1e-9, atol=1e-10, max_step=1e-4).y[0, -1]
    assert abs(found - exact) < 1e-6 * V


@pytest.mark.parametrize("lead", first_of([math.pi / 2, 0.0]))
def test_six_diodes_on_three_phases_take_turns(lead):
    """From t = 0, where all potentials are differences of larger ones, through a first commutation; seconds, as what turns
    by time is searched on each side of it.
    """
    stop = 1e-4
    leaks = {f"D[{k}].off": 1e-9 for k in range(6)}
    found = simulate(Rectifier(), stop=stop, points=11, parameters=leaks, inputs=inputs(3, lead))
    for t in (0.0, stop / 2, stop):
        exact, _ = potentials(phases(t, 3, lead), 1e-9, None)
        assert abs(float(found.at(t, "load.v")) - exact) < 1e-8 * V
