"""Whens in a simulation: against exact solutions, whatever output points are asked for."""

import math

import numpy as np
import pytest

from gantrytau import (
    Array,
    Discrete,
    Fixed,
    Model,
    Parameter,
    Real,
    SolveError,
    der,
    fmax,
    if_else,
    logic_and,
    logic_or,
    pre,
    reinit,
    simulate,
    sqrt,
    terminate,
    time,
    when,
)
from tests.simulation.balls import Ball, G

POINTS = (2, 3, 501)


def jumps(result) -> np.ndarray:
    """The first of two places at one time."""
    return np.flatnonzero(np.diff(result.time) == 0)


@pytest.mark.parametrize("points", POINTS)
def test_a_ball_bounces_as_it_must(points):
    found = simulate(Ball(), stop=3.0, points=points, tolerance=1e-11)
    fall, left = math.sqrt(2 / G), jumps(found)
    exact = fall + 2 * fall * np.cumsum(0.8 ** np.arange(left.size)) - 2 * fall
    np.testing.assert_allclose(found.time[left], exact, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found["v"][left + 1], -0.8 * found["v"][left], rtol=1e-15)
    np.testing.assert_array_equal(found["bounces"][left + 1], 1 + np.arange(left.size))
    energy = found["v"] ** 2 / 2 + G * found["h"]
    parts = np.split(energy, left + 1)
    assert len(parts) == 7
    for k, part in enumerate(parts):
        np.testing.assert_allclose(part, G * 0.8 ** (2 * k), rtol=1e-9)
    assert found.time.size == points + 2 * left.size
    assert found.ended == "stop"


def test_the_order_is_kept_across_jumps():
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        found = simulate(Ball(), stop=2.0, points=2, tolerance=tolerance)
        errors.append(np.max(np.abs(found["v"][jumps(found)[:2]] + math.sqrt(2 * G) * 0.8 ** np.arange(2))))
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_ball_in_micro_and_mega_units(size):
    found = simulate(Ball(g=G * size, h=Fixed(size)), stop=2.0, points=3)
    left, fall = jumps(found), math.sqrt(2 / G)
    np.testing.assert_allclose(found.time[left], fall * np.array([1, 2.6, 3.88]), rtol=0, atol=1e-7)
    assert found.final("bounces") == 3


def test_bounces_that_accumulate_end_with_their_condition():
    with pytest.raises(SolveError) as error:
        simulate(Ball(), stop=6.0)
    text, found = str(error.value), error.value.result
    assert "the model (Ball), equation 3, when((h<=0)) becomes true again and again" in text
    assert "Zeno" in text
    assert error.value.time == pytest.approx(math.sqrt(2 / G) * 9, abs=1e-3)
    assert np.min(found["h"]) > -1e-12
    assert found.ended == text


def test_what_is_caught_and_thrown_again_does_not_accumulate():
    """A motion that begins at rest at its condition each time, and a condition that is one of a Discrete."""

    class Caught(Model):
        h = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)
        flying = Discrete(True)
        caught = Discrete(0)
        counted = Discrete(0)
        thrown = Discrete(1.0)

        def equations(self):
            yield der(self.h) == self.v
            yield der(self.v) == -2.5 * self.flying
            yield when(
                self.h <= 0,
                reinit(self.v, 0),
                reinit(self.h, 0),
                self.flying == 0,
                self.caught == pre(self.caught) + 1,
            ).elsewhen(
                time >= self.thrown, reinit(self.v, 1), self.flying == 1, self.thrown == pre(self.thrown) + 1
            )
            yield when(self.flying < 1, self.counted == pre(self.counted) + 1)

    found = simulate(Caught(), stop=10.9)
    assert found.final("caught") == found.final("counted") == 11
    np.testing.assert_allclose(
        found.time[jumps(found)], np.arange(0.8, 10.9, 0.2)[[k for k in range(51) if k % 5 < 2]], atol=1e-7
    )


def test_a_ball_that_comes_to_rest():
    class Resting(Ball):
        rests = Discrete(False)

        def equations(self):
            yield der(self.h) == self.v
            yield der(self.v) == if_else(self.rests, 0.0, -self.g)
            slow = self.v > -1e-3
            yield when(logic_and(self.h <= 0, slow), reinit(self.v, 0), self.rests == 1).elsewhen(
                self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.bounces == pre(self.bounces) + 1
            )

    found = simulate(Resting(), stop=6.0)
    n = math.ceil(math.log(1e-3 / math.sqrt(2 * G)) / math.log(0.8))
    assert found.final("bounces") == n
    assert abs(found.final("h")) < 1e-12
    assert found.final("v") == 0


