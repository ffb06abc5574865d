"""Where margins pass zero: at output points, at poles, again and again; and what is said where that cannot go on."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Model,
    Real,
    SolveError,
    atan2,
    cos,
    der,
    fabs,
    floor,
    if_else,
    mod,
    pre,
    sign,
    simulate,
    sin,
    tan,
    terminate,
    time,
    when,
)
from gantrytau.simulation.between.chatter import CROWD, Chatter, accumulate
from gantrytau.simulation.events.crossings import located
from gantrytau.simulation.events.margins import SwitchMargins
from gantrytau.simulation.events.poles import without_poles
from tests.families import first_of


class Slots(Model):
    """Fifty slots a second, which begin and end at output points."""

    x = Real(start=0.0, fixed=True)
    n = Discrete(0)

    def equations(self):
        yield der(self.x) == 1.0
        yield when(mod(50 * self.x, 1) >= 0.5, self.n == pre(self.n) + 1)


@pytest.mark.parametrize("points", first_of([51, 2, 101, 126, 251]))
def test_a_switch_at_an_output_point_is_found(points):
    assert simulate(Slots(), stop=0.5, points=points).final("n") == 25


def test_a_switch_by_time_beside_a_jump_of_its_angle_is_found():
    class Branch(Model):
        n = Discrete(0)

        def equations(self):
            yield when(atan2(sin(3 * time), cos(3 * time)) > 1.0, self.n == pre(self.n) + 1)

    assert simulate(Branch(), stop=7.0).final("n") == 4


def test_a_crossing_to_which_no_step_leads_is_none():
    def point(t: float) -> Any:
        return np.zeros(0), np.zeros(0), t, np.zeros(0)

    def step(low: Any, h: float) -> Any:
        raise RuntimeError("the equations are not finite")

    def look(at: Any) -> SwitchMargins:
        one = np.array([[1.0]])
        return SwitchMargins(one * (0.5 - at[2]), -one, 1e-16 * one)

    assert located(point(0.0), point(1.0), 0.5, step, look) is None
    found = located(point(0.0), point(1.0), 0.3, lambda low, h: point(low[2] + h), look)
    assert found is not None
    assert found[2] == pytest.approx(0.5, abs=1e-15)


def test_where_no_step_leads_to_a_crossing_its_condition_is_named(monkeypatch):
    class Falling(Model):
        height = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.height) == -if_else(self.height > 0.5, 1.0, 2.0)

    monkeypatch.setattr("gantrytau.simulation.integration.located", lambda *_: None)
    # by places laid closer
    assert simulate(Falling(), stop=1.0).final("height") == pytest.approx(-0.5, abs=1e-7)
    monkeypatch.setattr("gantrytau.simulation.integration.Run._nearer", lambda _: False)
    with pytest.raises(SolveError, match=r"^Falling: .*no step leads to where the condition on height turns"):
        simulate(Falling(), stop=1.0)


class Relay(Model):
    """A relay with a band of half a millimetre, which switches each half millisecond until 0.26 s."""

    x = Real(start=0.0, fixed=True, nominal=1e-3)
    on = Discrete(1)
    n = Discrete(0)

    def equations(self):
        yield der(self.x) == if_else(time < 0.26, 1.0, 0.0) * (2 * self.on - 1)
        yield when(self.x >= 0.0005, self.on == 0, self.n == pre(self.n) + 1).elsewhen(
            self.x <= 0, self.on == 1
        )


def test_a_relay_is_sound_whatever_the_length_of_the_run():
    assert simulate(Relay(), stop=1e4).final("n") == 260


class Sliding(Model):
    x = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -3 * sign(self.x + self.v)


class Large(Model):
    x = Real(start=1e6, fixed=True)

    def equations(self):
        yield der(self.x) == -1e6 * sign(self.x)


class Accumulating(Model):
    """Fuller's problem: switches in a geometric series, which ends at a finite time."""

    x = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -sign(self.x + 0.4446 * self.v * fabs(self.v))


@pytest.mark.parametrize("stop", [5.0, 5000.0])
@pytest.mark.parametrize("model", first_of([Sliding, Large, Accumulating]))
def test_what_turns_without_leaving_its_switch_is_told(model, stop):
    with pytest.raises(SolveError, match=r"the condition on .*x turns back and forth without end"):
        simulate(model(), stop=stop)


