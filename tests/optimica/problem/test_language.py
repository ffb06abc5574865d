"""What can be said in a problem, each on a problem with a known answer."""

import numpy as np
import pytest

from gantrytau import (
    Fixed,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    between,
    der,
    simulate,
    sin,
    time,
)
from gantrytau_optimica import Free, Optimization, at, final, initial, optimize, prepare
from tests.optimica.problems import FastestMass, LaunchedMass, LinearQuadratic, Mass


class Steered(Optimization):
    """Least effort from rest at 0 to rest at 1 in 1 s: u = 6 - 12 t, cost 12, x = 3 t^2 - 2 t^3."""

    mass = Mass(x=Fixed(0.0), v=Fixed(0.0))

    def integrand(self):
        return self.mass.u**2

    def constraints(self):
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


def test_signal_integral_breaks_and_names():
    optimum = optimize(Steered, elements=10)
    assert optimum.objective == pytest.approx(12.0, abs=1e-6)
    t = np.linspace(0.0, 1.0, 37)
    np.testing.assert_allclose(optimum.signal("mass.u")(t), 6 - 12 * t, atol=1e-6)
    np.testing.assert_allclose(optimum.signal("der(mass.v)")(t), 6 - 12 * t, atol=1e-6)
    np.testing.assert_allclose(optimum.signal("mass.x")(t), 3 * t**2 - 2 * t**3, atol=1e-7)
    assert float(optimum.signal("mass.x")(0.5)) == pytest.approx(0.5, abs=1e-8)
    assert optimum.integral("mass.v") == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(optimum.breaks, np.arange(1, 10) / 10)
    assert optimum.time.size == 31
    assert {"mass.x", "mass.v", "mass.u"} <= set(optimum.names)
    assert "mass.x" in optimum
    assert "mass.z" not in optimum
    assert optimum.final("mass.x") == pytest.approx(1.0)
    assert repr(optimum).startswith("<Optimum Steered: solved, objective 12")
    with pytest.raises(ModelError, match=r"mass\.z"):
        optimum["mass.z"]


def test_the_optimum_simulates_to_the_same_end():
    optimum = optimize(Steered, elements=10)
    t = np.linspace(0.0, 1.0, 101)
    mass, samples = Mass(x=Fixed(0.0), v=Fixed(0.0)), (t, optimum.signal("mass.u")(t))
    found = simulate(mass, stop=1.0, inputs={"u": samples}, tolerance=1e-10)
    # the optimum obeys the motion to the tolerance of Ipopt, its input is linear, so samples carry it whole
    assert found.final("x") == pytest.approx(1.0, abs=1e-7)
    assert found.final("v") == pytest.approx(0.0, abs=1e-7)
    again = simulate(mass, stop=1.0, inputs={"u": lambda t: 6 - 12 * t}, tolerance=1e-10)
    np.testing.assert_allclose(again["x"], optimum.signal("mass.x")(again.time), atol=1e-6)


def test_a_free_parameter_takes_its_best_value():
    class Tuned(Steered):
        push = Free(1.0, unit="m/s2", min=0.0, max=9.0, description="constant push")

        def integrand(self):
            return 0.0

        def objective(self):
            return (final(self.mass.x) - 1) ** 2

        def constraints(self):
            yield self.mass.u == self.push

    optimum = optimize(Tuned, elements=5)
    assert optimum["push"] == pytest.approx(2.0, abs=1e-4)
    assert optimum.free == {"push": optimum["push"]}


