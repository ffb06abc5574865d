"""Problems without time, and those that only look so: time may enter through a cost, a limit or a known input."""

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, Parameter, Real, Start, between, der, exp, time
from gantrytau_optimica import Free, Optimization, final, initial, optimize, prepare
from tests.optimica.known_answers.known_problems import zero
from tests.optimica.problems import FastestMass, Mass


class Doubled(Model):
    """Nothing changes by itself: y = 2 u + w."""

    u = Input(description="chosen")
    w = Input(description="chosen or known")
    y = Real(description="what follows")

    def equations(self):
        yield self.y == 2 * self.u + self.w


class Tracked(Optimization):
    """Follow the time with an input that ends at 1/2."""

    model = Doubled(u=dict(max=0.5), w=0.0)
    second = Parameter(1.0, unit="s", description="one second")

    def integrand(self):
        return (self.model.u - time / self.second) ** 2


def test_a_cost_that_depends_on_time_is_not_static():
    # t - 1/2 is missed in the second half: integral of s^2 from 0 to 1/2
    assert optimize(Tracked, elements=10).objective == pytest.approx(1 / 24, abs=1e-6)


def test_a_limit_that_depends_on_time_is_not_static():
    class Above(Optimization):
        model = Doubled(w=0.0)
        second = Parameter(1.0, unit="s", description="one second")

        def integrand(self):
            return self.model.u**2

        def constraints(self):
            yield self.model.u >= time / self.second

    assert optimize(Above, elements=10).objective == pytest.approx(1 / 3, abs=1e-6)


@pytest.mark.parametrize("course", [lambda t: t, ([0.0, 1.0], [0.0, 1.0])])
def test_a_known_input_that_changes_is_not_static(course):
    class Driven(Optimization):
        model = Doubled()
        inputs = {"model.w": course}

        def integrand(self):
            return self.model.u**2 + self.model.y**2

    # u = -2 w / 5 leaves w^2 / 5
    assert optimize(Driven, elements=10).objective == pytest.approx(1 / 15, abs=1e-6)


def test_a_static_problem_has_one_value():
    class Still(Optimization):
        model = Doubled(w=0.3)

        def objective(self):
            return (self.model.y - 1) ** 2 + self.model.u**2

    # (2 u - 0.7)^2 + u^2 is least at u = 1.4 / 5
    optimum = optimize(Still)
    assert optimum.objective == pytest.approx(0.14**2 + 0.28**2, abs=1e-8)
    np.testing.assert_allclose(optimum["model.u"], 0.28, atol=1e-7)
    np.testing.assert_allclose(optimum["model.y"], 0.86, atol=1e-7)


def test_a_static_problem_refined_has_one_value():
    class Still(Optimization):
        model = Doubled(w=0.3)

        def objective(self):
            return (self.model.y - 1) ** 2 + self.model.u**2

    np.testing.assert_allclose(optimize(Still, refine=1e-6)["model.u"], 0.28, atol=1e-6)


def test_free_numbers_by_the_name_of_their_vector():
    class Nearest(Optimization):
        """The point of x + 2 y + 2 z = 9 next to the origin: (1, 2, 2)."""

        p = Free([3.0, 0.0, 1.0], min=-5.0, max=5.0, description="point")

        def objective(self):
            return self.p[0] ** 2 + self.p[1] ** 2 + self.p[2] ** 2

        def constraints(self):
            yield self.p[0] + 2 * self.p[1] + 2 * self.p[2] == 9

    optimum = optimize(Nearest, guess={"p": [0.0, 1.0, 0.0]})
    assert optimum.objective == pytest.approx(9.0, abs=1e-7)
    np.testing.assert_allclose(optimum["p"], [1.0, 2.0, 2.0], atol=1e-7)
    assert optimum["p[1]"] == pytest.approx(2.0, abs=1e-7)


