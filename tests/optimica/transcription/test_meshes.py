"""Meshes: given lengths, free lengths, and values at times that move between elements."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Parameter, Real
from gantrytau_optimica import Free, Optimization, at, final, optimize, prepare
from tests.optimica.control.test_controls import Effort
from tests.optimica.control.test_phases import ThereAndBack
from tests.optimica.known_answers.known_problems import zero
from tests.optimica.problems import FastestMass, LinearQuadratic, Mass


class Uneven(FastestMass):
    """Half the force to speed up: 2 T/3 to speed up and T/3 to brake, T^2 = 6."""

    mass = Mass(u=dict(min=-1.0, max=0.5))


EXACT = np.sqrt(6.0)


def test_lengths_relative_to_each_other():
    optimum = optimize(Effort, elements=[1, 2, 5], scheme="gauss")
    np.testing.assert_allclose(optimum.breaks, [1 / 8, 3 / 8], atol=1e-12)
    assert optimum.objective == pytest.approx(12.0, abs=1e-8)
    # a border at the switch: constant pieces are exact then
    constant = {"mass.u": "constant"}
    switched = optimize(Uneven, elements=[2, 1], controls=constant)
    assert switched.final_time == pytest.approx(EXACT, abs=1e-6)
    assert optimize(Uneven, elements=[1, 1], controls=constant).final_time > EXACT + 0.01


def test_elements_as_an_array_and_as_a_number():
    every: Any = (np.array([3.0, 3.0]), (7, 7), 2)
    for elements in every:
        np.testing.assert_allclose(optimize(LinearQuadratic, elements=elements).breaks, [1.5], atol=1e-12)
    assert optimize(LinearQuadratic, elements=[4.0]).breaks.size == 0


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
@pytest.mark.parametrize("elements", [2, [1, 2, 1], 5])
def test_free_lengths_find_the_switch(scheme, elements):
    optimum = optimize(
        Uneven, elements=elements, scheme=scheme, lengths="free", controls={"mass.u": "constant"}
    )
    assert optimum.final_time == pytest.approx(EXACT, abs=1e-6)
    assert np.min(np.abs(optimum.breaks - 2 / 3 * EXACT)) < 1e-5
    assert optimum.playback.defect < 1e-7
    assert np.all(np.diff(np.concatenate([[0], optimum.breaks, [optimum.final_time]])) > 0)


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
def test_free_lengths_find_both_ends_of_an_arc(scheme):
    class Limited(FastestMass):
        mass = Mass(u=dict(min=-1.0, max=1.0), v=dict(max=0.5))

    # 0.5 s, 1.5 s and 0.5 s
    optimum = optimize(Limited, elements=3, scheme=scheme, lengths="free", controls={"mass.u": "constant"})
    assert optimum.final_time == pytest.approx(2.5, abs=1e-6)
    np.testing.assert_allclose(optimum.breaks, [0.5, 2.0], atol=1e-4)


def test_free_lengths_of_an_integral():
    """A straight line is met best by constant pieces of equal lengths: they miss it by sum w^3 at least."""
    controls = {"mass.u": "constant"}
    given = optimize(Effort, elements=4, controls=controls)
    found = optimize(Effort, elements=[1, 3, 3, 1], lengths="free", controls=controls)
    assert found.objective == pytest.approx(given.objective, abs=1e-6)
    np.testing.assert_allclose(found.breaks, [0.25, 0.5, 0.75], atol=1e-4)


class Via(FastestMass):
    """Half of the way at 1.3 s, which is later than the fastest: 1 s."""

    def constraints(self):
        yield from super().constraints()
        yield at(1.3, self.mass.x) == 0.5


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
@pytest.mark.parametrize("guess", [1.5, 2.2, 6.0])
def test_a_time_moves_between_elements_as_the_end_does(scheme, guess):
    # wait 0.3 s, then as fast as possible; refined by the mesh to 1e-3
    optimum = optimize(Via, elements=20, scheme=scheme, guess={"final_time": guess})
    assert float(optimum.signal("mass.x")(1.3)) == pytest.approx(0.5, abs=1e-8)
    assert optimum.final_time == pytest.approx(2.3, abs=2e-3)


def test_a_time_where_borders_move():
    optimum = optimize(
        Via, elements=4, lengths="free", controls={"mass.u": "constant"}, guess={"final_time": 2.5}
    )
    # wait, speed up, brake: exact with free borders
    assert float(optimum.signal("mass.x")(1.3)) == pytest.approx(0.5, abs=1e-8)
    assert optimum.final_time == pytest.approx(2.3, abs=1e-5)


class Passing(Effort):
    """When does the best motion pass a place?"""

    when = Free(0.5, unit="s", min=0.0, max=1.0, description="time of passing")

    def constraints(self):
        yield from super().constraints()
        yield at(self.when, self.mass.x) == 0.3


def test_a_free_time_of_passing():
    exact = zero(lambda t: 3 * t**2 - 2 * t**3 - 0.3, 0.0, 1.0)
    for guess in (0.5, 0.3):
        optimum = optimize(Passing, elements=7, guess={"when": guess})
        assert optimum.objective == pytest.approx(12.0, abs=1e-7)  # nothing is lost by looking
        assert optimum["when"] == pytest.approx(exact, abs=1e-7)


def test_an_expression_of_free_numbers_as_time():
    class Half(Passing):
        def constraints(self):
            yield from Effort.constraints(self)
            yield at(self.when / 2 + self.late, self.mass.x) == 0.3

        late = Parameter(0.1, unit="s", description="delay")

    exact = zero(lambda t: 3 * t**2 - 2 * t**3 - 0.3, 0.0, 1.0)
    optimum = optimize(Half, elements=7)
    assert optimum["when"] == pytest.approx(2 * (exact - 0.1), abs=1e-7)


ROUNDING = "blocks.places_of_points refuses a time by 1e-9, Ipopt keeps a bound to 1e-8 only: a time at the end of its range"


def test_a_free_time_may_end_at_the_end():
    class Farthest(Optimization):
        """At 1 m/s the way grows until the end: the best time to look is 2 s, its limit."""

        mass = Mass(x=Fixed(0.0), v=Fixed(1.0), u=0.0)
        final_time = 2.0
        when = Free(1.9, unit="s", min=0.0, max=2.0, description="when to look")

        def objective(self):
            return -at(self.when, self.mass.x)

    assert optimize(Farthest, elements=5).objective == pytest.approx(-2.0, abs=1e-6)


def test_a_free_time_of_passing_far_from_its_guess():
    exact = zero(lambda t: 3 * t**2 - 2 * t**3 - 0.3, 0.0, 1.0)
    assert optimize(Passing, elements=7, guess={"when": 0.9})["when"] == pytest.approx(exact, abs=1e-7)


def test_the_time_of_the_largest_value():
    class Longest(Optimization):
        """Thrown up at 3 m/s, pulled back by 2 m/s2: 2.25 m after 1.5 s."""

        mass = Mass(x=Fixed(0.0), v=Fixed(3.0), u=-2.0)
        final_time = 3.0
        when = Free(1.2, unit="s", min=0.0, max=3.0, description="when to look")

        def objective(self):
            return -at(self.when, self.mass.x)

    optimum = optimize(Longest, elements=8)
    assert optimum.objective == pytest.approx(-2.25, abs=1e-8)
    assert optimum["when"] == pytest.approx(1.5, abs=1e-4)


def test_times_outside_of_the_horizon():
    class Late(Via):
        def constraints(self):
            yield from FastestMass.constraints(self)
            yield at(5.0, self.mass.x) == 1

    # inside for the guess, outside for the answer
    for guess in (3.0, 7.0):
        with pytest.raises(ModelError, match=r"at\(5, ...\): lies outside of the horizon"):
            optimize(Late, guess={"final_time": guess})


def test_a_time_at_an_end_is_the_end():
    class Ends(Optimization):
        mass: Any = Mass()
        final_time = 2.0

        def integrand(self):
            return self.mass.u**2

        def constraints(self):
            yield at(0.0, self.mass.x) == 0
            yield at(0, self.mass.v) == 0
            yield at(2.0, self.mass.x) == 1
            yield final(self.mass.v) == 0

    for scheme in ("radau", "gauss"):
        assert optimize(Ends, elements=3, scheme=scheme).objective == pytest.approx(1.5, abs=1e-8)


def test_gauss_does_not_look_at_the_end_but_the_playback_does():
    class Squared(Mass):
        square = Real(unit="m2", max=0.4, description="square of the way")

        def equations(self):
            yield from super().equations()
            yield self.square == self.x**2

    class Far(Optimization):
        mass = Squared(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
        final_time = 2.0

        def objective(self):
            return -final(self.mass.x)

    # Gauss' points lie inside: the limit of what is no state is passed at the very end
    far = optimize(Far, elements=5, scheme="gauss")
    passed = next(v for v in far.playback.violations if v.name == "limits of mass.square")
    assert passed.amount == pytest.approx(far.objective**2 - 0.4, abs=1e-6)
    assert passed.time == pytest.approx(2.0)
    assert optimize(Far, elements=5).objective == pytest.approx(-np.sqrt(0.4), abs=1e-6)


def test_free_lengths_of_phases():
    controls = {"out.mass.u": "constant", "back.mass.u": "constant"}
    optimum = optimize(ThereAndBack, elements=3, lengths="free", controls=controls)
    assert optimum.objective == pytest.approx(4.0, abs=1e-6)


@pytest.mark.parametrize("late", [4.0, 3.0, 2.5])
def test_a_time_stays_where_it_is_as_a_held_horizon_changes(late):
    """One program solved for another horizon is that of the horizon."""

    class Far(FastestMass):
        final_time = Parameter(2.6, unit="s", description="duration")

        def objective(self):
            return 0.0

        def integrand(self):
            return self.mass.u**2

        def constraints(self):
            yield from super().constraints()
            yield at(1.0, self.mass.x) == 0.3

    found = prepare(Far, parameters=["final_time"], elements=9).solve({"final_time": late})
    assert float(found.signal("mass.x")(1.0)) == pytest.approx(0.3, abs=1e-9)
    assert found.objective == pytest.approx(optimize(Far(final_time=late), elements=9).objective, rel=1e-7)
