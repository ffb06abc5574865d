"""What switches by time and by states is found, whatever output points are asked for: against exact solutions."""

import math

import casadi
import numpy as np
import pytest

from gantrytau import (
    DoubtfulResult,
    Input,
    Model,
    Parameter,
    Real,
    SolveError,
    between,
    cos,
    der,
    exp,
    fabs,
    if_else,
    simulate,
    sin,
    sqrt,
    time,
    translate,
)
from gantrytau.simulation.motion import all_coordinates
from gantrytau_models import FourBar

TOLERANCE = 1e-9
POINTS = (2, 3, 11, 501)


class Pushed(Model):
    """A speed that a force of one kilogram changes."""

    f = Input()
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.v) == self.f


class TwoSprings(Model):
    """A mass that a soft spring pulls on one side, and one of four times its stiffness on the other."""

    x = Real(start=1.0, fixed=True)
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -if_else(self.x > 0, self.x, 4 * self.x)


def two_springs(t):
    """Its position: half a period of pi, then half a period of pi / 2."""
    phase = np.mod(t + math.pi / 2, 1.5 * math.pi)
    return np.where(phase < math.pi, np.sin(phase), -0.5 * np.sin(2 * (phase - math.pi)))


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize("width", [0.5, 1e-3, 1e-6])
def test_a_pulse_of_an_input_is_found_whatever_points_are_asked_for(points, width):
    push = {"f": lambda t: if_else(between(3.0, t, 3.0 + width), 2 / width, 0.0)}
    found = simulate(Pushed(), stop=5.0, inputs=push, points=points)
    assert found.final("v") == pytest.approx(2.0, abs=1e-8)
    before = np.flatnonzero(np.diff(found.time) == 0)
    np.testing.assert_allclose(found.time[before], [3.0, 3.0 + width], rtol=1e-14)
    np.testing.assert_array_equal(found["f"][before], [0.0, 2 / width])
    np.testing.assert_array_equal(found["f"][before + 1], [2 / width, 0.0])


def test_a_signal_is_shown_on_both_sides_of_where_it_jumps():
    push = {"f": lambda t: if_else(between(1.0, t, 3.0), 10.0, 0.0)}
    found = simulate(Pushed(), stop=4.0, inputs=push, points=5)
    np.testing.assert_array_equal(found.time, [0, 1, 1, 2, 3, 3, 4])
    np.testing.assert_array_equal(found["f"], [0, 0, 10, 10, 10, 0, 0])
    np.testing.assert_allclose(found["v"], [0, 0, 0, 10, 20, 20, 20], atol=1e-8)


@pytest.mark.parametrize("points", POINTS)
def test_a_spring_that_changes_its_stiffness(points):
    found = simulate(TwoSprings(), stop=20.0, points=points, tolerance=TOLERANCE)
    # a hundred times the tolerance, as with one spring of a sine
    np.testing.assert_allclose(found["x"], two_springs(found.time), rtol=0, atol=100 * TOLERANCE)


def test_the_order_is_kept_across_switches():
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        found = simulate(TwoSprings(), stop=10.0, points=11, tolerance=tolerance)
        errors.append(np.max(np.abs(found["x"] - two_springs(found.time))))
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10


@pytest.mark.parametrize("points", POINTS)
def test_switches_of_time_that_are_no_straight_lines(points):
    class Lit(Model):
        second = Parameter(1.0, unit="s")
        day = Real(unit="s", start=0.0, fixed=True)
        flash = Real(unit="s", start=0.0, fixed=True)

        def equations(self):
            t = time / self.second
            yield der(self.day) == if_else(sin(t) > 0.5, 1.0, 0.0)
            yield der(self.flash) == if_else(exp(-(((t - 3) / 1e-3) ** 2)) > 0.5, 1.0, 0.0)

    found = simulate(Lit(), stop=2 * math.pi, points=points)
    assert found.final("day") == pytest.approx(2 * math.pi / 3, abs=1e-9)
    assert found.final("flash") == pytest.approx(2e-3 * math.sqrt(math.log(2)), abs=1e-9)


@pytest.mark.parametrize("points", [2, 12, 501])
def test_steps_and_pulses_that_count(points):
    class Counted(Model):
        stairs = Real(start=0.0, fixed=True)
        duty = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.stairs) == casadi.floor(time)
            yield der(self.duty) == if_else(casadi.fmod(time, 0.1) < 0.03, 1.0, 0.0)

    found = simulate(Counted(), stop=5.5, points=points)
    assert found.final("stairs") == pytest.approx(0 + 1 + 2 + 3 + 4 + 5 / 2, abs=1e-9)
    assert found.final("duty") == pytest.approx(55 * 0.03, abs=1e-9)


@pytest.mark.parametrize("points", [2, 501])
def test_a_margin_that_is_passed_twice_between_two_places(points):
    """A ball thrown just above a line: for a thousandth of a second."""

    class Thrown(Model):
        h = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)
        above = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.h) == self.v
            yield der(self.v) == -1.0
            yield der(self.above) == if_else(self.h > 0.5 - 0.5 * 0.5e-3**2, 1.0, 0.0)

    found = simulate(Thrown(), stop=3.0, points=points, tolerance=1e-12)
    assert found.final("above") == pytest.approx(1e-3, rel=1e-4)  # the height is known to 1e-11


