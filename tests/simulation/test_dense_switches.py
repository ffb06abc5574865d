"""Switches that turn often between two output points, against closed forms of their instants and integrals."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Mode,
    Model,
    Parameter,
    Real,
    der,
    if_else,
    pre,
    simulate,
    sin,
    terminate,
    time,
    transition,
    when,
)
from gantrytau.simulation.events.phases import phases
from tests.families import first_of

LOCATED = 1e-9  # s: ten times the tolerance of motions that are polynomials in time


class Encoder(Model):
    """A disc that turns once a second, whose light barrier rises where sin(lines phi) passes a half."""

    lines = Parameter(1000.0)
    most = Parameter(20.0)
    phi = Real(start=0.0, fixed=True)
    w = Real(start=2 * math.pi, fixed=True)
    n = Discrete(0)

    def equations(self):
        yield der(self.phi) == self.w
        yield der(self.w) == 0
        yield when(sin(self.lines * self.phi) > 0.5, self.n == pre(self.n) + 1)
        yield when(self.n >= self.most, terminate("enough"))


@pytest.mark.parametrize(
    ("lines", "points"),
    first_of([(1000, 2), (50, 501)] + [(n, p) for n in (50, 100, 200) for p in (2, 11)], 2),
)
def test_an_encoder_counts_each_line(lines, points):
    found = simulate(Encoder(lines=float(lines)), stop=10.0, points=points)
    assert found.final("n") == 20
    assert found.time[-1] == pytest.approx((19 + 1 / 12) / lines, abs=LOCATED)


@pytest.mark.nightly
@pytest.mark.parametrize("points", [2, 11, 501])
def test_an_encoder_counts_each_line_of_ten_turns(points):
    assert simulate(Encoder(lines=1000.0, most=1e9), stop=10.0, points=points).final("n") == 10_000


@pytest.mark.parametrize("stop", [1.0, pytest.param(5.0, marks=pytest.mark.nightly)])
def test_lines_are_counted_while_a_motor_speeds_up(stop):
    class Motor(Model):
        phi = Real(start=0.0, fixed=True)
        w = Real(start=0.0, fixed=True)
        n = Discrete(0)

        def equations(self):
            yield der(self.phi) == self.w
            yield der(self.w) == 10.0 - self.w
            yield when(sin(100 * self.phi) > 0.5, self.n == pre(self.n) + 1)

    turns = 100 * 10 * (stop - 1 + math.exp(-stop)) / (2 * math.pi)
    assert simulate(Motor(), stop=stop, points=5).final("n") == math.floor(turns - 1 / 12) + 1


@pytest.mark.parametrize("points", first_of([2, 501]))
def test_lines_are_counted_there_and_back(points):
    class Swing(Model):
        phi = Real(start=0.0, fixed=True)
        w = Real(start=3.0, fixed=True)
        n = Discrete(0)

        def equations(self):
            yield der(self.phi) == self.w
            yield der(self.w) == -self.phi
            yield when(sin(40 * self.phi) > 0.3, self.n == pre(self.n) + 1)

    on = np.sin(40 * 3 * np.sin(np.linspace(0, 3, 300_001))) > 0.3
    expected = np.sum(on[1:] & ~on[:-1])
    assert simulate(Swing(), stop=3.0, points=points).final("n") == expected


@pytest.mark.parametrize("stop", [1.0, 1000.0])
def test_a_sine_of_time_is_found_whatever_the_length_of_the_run(stop):
    class Carrier(Model):
        n = Discrete(0)
        y = Real(start=0.0, fixed=True)

        def equations(self):
            on = sin(2 * math.pi * 1000 * time) > 0.5
            yield der(self.y) == if_else(on, 1.0, 0.0)
            yield when(on, self.n == pre(self.n) + 1)
            yield when(self.n >= 11, terminate("enough"))

    found = simulate(Carrier(), stop=stop)
    assert found.time[-1] == pytest.approx((10 + 1 / 12) / 1000, abs=1e-12)
    assert found.final("y") == pytest.approx(10 / 3000, abs=1e-12)  # on for a third of each period


def test_a_sine_that_gets_faster_with_time():
    class Chirp(Model):
        a = Parameter(100.0, unit="1/s2")
        n = Discrete(0)

        def equations(self):
            yield when(sin(self.a * time**2) > 0.9, self.n == pre(self.n) + 1)

    turns = (100 * 2.0**2 - math.asin(0.9)) / (2 * math.pi)
    assert simulate(Chirp(), stop=2.0).final("n") == math.floor(turns) + 1


def test_what_a_dense_switch_drives_is_integrated():
    class Detent(Model):
        x = Real(start=0.0, fixed=True)
        y = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == 1
            yield der(self.y) == if_else(sin(500 * self.x) > 0.5, 1, 0)
            yield when(self.x >= 50 * 2 * math.pi / 500, terminate("fifty periods"))

    found = simulate(Detent(), stop=100.0, points=2)
    assert found.final("y") == pytest.approx(50 * 2 * math.pi / 500 / 3, abs=50 * LOCATED)


@pytest.mark.nightly
def test_guards_of_transitions_are_found():
    class Gate(Model):
        x = Real(start=0.0, fixed=True)
        n = Discrete(0)
        mode = Mode("closed", "opened")

        def equations(self) -> Any:
            yield der(self.x) == 1
            yield transition(
                self.mode, "closed", "opened", sin(300 * self.x) > 0.5, self.n == pre(self.n) + 1
            )
            yield transition(self.mode, "opened", "closed", sin(300 * self.x) < -0.5)

    turns = 300 * 10 / (2 * math.pi) - 1 / 12
    assert simulate(Gate(), stop=10.0).final("n") == math.floor(turns) + 1


@pytest.mark.parametrize("stop", [2.0, 200.0])
def test_a_polynomial_that_turns_often(stop):
    """T_40 passes a half upwards 20 times between -1 and 1: nothing in it is periodic."""

    class Chebyshev(Model):
        x = Real(start=-1.0, fixed=True)
        n = Discrete(0)

        def equations(self):
            last, here = ca.SX(1), self.x
            for _ in range(39):
                last, here = here, 2 * self.x * here - last
            yield der(self.x) == 1
            yield when(here > 0.5, self.n == pre(self.n) + 1)
            yield when(self.x > 1.0, terminate("the end"))

    assert simulate(Chebyshev(), stop=stop, points=2).final("n") == 20


def test_phases_are_the_moving_arguments_of_periodic_functions():
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    found = phases(ca.sin(3 * x) * ca.exp(ca.cos(p)) + ca.tan(x**2) + ca.sin(3 * x) + x, x)
    at = ca.Function("at", [x, p], [found])(0.5, 0.7)
    np.testing.assert_allclose(np.sort(np.array(at).ravel()), [0.5, 1.5])  # tan has half the period
    assert phases(x**3, x).shape == (0, 1)
