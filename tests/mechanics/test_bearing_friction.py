"""Friction between two wheels against closed solutions."""

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau.mechanics import rotational
from tests.mechanisms.axes import ABOUT
from tests.mechanisms.rows import in_a_row

NEAR = 1e-7  # a thousand times the integrator's tolerance: over some seconds errors add up

# Two wheels of which one brakes the other through their common bearing.
Brake = in_a_row(
    "Brake",
    one=ABOUT.mass(0.5, 0.0, 8.0),
    bearing=rotational.BearingFriction(tau_c=0.0, tau_v=0.6),
    other=ABOUT.mass(1.5, 0.0, 0.0),
)


def test_friction_between_two_wheels_keeps_their_angular_momentum():
    found = simulate(Brake(), stop=3.0, tolerance=1e-10)
    np.testing.assert_allclose(0.5 * found["one.w"] + 1.5 * found["other.w"], 4.0, atol=NEAR)
    apart = 8.0 * np.exp(-0.6 * (1 / 0.5 + 1 / 1.5) * found.time)
    np.testing.assert_allclose(found["one.w"] - found["other.w"], apart, atol=NEAR)
    # Coulomb friction drags with the same torque until they turn together, after 8 / (1 / 0.5 + 1 / 1.5) s
    found = simulate(Brake(bearing=dict(tau_c=1.0, tau_v=0.0)), stop=5.0, tolerance=1e-10)
    sliding = found.time < 2.5
    np.testing.assert_allclose(found["one.w"][sliding], 8.0 - 2.0 * found.time[sliding], atol=NEAR)
    # 2 s are a hundred time constants w_s J / tau_c
    assert found.final("one.w") == pytest.approx(2.0, abs=1e-6)