def test_motions_faster_than_the_mesh():
    class Fast(Model):
        x = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)
        right = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == 1000 * self.v
            yield der(self.v) == -1000 * self.x
            yield der(self.right) == if_else(self.x > 0.9, 1.0, 0.0)

    found = simulate(Fast(), stop=0.02 * math.pi, points=2, tolerance=1e-10)
    assert found.final("right") == pytest.approx(0.02 * math.acos(0.9), rel=1e-6)


def test_two_conditions_at_once_and_one_that_hangs_on_another():
    class Two(Model):
        x = Real(start=-1.0, fixed=True)
        y = Real(start=-1.0, fixed=True)
        n = Real(start=0.0, fixed=True)

        def equations(self):
            slow = if_else(self.x > 0, 0.5, 1.0)
            yield der(self.x) == slow
            yield der(self.y) == 1.0
            yield der(self.n) == if_else(self.y > if_else(self.x > 0, 0.0, 5.0), 1.0, 0.0)

    found = simulate(Two(), stop=3.0, points=4)
    np.testing.assert_array_equal(found.time, [0, 1, 1, 2, 3])
    np.testing.assert_allclose(found["x"], [-1, 0, 0, 0.5, 1], atol=1e-8)
    np.testing.assert_allclose(found["n"], [0, 0, 0, 1, 2], atol=1e-8)


def test_an_algebraic_variable_jumps_with_what_it_follows():
    class Loop(Model):
        u = Input()
        x = Real(start=0.0, fixed=True)
        y = Real(start=0.5)

        def equations(self):
            yield der(self.x) == self.y
            yield self.y + 0.5 * sin(self.y) == self.u + if_else(self.y > 1.5, 1.0, 0.0) * self.x

    step = {"u": lambda t: if_else(t < 1.0, 1.0, 2.0)}
    found = simulate(Loop(), stop=1.9, inputs=step, points=20)
    left = found["y"] + 0.5 * np.sin(found["y"]) - found["u"]
    right = np.where(found["y"] > 1.5, found["x"], 0.0)
    np.testing.assert_allclose(left, right, atol=1e-9)
    assert found["y"][9] < 1.5 < found["y"][11]


def test_a_loop_that_a_torque_switches():
    """The same as with samples that rise within a nanosecond."""
    linkage = translate(FourBar())
    push = {"torque": lambda t: if_else(between(0.101, t, 0.2035), 5.0, 0.0)}
    ends = []
    for points in (2, 11, 301):
        found = simulate(linkage, stop=0.4, inputs=push, points=points, tolerance=1e-10)
        ends.append([found.final("crank.phi"), found.final("crank.w")])
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, rtol=0, atol=1e-7)
    edges = np.array([0.0, 0.101, 0.101 + 1e-9, 0.2035, 0.2035 + 1e-9, 0.4])
    steps = {"torque": (edges, np.array([0, 0, 5, 5, 0, 0.0]))}
    same = simulate(linkage, stop=0.4, inputs=steps, points=2, tolerance=1e-10)
    np.testing.assert_allclose([same.final("crank.phi"), same.final("crank.w")], ends[0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("torque", [1.0, 0.9])
def test_what_slides_ends_with_the_condition_and_the_time(torque):
    class Rubbing(Model):
        x = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.x) == -if_else(self.x > 0, 1.0, -torque)

    with pytest.raises(SolveError, match=r"at t = 1 s the condition on x turns back and forth") as caught:
        simulate(Rubbing(), stop=2.0)
    assert caught.value.time == pytest.approx(1.0, abs=1e-8)
    assert "tanh" in str(caught.value)
    assert caught.value.result.final("x") == pytest.approx(0.0, abs=1e-8)


def test_an_equation_without_a_solution_for_either_side_ends_with_its_condition():
    class Gap(Model):
        u = Input()
        x = Real(start=-1.0)
        q = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.q) == self.x
            yield self.x - 2 * fabs(self.x) == self.u  # two solutions below zero, none above

    with pytest.raises(SolveError, match=r"at t = 1 s no side of the condition on x agrees") as caught:
        simulate(Gap(), stop=2.0, inputs={"u": lambda t: t - 1})
    assert np.isfinite(caught.value.result["x"]).all()

    class Climbing(Model):
        u = Input()
        x = Real(start=0.0)
        q = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.q) == self.x
            yield self.x == self.u + 1.5 * casadi.floor(self.x)  # each whole number leads to a higher one

    with pytest.raises(SolveError, match=r"at t = 1 s no side of the condition on x agrees"):
        simulate(Climbing(), stop=2.0, inputs={"u": lambda t: t})


