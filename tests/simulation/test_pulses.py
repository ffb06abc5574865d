"""Smooth functions of time that rest and then change are not stepped over."""

import math

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, der, exp, if_else, simulate, tanh, time
from gantrytau.simulation.between.pulses import pulses


class Pushed(Model):
    """A speed that a force of one kilogram changes."""

    f = Input()
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.v) == self.f


def bell(width):
    """A pulse at 3 s, of area one."""
    return lambda t: exp(-(((t - 3) / width) ** 2)) / (width * math.sqrt(math.pi))


@pytest.mark.parametrize("points", [2, 11, 501])
@pytest.mark.parametrize("width", [0.5, 0.1, 1e-2, 1e-3, 2.5e-4])
def test_a_smooth_pulse_is_found_whatever_points_are_asked_for(width, points):
    found = simulate(Pushed(), stop=5.0, inputs={"f": bell(width)}, points=points)
    area = (math.erf(2 / width) + math.erf(3 / width)) / 2
    assert found.final("v") == pytest.approx(area, abs=1e-6)  # a hundred times the tolerance


def test_a_shorter_pulse_is_found_with_a_shorter_step():
    found = simulate(Pushed(), stop=5.0, inputs={"f": bell(3e-5)}, points=2, max_step=1e-5)
    assert found.final("v") == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("points", [2, 501])
def test_pulses_within_the_model_and_those_whose_factor_is_zero_at_first(points):
    class Kicked(Model):
        second = Parameter(1.0, unit="s")
        v = Real(start=0.0, fixed=True)
        x = Real(start=0.0, fixed=True)

        def equations(self):
            t = time / self.second
            yield der(self.v) == (tanh((t - 3) / 1e-3) + 1) / 2
            yield der(self.x) == self.v * exp(-(((t - 4) / 1e-3) ** 2)) / (1e-3 * math.sqrt(math.pi))

    found = simulate(Kicked(), stop=5.0, points=points)
    assert found.final("v") == pytest.approx(2.0, abs=1e-6)
    assert found.final("x") == pytest.approx(1.0, abs=1e-6)


def test_what_jumps_is_no_pulse():
    """A signal that is switched on asks for no short steps: the integrator starts anew there."""
    assert not pulses(if_else(time > 2.5, 3.0, 0.0), 0.0, 5.0).spans.size
    bent = pulses(if_else(time > 2.5, time - 2.5 + 3.0, 0.0), 0.0, 5.0)  # s; what comes behind is one
    np.testing.assert_allclose(bent.spans, [[2.5, 5.0]], atol=0.011)
