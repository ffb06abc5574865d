"""Problems with known answers: the published or independently computed objective on the same mesh."""

import numpy as np
import pytest

from gantrytau import Start, between, time
from gantrytau_optimica import Free, optimize
from tests.optimica.problems import (
    BoundedOscillator,
    FastestMass,
    FastestOscillator,
    LinearQuadratic,
    Mass,
    Reactor,
)


@pytest.mark.parametrize(
    ("elements", "points", "value"), [(50, 3, 3.17619576), (100, 5, 3.17495079), (20, 8, 3.17620199)]
)
def test_van_der_pol_with_a_bounded_control(elements, points, value):
    assert optimize(BoundedOscillator, elements=elements, points=points).objective == pytest.approx(
        value, abs=1e-6
    )


def test_van_der_pol_in_minimum_time():
    assert optimize(FastestOscillator).final_time == pytest.approx(2.28115871, abs=1e-6)


def test_a_later_start_shifts_the_end():
    class Later(FastestOscillator):
        start_time = 5.0
        final_time = Free(7.0, unit="s", min=5.2)

    optimum = optimize(Later)
    assert optimum.final_time == pytest.approx(7.28115871, abs=1e-6)
    assert (optimum.time[0], optimum.time[-1]) == (5.0, optimum.final_time)


def test_an_integrand_that_depends_on_time():
    class Integrated(FastestOscillator):
        def integrand(self):
            return time

    optimum = optimize(Integrated)
    assert optimum.objective == pytest.approx(4.8830012, abs=1e-6)
    # the integral of t from 0 to T is T^2 / 2 whatever the motion is
    assert optimum.objective == pytest.approx(optimum.final_time + optimum.final_time**2 / 2, abs=1e-9)


def test_a_mass_between_two_rests():
    # accelerate for 1 s, brake for 1 s; the switch lies on the mesh
    assert optimize(FastestMass).final_time == pytest.approx(2.0, abs=1e-6)


def test_a_mass_with_limited_speed():
    class Limited(FastestMass):
        mass = Mass(u=dict(min=-1.0, max=1.0), v=dict(max=0.5))

    # 0.5 s to speed up, 0.5 s to brake and 0.75 m in between at 0.5 m/s; both switches on the mesh of 50
    assert optimize(Limited).final_time == pytest.approx(2.5, abs=1e-6)


def test_a_limit_in_constraints_acts_as_one_in_the_model():
    class Limited(FastestMass):
        def constraints(self):
            yield from super().constraints()
            yield between(-0.5, self.mass.v, 0.5)

    assert optimize(Limited).final_time == pytest.approx(2.5, abs=1e-6)


def test_linear_quadratic_between_given_ends():
    assert optimize(LinearQuadratic).objective == pytest.approx(50.9836626, abs=1e-6)


@pytest.mark.parametrize(("elements", "points", "value"), [(50, 3, 1857.68739), (75, 4, 1858.4286628)])
def test_reactor_of_hicks_and_ray(elements, points, value):
    guess = {"tank.c": 300.0, "tank.T": 300.0, "tank.Tc": 350.0}
    optimum = optimize(Reactor, elements=elements, points=points, guess=guess)
    assert optimum.objective == pytest.approx(value, abs=1e-5 if points == 3 else 1e-6)  # digits of the value
    assert np.max(optimum["tank.T"]) <= 350.0 + 1e-5


def test_a_guess_as_start_of_the_model_does_not_fix_it():
    class Free_(FastestMass):
        mass = Mass(u=dict(min=-1.0, max=1.0), x=Start(0.7))

    assert optimize(Free_).final_time == pytest.approx(2.0, abs=1e-6)
