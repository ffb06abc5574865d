"""Rates of inputs in limits, costs and equations: the input is continuous, and its rate is what is chosen."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, ModelError, Parameter, Real, between, der, simulate, translate
from gantrytau_optimica import (
    Free,
    Optimization,
    final,
    initial,
    link,
    load_optimum,
    optimize,
    prepare,
    save_optimum,
    sensitivities,
)
from tests.optimica.problems import Mass

SOLVED = 1e-6  # a hundred times the tolerance of the solver


class Jerked(Optimization):
    """From rest to rest, without force at the ends, in the least time: the force is a triangle forth and back."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0))
    rate = Parameter(32.0, unit="m/s3", description="largest rate of the force")
    final_time: Any = Free(1.5, unit="s", min=0.1, max=20.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield between(-self.rate, der(self.mass.u), self.rate)
        yield initial(self.mass.u) == 0
        yield final(self.mass.u) == 0
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


def least_time(distance=1.0, rate=32.0):
    """Four stretches of T/4 with the full rate: +, -, -, +."""
    return (32 * distance / rate) ** (1 / 3)


def test_a_limit_on_the_rate_of_an_input():
    optimum = optimize(Jerked, elements=40)  # borders at the switches
    assert optimum.objective == pytest.approx(least_time(), rel=SOLVED)
    t = np.linspace(0.0, optimum.final_time, 4001)
    force, rate = optimum.signal("mass.u")(t), optimum.signal("der(mass.u)")(t)
    assert np.max(np.abs(rate)) <= 32 * (1 + SOLVED)
    exact = np.interp(t, np.array([0, 0.25, 0.75, 1]) * t[-1], [0, 8, -8, 0])
    np.testing.assert_allclose(force, exact, atol=1e-3)
    steps = np.diff(force) / np.diff(t)  # the rate, but across the two switches
    assert np.sort(np.abs(steps - rate[:-1]))[-5] < 1e-3
    assert optimum["der(mass.u)"].shape == optimum["mass.u"].shape == optimum.time.shape
    assert optimum["mass.u"][0] == pytest.approx(0.0, abs=SOLVED)
    assert optimum.playback.violation < SOLVED
    assert optimum.playback.defect < SOLVED


def test_the_model_is_what_it_was():
    optimum = optimize(Jerked, elements=40)
    dae = translate(Mass(x=Fixed(0.0), v=Fixed(0.0)))
    assert dae.inputs == ("u",)
    assert dae.states == ("x", "v")
    t = np.linspace(0.0, optimum.final_time, 2001)
    found = simulate(dae, stop=optimum.final_time, inputs={"u": (t, optimum.signal("mass.u")(t))})
    assert found.final("x") == pytest.approx(1.0, abs=1e-5)  # straight lines between 2001 samples
    assert found.final("v") == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    "policy", [dict(scheme="shooting"), dict(scheme="gauss"), dict(points=1), dict(elements=37)]
)
def test_whatever_the_mesh(policy):
    optimum = optimize(Jerked, **{"elements": 50, **policy})
    assert optimum.objective == pytest.approx(least_time(), rel=1e-2 if "points" in policy else 1e-3)
    t = np.linspace(0.0, optimum.final_time, 4001)
    assert np.max(np.abs(optimum.signal("der(mass.u)")(t))) <= 32 * (1 + SOLVED)
    assert np.max(np.abs(np.diff(optimum.signal("mass.u")(t)))) <= 32 * (1 + 1e-3) * t[1]  # it never jumps


def test_it_is_refined():
    optimum = optimize(Jerked, elements=7, refine=1e-6)
    assert optimum.refinement.reached
    assert optimum.objective == pytest.approx(least_time(), rel=2e-6)
    assert {s.name for s in optimum.refinement.switches} == {"der(mass.u)"}
    assert len(optimum.refinement.switches) == 2


