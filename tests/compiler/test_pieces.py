"""Equations that switch on their own unknowns: everyday models on all routes, against solutions by hand."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    GantryTauError,
    Input,
    Model,
    Parameter,
    Real,
    check,
    der,
    fabs,
    fmax,
    fmin,
    if_else,
    translate,
)
from tests.independent_routes.routes import answers


def one(equation, start: float, first: float, **declared: Any) -> type[Model]:
    """A model of one unknown x with equation(x) == u."""

    class One(Model):
        u = Input(start=first)
        x = Real(start=start, **declared)

        def equations(self):
            yield equation(self.x) == self.u

    return One


class Loop(Model):
    """A controller with limits in an algebraic loop."""

    u = Input(start=0.5)
    e = Real()
    x = Real()

    def equations(self):
        yield self.e == self.u - self.x
        yield self.x == ca.fmin(ca.fmax(4 * self.e, -1), 1)


class Friction(Model):
    """Dry friction between two masses, acting against their relative acceleration; x is that of the first."""

    u = Input(start=5.0)
    x = Real()
    b = Real()
    f = Real()

    def equations(self):
        yield 2 * self.x == self.u - self.f
        yield 3 * self.b == self.f
        yield self.f == if_else(self.x > self.b, 1.0, -1.0)


class Rod(Model):
    """A massless rod with dry and viscous friction follows a force."""

    u = Input(start=5.0)
    x = Real(start=1.0, description="speed")
    s = Real(start=0.0, fixed=True)

    def equations(self):
        yield 2 * self.x + if_else(self.x > 0, 1.0, -1.0) == self.u
        yield der(self.s) == self.x


class Diode(Model):
    """A diode by its parameter s, and a resistor."""

    u = Input(start=1.0)
    s = Real(start=1.0)
    v = Real()
    x = Real(start=0.5, description="current")

    def equations(self):
        yield self.v == if_else(self.s > 0, 0.0, self.s)
        yield self.x == if_else(self.s > 0, self.s, 0.0)
        yield self.u - self.v == 2 * self.x


class Bridge(Model):
    """Four diodes feed a resistor from a source of either sign; leakage keeps potentials determined."""

    R = Parameter(10.0)
    u = Input(start=1.0)
    s = Real(4, start=[1.0, -1.0, -1.0, 1.0])
    a = Real()
    p = Real()
    n = Real()
    x = Real(description="voltage at the resistor")

    def equations(self):
        on, off = 1e-3, 1e-6  # V per A, A per V
        v = [if_else(self.s[k] > 0, on * self.s[k], self.s[k]) for k in range(4)]
        i = [if_else(self.s[k] > 0, self.s[k], off * self.s[k]) for k in range(4)]
        yield self.u + self.a - self.p == v[0]
        yield self.n - (self.u + self.a) == v[1]
        yield self.a - self.p == v[2]
        yield self.n - self.a == v[3]
        yield i[0] + i[2] == self.x / self.R
        yield i[1] + i[3] == self.x / self.R
        yield self.x == self.p - self.n
        yield self.a == 0


class Springs(Model):
    """Two springs in series, one with a dead zone, one that gets stiffer; x is the place between them."""

    u = Input(start=0.5)
    x = Real()

    def equations(self):
        d = self.u - self.x
        slack = if_else(d > 1, d - 1, if_else(d < -1, d + 1, 0))
        yield 10 * slack == 4 * self.x + 6 * ca.fmax(self.x - 1, 0)


def bridge(u: float) -> float:
    on, off, R = 1e-3, 1e-6, 10.0
    # two conduct, two block: nodes p and n by their balances
    g, h = 1 / on, off
    matrix = np.array([[g + h + 1 / R, -1 / R], [-1 / R, g + h + 1 / R]])
    p, n = np.linalg.solve(matrix, [g * max(u, 0) + h * min(u, 0), h * max(u, 0) + g * min(u, 0)])
    return float(p - n)


def springs(u: float) -> float:
    found: list[float] = []
    for soft in (True, False):
        for side in (-1, 0, 1):
            k, shift = (4.0, 0.0) if soft else (10.0, 6.0)
            x = (10 * (u - side) + shift) / (10 + k) if side else shift / k
            d = u - x
            zone = d > 1 if side > 0 else d < -1 if side < 0 else abs(d) <= 1
            if zone and (x <= 1) == soft:
                found.append(x)
    assert len(found) == 1
    return found[0]


def root(a: float, b: float, c: float) -> float:
    return (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)


CASES = {
    "jump": (
        one(lambda x: x + if_else(x > 0, 1.0, -1.0), 1.0, 3.0),
        {3.0: 2.0, -3.0: -2.0, 0.5: None, 1.5: 0.5},
    ),
    "square and absolute": (one(lambda x: x**2 + fabs(x), 1.0, 2.0), {2.0: 1.0, 6.0: 2.0, -1.0: None}),
    "square and positive part": (one(lambda x: x**2 + ca.fmax(x, 0), 0.5, 2.0), {2.0: 1.0, 6.0: 2.0}),
    "sign": (one(lambda x: x + ca.sign(x), 1.0, 3.0), {3.0: 2.0, 0.0: 0.0, -3.0: -2.0, 0.5: None}),
    "floor": (one(lambda x: x + ca.floor(x), 1.5, 2.5), {2.5: 1.5, 4.2: 2.2, -7.75: -3.75, 3.5: None}),
    "slow steps": (one(lambda x: 4 * x + ca.ceil(x), 1.5, 8.0), {8.0: 1.5, 9.2: 1.8, -6.2: -1.3}),
    "stairs and a limit": (
        one(lambda x: x + 0.5 * ca.floor(x) + ca.fmin(x, 0), 0.5, 0.5),
        {0.5: 0.5, 1.9: 1.4, 1.25: None, -4.5: -1.75},
    ),
    "half absolute": (one(lambda x: x + 0.5 * fabs(x), 1.0, 3.0), {3.0: 2.0, -3.0: -6.0, 0.0: 0.0}),
    "limit": (one(lambda x: x + ca.fmin(x, 1), 1.0, 3.0), {3.0: 2.0, -3.0: -1.5, 2.0: 1.0}),
    "two slopes": (one(lambda x: if_else(x > 0, 2 * x, x), 1.0, 3.0), {3.0: 1.5, -3.0: -3.0}),
    "chain": (
        one(lambda x: x + ca.fmax(ca.fmin(2 * x, ca.fmax(x, 1)), -3), 0.1, 0.3),
        {0.3: 0.1, 1.75: 0.75, 4.0: 2.0, -3.0: -1.0, -5.0: -2.0},
    ),
    "through zero": (one(lambda x: x + 2 * x * fabs(x), 1.0, 3.0), {3.0: 1.0, -3.0: -1.0, 0.0: 0.0}),
    "small": (
        one(lambda x: x + 1e-9 * if_else(x > 0, 1.0, -1.0), 2e-9, 3e-9, nominal=1e-9),
        {3e-9: 2e-9, -3e-9: -2e-9},
    ),
    "controller": (Loop, {0.5: 0.4, 1.25: 1.0, 5.0: 1.0, -0.5: -0.4, -9.0: -1.0}),
    "friction": (Friction, {5.0: 2.0, -5.0: -2.0, 1.0: None}),
    "rod": (Rod, {5.0: 2.0, -5.0: -2.0, 0.5: None}),
    "diode": (Diode, {1.0: 0.5, -1.0: 0.0, 0.0: 0.0}),
    "bridge": (Bridge, {u: bridge(u) for u in (1.0, -1.0, 7.0, -3.0)}),
    "springs": (Springs, {u: springs(u) for u in (0.5, 0.999, 2.0, 30.0, -5.0)}),
}


@pytest.mark.parametrize("name", CASES)
def test_every_route_takes_the_piece_that_agrees_with_itself_or_refuses(name, tmp_path):
    model, expected = CASES[name]
    points = [{"u": np.array([u])} for u in expected]
    found = answers(translate(model()), points, ["x"], tmp_path)
    size = 1e-9 if name == "small" else 1.0
    gaps = None in expected.values() or name in ("small", "slow steps")  # through which no motion leads
    for route, values in found.items():
        for (u, x), value in zip(expected.items(), values, strict=True):
            if x is None or (route == "simulate" and gaps and isinstance(value, GantryTauError)):
                assert isinstance(value, GantryTauError), (route, u, value)
            else:
                assert value == pytest.approx(x, abs=1e-9 * size, rel=1e-9), (route, u)


def test_several_solutions_of_a_switch_are_told_by_name():
    class Backwards(Model):
        u = Input(start=0.2)
        x = Real(start=1.0)

        def equations(self):
            yield self.x - 2 * fmax(fmin(self.x, 1), -1) == -self.u  # three branches between -1 and 1

    found = check(Backwards())
    assert found.ambiguous == ("x (3)",)
    assert "several solutions at the start, of which the nearest is taken:\n    x (3)" in str(found)


def test_the_branch_of_the_start_goes_on_behind_a_kink(tmp_path):
    class Rising(Model):
        u = Input(start=0.0)
        x = Real(start=1.0)

        def equations(self):
            yield self.x**2 + self.x + fmax(self.x, 0) + fmin(self.x, 3) == self.u

    expected = [np.sqrt(u - 2) - 1 for u in (20.0, 40.0)]  # beyond 3, x^2 + 2 x + 3 = u
    for route, values in answers(
        translate(Rising()), [{"u": np.array([u])} for u in (20.0, 40.0)], ["x"], tmp_path
    ).items():
        assert values == [pytest.approx([x], rel=1e-9) for x in expected], route