@pytest.mark.parametrize("points", [2, 11, 37])
def test_a_tank_runs_empty(points):
    class Tank(Model):
        k = Parameter(0.5, description="outflow at a height of 1")
        h = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.h) == -self.k * sqrt(fmax(self.h, 0.0))
            yield when(self.h <= 0.01, terminate("the tank is empty"))

    found = simulate(Tank(), stop=10.0, points=points, tolerance=1e-10)
    assert found.ended == "the tank is empty"
    assert found.time[-1] == pytest.approx(2 * (1 - 0.1) / 0.5, abs=1e-8)
    assert found.final("h") == pytest.approx(0.01, abs=1e-13)
    assert simulate(Tank(), stop=3.0, points=points).ended == "stop"


def test_a_thermostat_has_its_period():
    class Thermostat(Model):
        T = Real(start=18.0, fixed=True)
        on = Discrete(True)

        def equations(self):
            yield der(self.T) == 0.1 * (10 + 20 * self.on - self.T)
            yield when(self.T > 22, self.on == 0).elsewhen(self.T < 20, self.on == 1)

    found = simulate(Thermostat(), stop=60.0, points=2, tolerance=1e-10)
    t = found.time[jumps(found)]
    assert t[0] == pytest.approx(10 * math.log(12 / 8), abs=1e-8)
    np.testing.assert_allclose(np.diff(t)[::2], 10 * math.log(12 / 10), atol=1e-8)  # cools
    np.testing.assert_allclose(np.diff(t)[1::2], 10 * math.log(10 / 8), atol=1e-8)  # heats


class Carts(Model):
    """Two carts on a rail that hit each other."""

    m = Parameter([1.0, 3.0])
    x = Real(2, start=[0.0, 1.0], fixed=True)
    v = Real(2, start=[1.0, -1.0], fixed=True)
    hits = Discrete(0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == 0
        v, m = pre(self.v), self.m
        common = (m[0] * v[0] + m[1] * v[1]) / (m[0] + m[1])
        yield when(self.x[0] >= self.x[1], reinit(self.v, 2 * common - v), self.hits == pre(self.hits) + 1)


class Pairs(Model):
    """Two such pairs, of which both carts collide at the same instant, and the instants are counted."""

    pairs = Array(Carts, [dict(m=[1.0, 3.0]), dict(m=[2.0, 2.0])])
    together = Discrete(0)
    instants = Discrete(0)

    def equations(self):
        n = [pair.hits for pair in self.pairs]
        yield when(n[0] + n[1] > 1, self.together == 10 * n[0] + n[1])
        yield when(logic_or(n[0] > 0, n[1] > 0), self.instants == pre(self.instants) + 1)


def test_collisions_at_one_instant_keep_the_momentum():
    found = simulate(Pairs(), stop=1.0, points=5)
    assert found.time[jumps(found)] == pytest.approx([0.5], abs=1e-13)
    for k, m in enumerate(([1.0, 3.0], [2.0, 2.0])):
        v = found[f"pairs[{k}].v"]
        np.testing.assert_allclose(v @ m, v[0] @ m, rtol=1e-14)
        np.testing.assert_allclose(v**2 @ m, v[0] ** 2 @ m, rtol=1e-14)
    np.testing.assert_allclose(found["pairs[0].v"][-1], [-2, 0], atol=1e-14)
    np.testing.assert_allclose(found["pairs[1].v"][-1], [-1, 1], atol=1e-14)
    assert found.final("together") == 11
    assert found.final("instants") == 1


class Relay(Model):
    """A double integrator under a relay with hysteresis: its limit cycle grows by the energy of each switching."""

    width = Parameter(0.1)
    x = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)
    side = Discrete(-1)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.side
        s = self.x + 0.5 * self.v
        yield when(s < -self.width, self.side == 1).elsewhen(s > self.width, self.side == -1)


def test_a_relay_loop_reaches_its_limit_cycle():
    """x and v of the cycle: it leaves one side as it leaves the other, with -x and -v."""
    found = simulate(Relay(), stop=60.0, points=2, tolerance=1e-10)
    at = jumps(found)[-6:]
    x, v = found["x"][at], found["v"][at]
    np.testing.assert_allclose(x[1:], -x[:-1], atol=1e-8)
    np.testing.assert_allclose(v[1:], -v[:-1], atol=1e-8)
    # from v to -v by 1 m/s2
    np.testing.assert_allclose(np.diff(found.time[at]), 2 * np.abs(v[:-1]), atol=1e-8)


