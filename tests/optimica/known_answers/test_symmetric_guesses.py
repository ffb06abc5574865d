"""First guesses at a maximum or a saddle, which have no slope: they are left."""

import numpy as np
import pytest

from gantrytau import Fixed, Input, Real, cos, der
from gantrytau_optimica import Free, Optimization, final, optimize
from tests.optimica.problems import BoundedOscillator, Mass


def test_a_guess_at_the_maximum_is_left_for_either_side():
    class Farthest(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
        final_time = 1.0

        def objective(self):
            return -(final(self.mass.x) ** 2)

    optimum = optimize(Farthest)
    assert optimum.success
    assert optimum.status == "solved"
    assert optimum.objective == pytest.approx(-0.25, abs=1e-7)


def test_a_saddle_of_two_numbers_is_left_though_one_of_them_moved():
    class Hills(Optimization):
        x, y = Free(0.5), Free(0.0)

        def objective(self):
            return (self.x**2 - 1) ** 2 + (self.y**2 - 1) ** 2

    optimum = optimize(Hills)
    assert optimum.objective == pytest.approx(0.0, abs=1e-12)
    assert abs(optimum.free["y"]) == pytest.approx(1.0, abs=1e-6)


class Column(Optimization):
    """A column of length 1 under a load, clamped below: it buckles above pi^2 / 4 (Euler 1744)."""

    load = 0.0
    phi = Real(start=0.0, fixed=True)
    bend = Input()
    final_time = 1.0

    def equations(self):
        yield der(self.phi) == self.bend

    def integrand(self):
        return self.bend**2 / 2 + self.load * (cos(self.phi) - 1)


@pytest.mark.parametrize("load", [2.4, 2.6])
def test_a_column_stays_straight_up_to_its_load(load):
    optimum = optimize(Column(load=load), elements=20)
    bent = np.max(np.abs(optimum["phi"]))
    # near the load, phi^2 is about 8 (1 - critical / load)
    critical = np.pi**2 / 4
    assert bent == pytest.approx(np.sqrt(8 * max(1 - critical / load, 0.0)), abs=0.03)


def test_a_minimum_is_not_searched_again():
    class Rest(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = 1.0

        def integrand(self):
            return self.mass.u**2 + self.mass.x**2

    optimum = optimize(Rest)
    assert optimum.iterations <= 1
    assert optimum.status == "solved"
    assert optimum.objective == 0.0


def test_steps_without_regularisation_tell_a_minimum():
    assert optimize(BoundedOscillator, elements=20).solution.upright