class Balanced(Model):
    """A sum of products that is zero by an identity, whatever the states; rounding gives it a sign."""

    a = Real(start=0.0, fixed=True)
    b = Real(start=0.0, fixed=True)
    off = Real()

    def equations(self):
        yield der(self.a) == 110 * sin(31 * time)
        yield der(self.b) == 120 * sin(37 * time) - self.a
        a, b = self.a, self.b
        yield self.off == sum(sin(k * a + b) - sin(k * a) * cos(b) - cos(k * a) * sin(b) for k in range(1, 4))
        yield when(fabs(self.off) > 1e-3, terminate("out of balance"))


def test_what_is_zero_by_an_identity_does_not_turn_by_rounding(monkeypatch):
    turns, found = [], Chatter.found
    monkeypatch.setattr(Chatter, "found", lambda *given: turns.append(given[1]) or found(*given))
    assert simulate(Balanced(), stop=1.0).ended == "stop"
    assert len(turns) <= CROWD  # so many tell that rounding makes them


def test_turns_that_accumulate_at_a_pole_are_told(monkeypatch):
    monkeypatch.setattr("gantrytau.simulation.between.chatter.MANY", (256,))

    class Counting(Model):
        x = Real(start=-1.0, fixed=True)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield when(floor(1 / self.x) > 3, self.n == pre(self.n) + 1)

    with pytest.raises(SolveError, match=r"condition on x turned thousands of times") as caught:
        simulate(Counting(), stop=3.0)
    assert caught.value.time == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize(("power", "told"), [(2.0, True), (1.0, False), (0.5, False), (0.0, False)])
def test_intervalsaccumulate_where_their_sum_has_a_limit(power, told):
    assert accumulate(np.cumsum(np.arange(1.0, 2049) ** -power).tolist()) == told


CONDITIONS: dict[str, tuple[Any, list[float]]] = {  # of x, and where they become true for x from -1 to 6
    "tan(x) < 0": (lambda x: tan(x) < 0, [math.pi / 2, 3 * math.pi / 2]),
    "1/x > 0": (lambda x: 1 / x > 0, [0.0]),
    "tan(x) > 1": (lambda x: tan(x) > 1, [math.pi / 4, 5 * math.pi / 4]),
    "tan(x) < 1": (lambda x: tan(x) < 1, [math.pi / 2, 3 * math.pi / 2]),
    "1/x < 5": (lambda x: 1 / x < 5, [0.2]),
    "1/x^2 > 5": (lambda x: 1 / x**2 > 5, [-math.sqrt(0.2)]),
    "1/x + 1/(x - 1) > 0": (lambda x: 1 / x + 1 / (x - 1) > 0, [0.0, 1.0]),
    "1/sin(x) < 0": (lambda x: 1 / sin(x) < 0, [math.pi]),
}


@pytest.mark.parametrize("name", first_of(CONDITIONS, 4))
@pytest.mark.filterwarnings("ignore::gantrytau.DoubtfulResult")
def test_a_condition_acts_at_a_pole_once(name):
    condition, places = CONDITIONS[name]

    class Moving(Model):
        x = Real(start=-1.0, fixed=True)
        n = Discrete(0)

        def equations(self):
            yield der(self.x) == 1
            yield when(condition(self.x), self.n == pre(self.n) + 1)

    found = simulate(Moving(), stop=7.0)
    np.testing.assert_allclose(found["x"][1:][np.diff(found["n"]) > 0], places, rtol=0, atol=1e-9)


def test_a_margin_without_poles_has_its_sign():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    margins = [
        ca.tan(x) - y,
        1 / x + 1 / y,
        x / y - y / x + 2,
        -(x / (y - 1)) * ca.tan(y),
        x**-1 - ca.sqrt(x / y),
    ]
    some = np.random.default_rng(0).normal(size=(2, 500))
    for margin in margins:
        found = ca.Function("sign", [x, y], [margin, without_poles(margin)])
        before, behind = (np.array(f).ravel() for f in found(some[:1], some[1:]))
        known = np.isfinite(before)
        np.testing.assert_array_equal(np.sign(behind[known]), np.sign(before[known]))
    smooth = x * y - 3
    assert without_poles(smooth) is smooth
