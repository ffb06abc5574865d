"""Limits of variables in a run: told once with their time, or the run ends there; end stops hold what moves."""

import warnings

import numpy as np
import pytest

from gantrytau import Bounds, DoubtfulResult, Fixed, Model, ModelError, Real, connect, der, simulate
from gantrytau.mechanics import rotational, translational
from tests.mechanisms.rows import in_a_row


class Throw(Model):
    """Thrown upwards, x = v t - g t^2 / 2."""

    x = Real(unit="m", description="height", start=0.0, fixed=True, min=0.0, max=4.0)
    v = Real(unit="m/s", description="speed", start=9.81, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -9.81


UP = 1 - np.sqrt(1 - 8 / 9.81)  # s, where it passes 4 m


@pytest.mark.parametrize("points", [3, 12, 501])
def test_limits_are_told_once_with_their_time(points):
    with pytest.warns(DoubtfulResult) as told:
        simulate(Throw(), stop=2.2, points=points)
    (one,) = told
    words = str(one.message)
    assert "x passes its max of 4 m at t = 0.57046 s and comes to 4." in words
    assert "x passes its min of 0 m at t = 2 s and comes to -2.1" in words


def test_a_run_ends_at_a_limit_where_it_shall():
    result = simulate(Throw(), stop=2.2, limits="stop")
    assert result.time[-1] == pytest.approx(UP, abs=1e-5)
    assert result.ended == "x passes its max of 4 m"


@pytest.mark.parametrize(("model", "limits"), [(Throw(x=Bounds(-1, 6.0)), "warn"), (Throw(), None)])
def test_nothing_is_said_of_limits_that_are_kept_or_not_looked_at(model, limits):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(model, stop=2.0, limits=limits)


# A mass between stops.
Slide = in_a_row(
    "Slide",
    mass=translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(0.4)),
    stop=translational.EndStop(low=-0.1, high=0.2, a=0.0),
)


class Turning(Model):
    inertia = rotational.Inertia(J=2.0, phi=Fixed(0.0), w=Fixed(0.4))
    stop = rotational.EndStop(low=-0.1, high=0.2, c=1e6, a=0.0)

    def equations(self):
        yield connect(self.inertia.flange_a, self.stop.flange)


@pytest.mark.parametrize(
    ("model", "place", "speed"), [(Slide, "mass.s", "mass.v"), (Turning, "inertia.phi", "inertia.w")]
)
def test_an_elastic_stop_gives_the_speed_back(model, place, speed):
    """0.5 s to the upper stop, a contact of half a period pi sqrt(m / c), 0.75 s to the lower stop, a contact, and back."""
    result = simulate(model(), stop=2.0, outputs=[place, speed])
    assert np.abs(result[speed]).max() == pytest.approx(0.4, rel=1e-6)
    assert result[place].max() == pytest.approx(0.2, abs=0.4 * np.sqrt(2.0 / 1e6))
    left = 2.0 - 0.5 - 0.75 - 2 * np.pi * np.sqrt(2.0 / 1e6)
    assert result.final(place) == pytest.approx(-0.1 + 0.4 * left, abs=1e-6)


def test_a_stop_takes_what_its_dissipation_says():
    """1 - e = a v for small a v: log((1 + x) / (1 - e x)) = (1 + e) x with x = 3/2 a v."""
    result = simulate(Slide(stop=dict(a=0.3)), stop=1.0, outputs=["mass.v"])
    e, x = -result.final("mass.v") / 0.4, 1.5 * 0.3 * 0.4
    assert np.log((1 + x) / (1 - e * x)) == pytest.approx((1 + e) * x, rel=1e-5)


def test_stops_in_another_order_are_refused():
    with pytest.raises(ModelError, match="expected the lower end below the upper one"):
        simulate(Slide(stop=dict(low=0.3)), stop=1.0)