def test_aliases_with_sign_and_offset():
    class Turned(Model):
        """The ball, upside down and in another place: y == 3 - 2 h."""

        ball = Ball(bounces=dict(unit="1"))
        y = Real(unit="m")
        w = Real(unit="m/s")
        three = Parameter(3.0, unit="m")
        kicks = Discrete(0)

        def equations(self):
            yield self.y == self.three - 2 * self.ball.h
            yield self.w == -2 * self.ball.v
            yield when(self.y >= 0.5 * self.three, self.kicks == pre(self.kicks) + 1)

    class Saw(Model):
        """A ramp that is set back by a name that is upside down: y == 3 - 2 x goes from 3 down to 1."""

        x = Real(start=0.0, fixed=True)
        y = Real()

        def equations(self):
            yield der(self.x) == 1
            yield self.y == 3 - 2 * self.x
            yield when(self.y <= 1, reinit(self.y, 4 - pre(self.y)))

    plain, turned = (simulate(m, stop=1.0, points=6, tolerance=1e-11) for m in (Ball(), Turned()))
    np.testing.assert_allclose(turned["ball.h"][-1], plain["h"][-1], rtol=1e-9)
    assert turned.final("kicks") == 1
    for points in (2, 501):
        saw = simulate(Saw(), stop=10.25, points=points)
        assert jumps(saw).size == 10
        np.testing.assert_allclose(
            saw["x"], saw.time - np.cumsum(np.diff(saw.time, prepend=0) == 0) + 1, atol=1e-8
        )


def test_a_mechanism_follows_the_state_that_is_set():
    """A pendulum in Cartesian coordinates that is caught at its lowest point: x'^2 + y'^2 and x^2 + y^2 stay consistent."""

    class Caught(Model):
        x = Real(start=0.8)
        y = Real(start=-0.6)
        v = Real(start=0.0)
        w = Real(start=0.0)
        pull = Real()
        swings = Discrete(0)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.y) == self.w
            yield der(self.v) == -self.pull * self.x
            yield der(self.w) == -self.pull * self.y - 1
            yield self.x**2 + self.y**2 == 1
            yield when(self.x <= 0, reinit(self.v, pre(self.v) / 2), self.swings == pre(self.swings) + 1)

    found = simulate(Caught(), stop=2.2, tolerance=1e-10)
    (left,) = jumps(found)
    np.testing.assert_allclose(found["x"] ** 2 + found["y"] ** 2, 1, atol=1e-11)
    np.testing.assert_allclose(found["x"] * found["v"] + found["y"] * found["w"], 0, atol=1e-11)
    energy = (found["v"] ** 2 + found["w"] ** 2) / 2 + found["y"]
    np.testing.assert_allclose(energy[: left + 1], -0.6, atol=1e-9)
    np.testing.assert_allclose(energy[left + 1 :], 0.1 - 1, atol=1e-9)  # a quarter of v^2 / 2 = 0.4
    pull = found["pull"]  # the rod's force jumps with the speed: 1 + v^2
    np.testing.assert_allclose(pull[left : left + 2], [1 + 0.8, 1 + 0.2], rtol=1e-8)


def test_conditions_that_lead_to_each_other_end():
    class Circle(Model):
        x = Real(start=0.0, fixed=True)
        a = Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield (
                when(self.x >= 1, self.a == 1)
                .elsewhen(self.a > 0.5, self.a == 0)
                .elsewhen(logic_and(self.x >= 1, self.a < 0.5), self.a == 1)
            )

    with pytest.raises(SolveError, match="true again and again at one instant") as error:
        simulate(Circle(), stop=2.0)
    assert error.value.result.time[-1] == pytest.approx(1.0, abs=1e-12)
    assert "when" in str(error.value)


def test_new_values_that_are_not_finite_are_refused():
    class Broken(Model):
        x = Real(start=1.0, fixed=True)
        a = Discrete(0.0)

        def equations(self):
            yield der(self.x) == -1
            yield when(self.x <= 0, self.a == 1 / pre(self.a))

    with pytest.raises(SolveError, match=r"equation 2, when.*the new value of a is not finite"):
        simulate(Broken(), stop=2.0)