def test_a_free_parameter_of_a_component():
    class Rate(Model):
        k = Parameter(2.0, unit="m/s", description="rate")
        x = Real(unit="m", description="way", start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == self.k

    class Fit(Optimization):
        model = Rate(k=Free(1.0, unit="m/s", min=0.0, max=5.0))
        final_time = 2.0

        def objective(self):
            return (final(self.model.x) - 3) ** 2

    assert optimize(Fit)["model.k"] == pytest.approx(1.5, abs=1e-4)


def test_a_free_initial_value():
    assert optimize(LaunchedMass)["mass.v"][0] == pytest.approx(1.5, abs=1e-6)

    class Limited(LaunchedMass):
        mass = Mass(x=Fixed(0.0), v=Start(Free(1.0, max=1.2)), u=0.0)

    assert optimize(Limited)["mass.v"][0] == pytest.approx(1.2, abs=1e-6)

    class Released(LaunchedMass):
        mass = Mass(x=Fixed(0.0), v=Fixed(Free(1.0)), u=0.0)

    assert optimize(Released)["mass.v"][0] == pytest.approx(1.5, abs=1e-6)


def test_a_limit_may_be_a_free_number():
    class Motor(FastestMass):
        mass = Mass()
        limit = Free(1.0, unit="m/s2", min=0.1, max=4.0, description="strength of the motor")

        def constraints(self):
            yield from super().constraints()
            yield between(-self.limit, self.mass.u, self.limit)

    optimum = optimize(Motor)
    assert optimum["limit"] == pytest.approx(4.0, abs=1e-6)
    assert optimum.final_time == pytest.approx(1.0, abs=1e-6)  # 2 / sqrt(4)


def test_a_limit_may_vary_with_signals_and_time():
    class Slowing(FastestMass):
        lead = Parameter(2.0, unit="1/s", description="speed per distance to the end")

        def constraints(self):
            yield from super().constraints()
            yield self.mass.v <= self.lead * (1 - self.mass.x)

    # v <= 2 (1 - x) and v' >= -1: the last part is approached ever more slowly than by braking alone
    slowed = optimize(Slowing)
    assert slowed.final_time > 2.0
    assert np.all(slowed["mass.v"][1:] <= 2 * (1 - slowed["mass.x"][1:]) + 1e-6)

    class Ramp(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0))
        rise = Parameter(1.0, unit="m/s3", description="rise of the limit")

        def objective(self):
            return -final(self.mass.v)

        def constraints(self):
            yield between(-self.rise * time, self.mass.u, self.rise * time)

    assert optimize(Ramp).final("mass.v") == pytest.approx(0.5, abs=1e-6)