def test_limits_of_input_and_rate_together():
    class Both(Jerked):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-4.0, max=4.0))

    optimum = optimize(Both, elements=80)
    t = np.linspace(0.0, optimum.final_time, 2001)
    assert np.max(np.abs(optimum.signal("mass.u")(t))) <= 4 * (1 + 1e-3)
    # trapezia with ramps of 1/8 s: 1 = a t1 (t1 + tr), T = 2 (t1 + 2 tr), a = 4, tr = 1/8, t1 the flat part and a ramp
    ramp, top = 4 / 32, 4.0
    whole = (-ramp + np.sqrt(ramp**2 + 4 / top)) / 2  # of top and one ramp
    assert optimum.objective == pytest.approx(2 * (whole + ramp), rel=1e-3)


class Smooth(Optimization):
    """The least square of the rate: the motion of least jerk, 720 d^2 / T^5."""

    mass = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(start=0.0, fixed=True))
    final_time = 2.0

    def integrand(self):
        return der(self.mass.u) ** 2

    def constraints(self):
        yield final(self.mass.u) == 0
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


def test_a_cost_on_the_rate_and_a_fixed_start_of_the_input():
    optimum = optimize(Smooth, elements=40)
    assert optimum.objective == pytest.approx(720 / 2.0**5, rel=1e-3)  # ramps for a parabola
    s = optimum.time / 2.0
    np.testing.assert_allclose(optimum["mass.x"], s**3 * (10 - 15 * s + 6 * s**2), atol=1e-4)
    assert optimum["mass.u"][0] == pytest.approx(0.0, abs=SOLVED)


class Geared(Model):
    """A hand moves x by a gear; its speed is an equation of the model."""

    hand = Input(unit="m", description="position of the hand")
    speed = Real(unit="m/s", description="of the hand")
    x = Real(unit="m", start=0.0, fixed=True, description="follows by the speed")

    def equations(self):
        yield self.speed == der(self.hand)
        yield der(self.x) == 2 * self.speed


def test_a_model_that_needs_the_rate_of_its_input():
    class Reach(Optimization):
        geared = Geared()

        def integrand(self):
            return self.geared.speed**2

        def constraints(self):
            yield initial(self.geared.hand) == 0.5
            yield final(self.geared.x) == 1

    optimum = optimize(Reach, elements=5)
    assert optimum.objective == pytest.approx(0.25, abs=SOLVED)
    assert optimum["geared.hand"][-1] == pytest.approx(1.0, abs=SOLVED)
    np.testing.assert_allclose(optimum["geared.speed"], 0.5, atol=SOLVED)


def test_rates_of_rates():
    class Snapped(Smooth):
        """The least square of the second rate: 100800 d^2 / T^7."""

        def integrand(self):
            return der(der(self.mass.u)) ** 2

        def constraints(self):
            yield from super().constraints()
            yield initial(der(self.mass.u)) == 0
            yield final(der(self.mass.u)) == 0

    optimum = optimize(Snapped, elements=40)
    assert optimum.objective == pytest.approx(100800 / 2.0**7, rel=1e-3)
    assert optimum["der(der(mass.u))"].shape == optimum.time.shape


def test_an_input_under_another_name_and_factor():
    class Driven(Model):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0))
        current = Input(unit="m/s2", description="twice of it is the force")

        def equations(self):
            yield self.mass.u == 2 * self.current

    class Through(Jerked):
        mass = Driven()

        def constraints(self):
            m = self.mass.mass
            yield between(-self.rate, der(m.u), self.rate)
            yield from (initial(m.u) == 0, final(m.u) == 0, final(m.x) == 1, final(m.v) == 0)

    optimum = optimize(Through, elements=40)
    assert optimum.objective == pytest.approx(least_time(), rel=SOLVED)
    np.testing.assert_allclose(optimum["der(mass.mass.u)"], 2 * optimum["der(mass.current)"])


