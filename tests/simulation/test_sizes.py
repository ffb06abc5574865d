"""Small is relative to `nominal`, or to what the motion shows: the same digits at every scale."""

import math
from typing import Any

import numpy as np
import pytest

from gantrytau import (
    Input,
    Model,
    Parameter,
    Real,
    Start,
    cos,
    der,
    exp,
    if_else,
    simulate,
    sin,
    time,
    translate,
)
from gantrytau.simulation.motion import all_coordinates
from gantrytau.simulation.state_sizes import first_sizes
from gantrytau_models import Pendulum

NEAR = 1e-5  # of the amplitude: a thousand times the tolerance, over sixteen periods


def oscillator(size: float, *, nominal: bool, beside: float = 0.0) -> Model:
    """x = size cos 5 t, with a decay beside it."""
    one: dict[str, Any] = {"nominal": size} if nominal else {}
    five: dict[str, Any] = {"nominal": 5 * size} if nominal else {}

    class Oscillator(Model):
        x = Real(start=size, fixed=True, **one)
        v = Real(start=0.0, fixed=True, **five)
        y = Real(start=beside, fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -25 * self.x
            yield der(self.y) == -self.y

    return Oscillator()


@pytest.mark.parametrize("beside", [0.0, 1.0, 1e15])
@pytest.mark.parametrize("nominal", [False, True])
@pytest.mark.parametrize("size", [1.0, 1e-6, 1e-9, 1e-30, 1e15])
def test_an_oscillator_has_the_same_digits_at_every_size(size, nominal, beside):
    found = simulate(oscillator(size, nominal=nominal, beside=beside), stop=20.0)
    np.testing.assert_allclose(found["x"] / size, np.cos(5 * found.time), rtol=0, atol=NEAR)
    np.testing.assert_allclose(found["y"], beside * np.exp(-found.time), rtol=0, atol=1e-7 * beside)


def test_a_small_motion_that_begins_at_rest():
    class Pushed(Model):
        f = Input()
        x = Real(start=0.0, fixed=True)
        v = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -25 * self.x + self.f

    found = simulate(Pushed(), stop=20.0, inputs={"f": lambda t: if_else(t > 1, 25e-9, 0.0)})
    exact = np.where(found.time > 1, 1 - np.cos(5 * (found.time - 1)), 0.0)
    np.testing.assert_allclose(found["x"] / 1e-9, exact, rtol=0, atol=NEAR)


@pytest.mark.parametrize("length", [1e-6, 1e-3, 1e3])
def test_a_pendulum_of_any_length_keeps_its_rod(length):
    second = math.sqrt(length)  # of the pendulum of one metre
    model = Pendulum(L=length, x=Start(0.8 * length), y=Start(-0.6 * length))
    found = simulate(model, stop=10 * second, points=101)
    alike = simulate(Pendulum(L=1.0, x=Start(0.8), y=Start(-0.6)), stop=10.0, points=101)
    rod = np.hypot(found["x"], found["y"]) / length
    np.testing.assert_allclose(rod, 1.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["x"] / length, alike["x"], rtol=0, atol=NEAR)


def test_what_is_given_small_among_large_states_counts():
    class Mixed(Model):
        k = Parameter(1.0)
        large = Real(start=1.0, fixed=True)
        small = Real(start=1e-9, fixed=True)

        def equations(self):
            yield der(self.large) == -self.k * self.large
            yield der(self.small) == -self.large * self.small

    found = simulate(Mixed(), stop=3.0)
    np.testing.assert_allclose(found["small"] / 1e-9, np.exp(np.exp(-found.time) - 1), rtol=1e-6)


def test_a_load_that_hangs_still_is_not_followed_into_its_rounding():
    class Slewed(Model):
        """A load below a jib that turns: at rest, whatever rounding makes of the sum of its forces."""

        phi = Real(start=0.0, fixed=True)
        w = Real(start=0.0, fixed=True)

        def equations(self):
            x, y = 1.4 * cos(time), 1.4 * sin(time)
            rounding = x * sin(time) - y * cos(time)
            yield der(self.phi) == self.w
            yield der(self.w) == -18.62 * sin(self.phi) + rounding

    found = simulate(Slewed(), stop=3.0)
    assert np.abs(found["w"]).max() < 1e-14  # ten times the rounding of the forces, over the run


@pytest.mark.parametrize("beside", [0.0, math.cos(math.pi / 2)])
def test_a_start_that_is_rounding_is_no_size(beside):
    class Chain(Model):
        """Oscillators of frequency 2 that are coupled, of which the second starts at zero, or at the cosine of pi/2."""

        x = Real(start=1.0, fixed=True)
        v = Real(start=0.0, fixed=True)
        y = Real(start=beside, fixed=True)
        u = Real(start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -4 * self.x
            yield der(self.y) == self.u
            yield der(self.u) == -4 * self.y + self.x

    dae = translate(Chain())
    found = simulate(dae, stop=5.0)
    np.testing.assert_allclose(found["y"], found.time * np.sin(2 * found.time) / 4, rtol=0, atol=1e-6)
    assert first_sizes(all_coordinates(dae, {})) == (1.0,) * 4


class Fading(Model):
    """Two nodes between conductances that fade together with what is fed in."""

    g, a, b = (Real(unit="1", description=words) for words in ("conductance", "first node", "second node"))
    x = Real(unit="s", description="integral of the first node", start=0.0, fixed=True)
    rate = Parameter(40.0, unit="1/s", description="rate of the fading")

    def equations(self) -> Any:
        yield self.g == exp(-self.rate * time)
        yield self.g * (2 * self.a - self.b) == self.g
        yield self.g * (2 * self.b - self.a) == self.g
        yield der(self.x) == self.a


def test_equations_that_fade_as_a_whole_do_not_degenerate():
    assert simulate(Fading(), stop=1.0).final("x") == pytest.approx(1.0, rel=1e-9)