def test_an_implicit_initial_equation_with_a_free_number():
    """The start is where x e^x = k: the least k that lets x decay to 1/2 in 1 s is (e/2) exp(e/2)."""

    class Decay(Model):
        k = Parameter(1.0, description="what the start follows from")
        rate = Parameter(1.0, unit="1/s", description="rate")
        x = Real(start=1.0)

        def equations(self):
            yield der(self.x) == -self.rate * self.x

        def initial_equations(self):
            yield self.x * exp(self.x) == self.k

    class Least(Optimization):
        decay = Decay(k=Free(1.0, min=0.1, max=50.0))

        def objective(self):
            return self.decay.k

        def constraints(self):
            yield final(self.decay.x) >= 0.5

    start = np.e / 2
    optimum = optimize(Least, elements=10)
    assert optimum["decay.k"] == pytest.approx(start * np.exp(start), abs=1e-6)
    root = zero(lambda x: x * np.exp(x) - optimum["decay.k"], 0.0, 5.0)
    assert optimum["decay.x"][0] == pytest.approx(root, abs=1e-7)


def test_a_free_start_time_alone():
    class Late(FastestMass):
        """Arrive at 5 s, leave as late as possible."""

        start_time = Free(1.0, unit="s", min=0.0, max=4.9)
        final_time = 5.0

        def objective(self):
            return -self.start_time

    optimum = optimize(Late)
    assert optimum.start_time == pytest.approx(3.0, abs=1e-6)
    assert optimum["start_time"] == optimum.start_time == optimum.time[0]
    assert optimum.time[-1] == 5.0


def test_limits_of_eliminated_variables_with_offset_and_factor():
    class Geared(Mass):
        shown = Real(unit="m", min=-3.0, description="minus two x and one")
        one = Parameter(1.0, unit="m", description="offset of the scale")

        def equations(self):
            yield from super().equations()
            yield self.shown == self.one - 2 * self.x

    class Far(Optimization):
        mass = Geared(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
        final_time = 10.0

        def objective(self):
            return -final(self.mass.x)

    # 1 - 2 x >= -3: x <= 2
    optimum = optimize(Far, elements=20)
    assert optimum.objective == pytest.approx(-2.0, abs=1e-6)
    assert np.max(optimum["mass.x"]) <= 2 + 1e-6


def test_a_limit_of_an_eliminated_variable_may_hold_a_free_number():
    class Copied(Mass):
        top = Parameter(1.0, unit="m/s", description="top speed")
        speed = Real(unit="m/s", max=lambda self: self.top, description="another name")

        def equations(self):
            yield from super().equations()
            yield self.speed == self.v

    class Cheap(FastestMass):
        mass = Copied(u=dict(min=-1.0, max=1.0), top=Free(0.4, unit="m/s", min=0.1, max=0.5))

    # the faster the better: the upper limit 1/2, hence 2.5 s
    optimum = optimize(Cheap)
    assert optimum["mass.top"] == pytest.approx(0.5, abs=1e-6)
    assert optimum.final_time == pytest.approx(2.5, abs=1e-5)


def test_one_static_problem_solved_for_many_parameters():
    class Still(Optimization):
        model = Doubled(w=0.0)
        target = Parameter(1.0, description="wanted")

        def objective(self):
            return (self.model.y - self.target) ** 2

        def constraints(self):
            yield between(-1, self.model.u, 1)

    prepared = prepare(Still, parameters=["target"])
    for target, value in ((1.0, 0.5), (-3.0, -1.0), (0.2, 0.1)):
        np.testing.assert_allclose(prepared.solve({"target": target})["model.u"], value, atol=1e-5)


def test_a_static_problem_with_values_at_two_times_moves():
    class Two(Optimization):
        model = Doubled(w=0.0, u=Start(0.1))

        def objective(self):
            return (initial(self.model.y) - 1) ** 2 + (final(self.model.y) - 3) ** 2

    assert optimize(Two, elements=2).objective == pytest.approx(0.0, abs=1e-8)
