"""The Cartesian pendulum: states, force of the rod, energy, against the angle's equation of motion."""

import numpy as np
import pytest

from gantrytau import translate
from gantrytau.border.refusal import InitializationError
from gantrytau_models.mechanisms.pendulum import Pendulum


@pytest.fixture(scope="module")
def pendulum():
    return translate(Pendulum(L=2.0, m=3.0, x=dict(start=0.1), y=dict(start=-1.9)))


def test_two_states_and_index_three(pendulum):
    assert pendulum.indexed.structural_index == 3
    assert len(pendulum.states) == 2
    assert pendulum.diagnosis.mobility == 1


@pytest.mark.parametrize("angle", [-1.2, 0.0, 0.3, 1.0])
@pytest.mark.parametrize("speed", [0.0, 1.7])
def test_motion_equals_that_of_the_angle(pendulum, angle, speed):
    x, y = 2.0 * np.sin(angle), -2.0 * np.cos(angle)
    at = pendulum.evaluate({"x": x, "v_x": -y * speed})
    assert at["y"] == pytest.approx(y, rel=1e-14)
    assert at["v_y"] == pytest.approx(x * speed, abs=1e-13)
    turning = -9.81 / 2.0 * np.sin(angle)
    assert at["der(v_x)"] == pytest.approx(-y * turning - x * speed**2, abs=1e-12)
    assert at["der(v_y)"] == pytest.approx(x * turning - y * speed**2, abs=1e-12)
    # the rod holds the weight and turns the speed
    assert at["tension"] * 2.0 == pytest.approx(3.0 * (9.81 * np.cos(angle) + 2.0 * speed**2), rel=1e-13)
    assert at["kinetic_energy"] == pytest.approx(1.5 * (2.0 * speed) ** 2, rel=1e-13)
    assert at["potential_energy"] == pytest.approx(3.0 * 9.81 * y, rel=1e-14)
    power = 3.0 * (at["v_x"] * at["der(v_x)"] + at["v_y"] * (at["der(v_y)"] + 9.81))
    assert power == pytest.approx(0.0, abs=1e-11)


def test_a_start_beyond_the_rod_is_refused(pendulum):
    with pytest.raises(InitializationError, match=r"Pendulum: .*the model \(Pendulum\)"):
        pendulum.evaluate({"x": 2.5})
