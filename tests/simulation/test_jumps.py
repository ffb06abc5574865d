"""Whens in a simulation: against exact solutions, whatever output points are asked for."""

import math

import numpy as np
import pytest

from gantrytau import (
    Array,
    Discrete,
    Fixed,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    StructureError,
    der,
    fmax,
    if_else,
    logic_and,
    logic_or,
    pre,
    reinit,
    sampled,
    simulate,
    sin,
    sqrt,
    terminate,
    time,
    translate,
    when,
)
from gantrytau_models import FourBar

POINTS = (2, 3, 501)
G = 9.81


class Ball(Model):
    """A ball that falls on a floor and bounces."""

    g = Parameter(G, unit="m/s2", description="gravity")
    e = Parameter(0.8, unit="1", description="part of the speed that is left")
    h = Real(unit="m", description="height", start=1.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
    bounces = Discrete(0, unit="1", description="bounces so far")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -self.g
        yield when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.bounces == pre(self.bounces) + 1)


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
    np.testing.assert_allclose(
        np.diff(found.time[at]), 2 * np.abs(v[:-1]), atol=1e-8
    )  # from v to -v by 1 m/s2


def test_counters_and_drives_at_instants_of_time():
    class Drive(Model):
        T = Parameter(0.1, unit="s")
        duty = Parameter(0.3)
        x = Real(start=0.0, fixed=True)
        begin = Discrete(0.0, unit="s")
        on = Discrete(True)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == self.on
            yield when(time >= self.begin + self.duty * self.T, self.on == 0)
            yield when(
                time >= self.begin + self.T,
                self.begin == pre(self.begin) + self.T,
                self.n == pre(self.n) + 1,
            )

    class Twice(Drive):
        def equations(self):
            yield from Drive.equations(self)
            yield when(time >= 2, self.on == 1)

    with pytest.raises(ModelError, match="sets as well"):
        simulate(Twice(), stop=1.0)

    class Pulsed(Drive):
        def equations(self):
            yield der(self.x) == self.on
            yield when(
                time >= self.begin + self.T,
                self.on == 1,
                self.begin == pre(self.begin) + self.T,
                self.n == pre(self.n) + 1,
            ).elsewhen(time >= self.begin + self.duty * self.T, self.on == 0)

    for points in (2, 11, 1001):
        found = simulate(Pulsed(), stop=10.05, points=points)
        assert found.final("n") == 100
        assert found.final("x") == pytest.approx(100 * 0.03 + 0.03, abs=1e-12)
        assert found.at(3.02, "on") == 1
        assert found.at(3.0301, "on") == 0


def test_instants_of_time_move_with_what_they_depend_on():
    class Moved(Model):
        """A level that a sine reaches, raised each time: asin(0.2), asin(0.4), ... of one swing, then none."""

        second = Parameter(1.0, unit="s")
        level = Discrete(0.2)
        x = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == 1
            yield when(sin(time / self.second) > self.level, self.level == pre(self.level) + 0.2)

    found = simulate(Moved(), stop=1.5, points=2)
    np.testing.assert_allclose(found.time[jumps(found)], np.arcsin([0.2, 0.4, 0.6, 0.8]), atol=1e-14)


@pytest.mark.parametrize("points", [2, 3, 11])
def test_instants_at_an_output_point_at_the_start_and_at_the_end(points):
    class Instants(Model):
        x = Real(start=0.0, fixed=True)
        start, middle, end, both = Discrete(0), Discrete(0), Discrete(0), Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield when(time >= 0, self.start == 1)
            yield when(time >= 0.5, self.middle == 1)
            yield when(self.x >= 0.5, self.both == self.middle)
            yield when(time >= 1, self.end == 1)

    found = simulate(Instants(), stop=1.0, points=points)
    assert found.final("start") == 0  # it was true at the start
    assert found.final("middle") == found.at(0.5, "middle") == 1
    assert found.at(0.5 - 1e-9, "middle") == 0
    assert found.final("end") == 1
    assert found.final("both") == 1
    assert found.at(1.0, "end") == 1


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


def test_both_sides_of_a_jump_and_samples_at_one_instant():
    class Both(Model):
        T = Parameter(0.25, unit="s")
        one = Parameter(1.0, unit="s")
        x = Real(start=0.0, fixed=True)
        s = Real(start=-1.0)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield sampled(self.s, self.x + self.n, period=self.T)
            yield when(self.s >= 0.5, self.n == pre(self.n) + 10 * self.s)

    found = simulate(Both(), stop=1.0, points=5)
    np.testing.assert_allclose(found.time, [0, 0.25, 0.5, 0.5, 0.75, 1])
    np.testing.assert_allclose(found["s"], [0, 0.25, 0.25, 0.5, 0.75 + 5, 1 + 5], atol=1e-12)
    np.testing.assert_allclose(found["n"], [0, 0, 0, 5, 5, 5], atol=1e-12)
    assert found.held == {"s", "n"}
    assert found.at(0.6, "s") == pytest.approx(0.5)
    np.testing.assert_allclose(found.at([0.1, 0.6], "x"), [0.1, 0.6], atol=1e-12)
    with pytest.raises(ModelError, match=r"at: found t = 1\.5, expected times from 0 s to 1 s"):
        found.at(1.5, "x")
    lines = found.plot("s", "n").axes[0].get_lines()
    assert [line.get_drawstyle() for line in lines] == ["steps-post", "steps-post"]
    assert found.select(["n", "x"]).held == {"n"}


def test_values_between_output_points_have_the_slope_of_the_motion():
    found = simulate(Ball(), stop=0.4, points=3)
    t = np.linspace(0, 0.4, 17)
    np.testing.assert_allclose(found.at(t, "h"), 1 - G * t**2 / 2, atol=1e-8)
    np.testing.assert_allclose(found.at(t, "v"), -G * t, atol=1e-8)


def test_functions_of_an_instant():
    dae = translate(Ball(), events=True)
    behind = dae.function(["pre(h)", "pre(v)", "pre(bounces)"], ["v", "bounces", "h"])
    np.testing.assert_allclose(np.ravel(behind(1.0, -2.0, 3)), [-2, 3, 1])  # the condition does not hold
    np.testing.assert_allclose(np.ravel(behind(0.0, -2.0, 3)), [1.6, 4, 0])
    assert float(dae.function(["pre(v)", "h"], ["v"])(5.0, -1e-9)) == -4.0
    with pytest.raises(ModelError, match=r"found v among the given of an instant.*expected pre\(v\)"):
        dae.function(["pre(h)", "v"], ["bounces"])
    with pytest.raises(StructureError, match="Give also bounces"):
        dae.function(["pre(h)", "pre(v)"], ["bounces"])
    with pytest.raises(ModelError, match="there is no when in the model"):
        translate(FourBar()).function(["pre(crank.phi)"], ["rocker.phi"])


def test_a_function_of_an_instant_is_what_a_simulation_does():
    found = simulate(Pairs(), stop=1.0, points=2)
    (left,) = jumps(found)
    dae = translate(Pairs(), events=True)
    names = [f"pairs[{k}].{x}" for k in range(2) for x in ("x", "v", "hits")]
    behind = dae.function([f"pre({n})" for n in names], names)
    before = [found[n][left] for n in names]
    for name, value in zip(names, behind(*before), strict=True):
        np.testing.assert_allclose(np.ravel(value), np.ravel(found[name][left + 1]), rtol=1e-14)