def test_values_at_times_inside_of_elements():
    class Via(Steered):
        def constraints(self):
            yield from super().constraints()
            yield at(0.123, self.mass.x) == 0.3

    optimum = optimize(Via, elements=7)
    assert float(optimum.signal("mass.x")(0.123)) == pytest.approx(0.3, abs=1e-9)

    class FreeVia(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield at(0.37 * self.final_time, self.mass.x) == 0.25

    found = optimize(FreeVia)
    assert float(found.signal("mass.x")(0.37 * found.final_time)) == pytest.approx(0.25, abs=1e-9)
    # without the way point it would be 2 * 0.37^2 = 0.2738 there
    assert found.final_time > 2.0


def test_expressions_of_values_at_times():
    class Return(Optimization):
        mass = Mass()

        def integrand(self):
            return self.mass.u**2

        def constraints(self):
            yield initial(self.mass.x) == 0
            yield final(self.mass.x) - initial(self.mass.x) == at(0.5, self.mass.x) + 0.5
            yield initial(self.mass.v) == final(self.mass.v)

    # coasting at 1 m/s does it for nothing
    optimum = optimize(Return, elements=4)
    assert optimum.objective == pytest.approx(0.0, abs=1e-8)
    np.testing.assert_allclose(optimum["mass.v"], 1.0, atol=1e-5)


def test_initial_equations_of_the_model_hold():
    class Balanced(Mass):
        def initial_equations(self):
            yield self.x + 2 * self.one * self.v == 3

        one = Parameter(1.0, unit="s", description="one second")

    class Held(Optimization):
        mass = Balanced(u=0.0)

        def objective(self):
            return (final(self.mass.x)) ** 2

    optimum = optimize(Held, elements=2)
    assert optimum["mass.x"][0] + 2 * optimum["mass.v"][0] == pytest.approx(3.0, abs=1e-8)


def test_first_guesses_of_every_kind():
    reference = optimize(LinearQuadratic)
    guesses = [
        {"mass.x": 2.0},
        {"mass.x": lambda t: 1 + t, "mass.u": np.sin},
        {"mass.v": np.array([1.0])},
        reference.result,
        reference,
    ]
    for guess in guesses:
        assert optimize(LinearQuadratic, guess=guess).objective == pytest.approx(50.9836626, abs=1e-6)


def test_a_guess_of_a_vector():
    class Plane(Model):
        r = Real(2, unit="m", description="position", start=0.0, fixed=True)
        v = Input(2, unit="m/s", description="speed")

        def equations(self):
            yield der(self.r) == self.v

    class Move(Optimization):
        plane = Plane()

        def integrand(self):
            return self.plane.v[0] ** 2 + self.plane.v[1] ** 2

        def constraints(self):
            yield final(self.plane.r) == [1, 2]

    for guess in ({"plane.r": [0.5, 1.0]}, {"plane.r": lambda t: [t, 2 * t], "plane.v[1]": 2.0}):
        optimum = optimize(Move, elements=3, guess=guess)
        assert optimum.objective == pytest.approx(5.0, abs=1e-7)
        assert optimum["plane.r"].shape == (10, 2)


def test_an_algebraic_loop_without_closed_form():
    class Kepler(Model):
        m = Real(unit="1", description="mean anomaly", start=0.0, fixed=True)
        e = Real(unit="1", description="eccentric anomaly", start=0.0)
        u = Input(unit="1/s", description="rate")

        def equations(self):
            yield der(self.m) == self.u
            yield self.e - 0.5 * sin(self.e) == self.m

    class Reach(Optimization):
        orbit = Kepler()

        def integrand(self):
            return self.orbit.u**2

        def constraints(self):
            yield final(self.orbit.e) == 2

    optimum = optimize(Reach, elements=5)
    mean = 2 - 0.5 * np.sin(2)
    assert optimum.objective == pytest.approx(mean**2, abs=1e-7)  # at constant rate
    e = optimum["orbit.e"][1:]
    np.testing.assert_allclose(e - 0.5 * np.sin(e), optimum["orbit.m"][1:], atol=1e-8)


def test_one_program_solved_for_many_parameters():
    class To(FastestMass):
        target = Parameter(1.0, unit="m", description="where to")
        strength = Parameter(1.0, unit="m/s2", description="strength of the motor")
        mass = Mass()

        def constraints(self):
            yield initial(self.mass.x) == 0
            yield initial(self.mass.v) == 0
            yield final(self.mass.x) == self.target
            yield final(self.mass.v) == 0
            yield between(-self.strength, self.mass.u, self.strength)

    assert optimize(To(target=4.0)).final_time == pytest.approx(4.0, abs=1e-6)
    prepared = prepare(To, parameters=["target", "strength"])
    for target, strength in ((1.0, 1.0), (9.0, 1.0), (4.0, 4.0), (1.0, 1.0)):
        optimum = prepared.solve({"target": target, "strength": strength})
        assert optimum.final_time == pytest.approx(2 * np.sqrt(target / strength), abs=1e-6)
        assert optimum.signal("target")(0.0) == target
        assert list(optimum.free) == ["final_time"]
    assert prepared.solve().final_time == pytest.approx(2.0, abs=1e-6)
    with pytest.raises(ModelError, match=r"mass.x is no parameter"):
        prepare(To, parameters=["mass.x"])
    with pytest.raises(ModelError, match=r"found parameters=\['target'\], expected some of"):
        prepare(To, parameters=["strength"]).solve({"target": 1.0})
    with pytest.raises(ModelError, match=r"target: found nan, expected 1 finite number"):
        prepared.solve({"target": np.nan})