def test_blocked_inputs_are_asked_of_the_rate():
    optimum = optimize(Jerked, elements=40, controls={"der(mass.u)": dict(kind="constant", elements=10)})
    assert optimum.objective == pytest.approx(least_time(), rel=SOLVED)
    t = np.linspace(0.01, 0.24, 9) * optimum.final_time
    np.testing.assert_allclose(optimum.signal("mass.u")(t), 32 * t, rtol=1e-4)
    for name, words in (
        ("mass.u", r"controls: mass\.u follows from der\(mass\.u\), .* write 'der\(mass\.u\)'"),
        (
            "der(der(mass.u))",
            r"controls: der\(der\(mass\.u\)\) is not part of the problem, expected 'der\(mass\.u\)'",
        ),
        ("der(mass.v)", r"controls: der\(mass\.v\) is no input that the optimiser chooses"),
    ):
        with pytest.raises(ModelError, match=words):
            optimize(Jerked, controls={name: "constant"})
    with pytest.raises(ModelError, match=r"der\(mass\.u\) is not part of the problem, expected 'mass\.u'"):
        optimize(Plain, controls={"der(mass.u)": "constant"})


class Plain(Optimization):
    """Least effort, without rates."""

    mass = Mass(x=Fixed(0.0), v=Fixed(0.0))

    def integrand(self):
        return self.mass.u**2

    def constraints(self):
        yield final(self.mass.x) == 1


def test_an_input_without_a_model_around_it():
    class Alone(Model):
        u = Input(description="all there is")

    class Ramp(Optimization):
        alone = Alone()
        final_time = Free(1.0, min=0.1, max=10.0)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield der(self.alone.u) <= 0.5
            yield initial(self.alone.u) == 0
            yield final(self.alone.u) == 1

    assert optimize(Ramp, elements=4).objective == pytest.approx(2.0, abs=SOLVED)


class Onward(Jerked):
    """From where the first ended to twice the distance."""

    mass: Any = Mass()
    start_time: Any = Free(1.0, unit="s")
    final_time: Any = Free(2.5, unit="s")

    def constraints(self):
        yield between(-self.rate, der(self.mass.u), self.rate)
        yield final(self.mass.x) == 2
        yield final(self.mass.v) == 0
        yield final(self.mass.u) == 0


class First(Jerked):
    """Passes 1 m with whatever force and speed."""

    def constraints(self):
        yield between(-self.rate, der(self.mass.u), self.rate)
        yield initial(self.mass.u) == 0
        yield final(self.mass.x) == 1


def test_the_input_goes_on_in_the_next_phase():
    class Two(Optimization):
        first = First()
        onward = Onward()

        def objective(self):
            return self.onward.final_time

        def constraints(self):
            yield link(self.first, self.onward)

    optimum = optimize(Two, elements=20)
    # one motion of 2 m: half the way in half the time
    assert optimum.final("onward.final_time") == pytest.approx(least_time(2.0), rel=1e-5)
    assert optimum["onward.mass.u"][0] == pytest.approx(optimum["first.mass.u"][-1], abs=1e-5)


def test_sensitivities_to_the_rate():
    prepared = prepare(Jerked, parameters=["rate"], elements=40)
    optimum = prepared.solve()
    # T = (32 d / r)^(1/3): dT/dr = -T / (3 r)
    assert sensitivities(optimum, ["rate"]).objective["rate"] == pytest.approx(-1 / 96, rel=1e-4)
    assert prepared.solve({"rate": 4.0}).objective == pytest.approx(2.0, rel=SOLVED)


def test_it_is_saved_and_is_a_guess(tmp_path):
    optimum = optimize(Jerked, elements=40)
    save_optimum(optimum, tmp_path / "a.optimum")
    copy = load_optimum(tmp_path / "a.optimum")
    t = np.linspace(0.0, optimum.final_time, 101)
    for name in ("mass.u", "der(mass.u)"):
        np.testing.assert_allclose(copy.signal(name)(t), optimum.signal(name)(t), atol=1e-9)
    for guess in (optimum, copy, optimum.result, {"mass.u": 1.0, "der(mass.u)": 2.0}):
        again = optimize(Jerked, elements=40, guess=guess)
        assert again.objective == pytest.approx(least_time(), rel=SOLVED)


def test_several_first_guesses():
    found = optimize(Jerked, elements=40, starts=3)
    assert found.objective == pytest.approx(least_time(), rel=SOLVED)
