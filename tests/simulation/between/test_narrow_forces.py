"""Forces that are narrow along a path are felt, whatever the steps of the integrator and the output."""

import numpy as np
import pytest

from gantrytau import Model, Real, der, exp, fabs, pre, reinit, simulate, when

NEAR = 1e-6  # of the speed: a hundred times the tolerance, as the hill amplifies errors where the mass turns


def thrown(width: float, middle: float, points: int):
    """A mass of 0.5 J thrown against a hill of 1 J, and its energy."""

    class Flight(Model):
        x = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)

        def equations(self):
            way = (self.x - middle) / width
            yield der(self.x) == self.v
            yield der(self.v) == 2 * way / width * exp(-(way**2))

    found = simulate(Flight(), stop=10.0, points=points)
    return found, found["v"] ** 2 / 2 + np.exp(-(((found["x"] - middle) / width) ** 2))


@pytest.mark.parametrize(
    ("width", "middle", "points"), [(0.3, 5.123, 2), (0.01, 5.0, 501), (0.01, 5.123, 11)]
)
def test_a_mass_comes_back_from_a_hill_that_it_cannot_climb(width, middle, points):
    found, energy = thrown(width, middle, points)
    assert abs(found.final("v") + 1) < NEAR
    assert np.ptp(energy) < NEAR


def test_a_force_whose_square_is_no_number_stops_nothing():
    """At 2.8 m it is 1e-157 N, the square of which is below all numbers."""
    found, _ = thrown(0.1, 4.7, 501)
    assert abs(found.final("v") + 1) < NEAR


def test_a_wall_is_not_passed_in_a_long_run():
    """Between a wall and a narrow hill, against which it has half of the energy, a mass never gets behind the hill."""

    class Court(Model):
        x = Real(start=-1.0, fixed=True)
        v = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == 2 * self.x / 0.01**2 * exp(-((self.x / 0.01) ** 2))
            yield when(fabs(self.x) >= 1, reinit(self.v, -pre(self.v)))

    assert simulate(Court(), stop=100.0)["x"].max() < 0


@pytest.mark.nightly
@pytest.mark.parametrize("points", [2, 11, 501])
@pytest.mark.parametrize("middle", [4.7, 5.0, 5.123, 5.3, 5.5])
@pytest.mark.parametrize("width", [0.3, 0.2, 0.15, 0.1, 0.08, 0.05, 0.03, 0.02, 0.01])
def test_hills_of_all_widths(width, middle, points):
    found, _ = thrown(width, middle, points)
    assert abs(found.final("v") + 1) < NEAR