@pytest.mark.parametrize("points", [2, 21])
def test_equations_that_switch_on_their_own_unknowns_are_led_through_their_pieces(points):
    class Own(Model):
        u = Input()
        half = Real(start=1.0)
        limited = Real(start=0.5)
        cubic = Real(start=0.5)
        sum = Real(start=0.0, fixed=True)

        def equations(self):
            yield self.half + 0.5 * fabs(self.half) == self.u
            yield self.limited + casadi.fmin(casadi.fmax(4 * self.limited, -1), 1) == self.u
            yield self.cubic**3 + fabs(self.cubic) + 2 * self.cubic == self.u
            yield der(self.sum) == self.half + self.limited + self.cubic

    found = simulate(Own(), stop=4.0, inputs={"u": lambda t: 3 - 2 * t}, points=points, tolerance=TOLERANCE)
    u, c = 3 - 2 * found.time, found["cubic"]
    np.testing.assert_allclose(found["half"], np.where(u > 0, u / 1.5, u / 0.5), atol=1e-9)
    np.testing.assert_allclose(found["limited"], np.where(np.abs(u) < 1.25, u / 5, u - np.sign(u)), atol=1e-9)
    np.testing.assert_allclose(c**3 + np.abs(c) + 2 * c, u, atol=1e-9)


def test_a_kink_at_the_level_of_positions():
    class Led(Model):
        x = Real()
        v = Real()

        def equations(self):
            yield self.x == fabs(time - 1)
            yield self.v == der(self.x)

    found = simulate(Led(), stop=2.0, points=5)
    np.testing.assert_allclose(found["x"], [1, 0.5, 0, 0.5, 1], atol=1e-12)
    np.testing.assert_allclose(found["v"][[0, 1, 3, 4]], [-1, -1, 1, 1], atol=1e-12)


def test_a_switch_that_stays_on_one_side_changes_nothing():
    class Bent(Model):
        x = Real(start=1.0, fixed=True)
        v = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -self.x - 0.0 * cos(self.x) + fabs(self.x + 2) - (self.x + 2)

    found = simulate(Bent(), stop=5.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["x"], np.cos(found.time), atol=100 * TOLERANCE)


class Emptying(Model):
    """A tank with a hole: h = (1 - t / 2)^2 until it is empty at 2 s."""

    h = Real(start=1.0, fixed=True)

    def equations(self):
        yield der(self.h) == -sqrt(casadi.fmax(self.h, 0))


@pytest.mark.parametrize("points", [2, 11, 501])
def test_a_motion_that_comes_to_rest_on_a_switch_goes_on(points):
    found = simulate(Emptying(), stop=4.0, points=points)
    np.testing.assert_allclose(found["h"], np.maximum(1 - found.time / 2, 0) ** 2, atol=3e-8)


def test_a_root_that_is_left_names_what_is_not_finite():
    class Left(Model):
        h = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.h) == -sqrt(self.h)

    with pytest.raises(SolveError, match=r"stopped at t = 2 s: behind it der\(h\) is not") as caught:
        simulate(Left(), stop=4.0)
    assert "the model (Left), equation 1" in caught.value.equations
    assert "grow beyond" not in str(caught.value)


def test_what_is_not_finite_is_told_with_its_first_time():
    class Root(Model):
        x = Real(start=1.0, fixed=True)
        y = Real()

        def equations(self):
            yield der(self.x) == -1.0
            yield self.y == sqrt(self.x - 0.5)

    with pytest.warns(DoubtfulResult, match=r"Root: y is not finite from t = 0\.5"):
        found = simulate(Root(), stop=1.0, points=101)
    assert np.isfinite(found["x"]).all()


def test_what_is_huge_is_told():
    class Huge(Model):
        x = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.x) == 300 * self.x

    with pytest.warns(DoubtfulResult, match=r"x is beyond 1e\+100 from t = 0\.77 s on"):
        simulate(Huge(), stop=1.0, points=101)


@pytest.mark.parametrize("points", [2, 501])
def test_what_is_said_to_be_smooth_is_no_event(points):
    """A force that is linear near the middle and constant outside, whose energy is known; no step jumps over the middle."""

    class Soft(Model):
        x = Real(start=3.0, fixed=True)
        v = Real(start=0.0, fixed=True)
        y = Real(start=3.0)

        def equations(self):
            side = if_else(self.x > 0, 1.0, -1.0, smooth=True)
            yield der(self.x) == self.v
            yield der(self.v) == -if_else(between(-1, self.x, 1), self.x, side, smooth=True)
            # in a loop of its own
            yield (self.y + if_else(self.y > 0, 2 * self.y, self.y, smooth=True) == self.x)

    found = simulate(Soft(), stop=20.0, tolerance=1e-10, points=points)
    x = found["x"]
    energy = found["v"] ** 2 / 2 + np.where(np.abs(x) < 1, x**2 / 2, np.abs(x) - 0.5)
    np.testing.assert_allclose(energy, 2.5, atol=1e-7)
    np.testing.assert_allclose(found["y"], np.where(x > 0, x / 3, x / 2), atol=1e-12)
    assert all_coordinates(translate(Soft()), {}).switches.turns == ()
