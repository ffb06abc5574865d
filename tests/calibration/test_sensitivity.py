"""Sensitivities against their linearisation, and against Table 5.10 of the D1."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.arm_poses import tool_gain
from gantrytau_optimica.calibration.arms import read_arms
from gantrytau_optimica.calibration.sensitivity import sensitivity
from tests.calibration.linear_data import six_link_poses, three_link_poses

LINKS = [
    "arms[0].links[0]",
    *(f"arms[1].links[{j}]" for j in range(2)),
    *(f"arms[2].links[{j}]" for j in range(3)),
]
# Dressler (2012), Table 5.10, links 1, 2a, 2b, 3a, 3b, 3c
POSITION = {  # mm
    "length": [11.6, 5.9, 3.8, 2.0, 5.6, 2.9],
    "plate_offset[0]": [9.1, 5.1, 3.4, 1.6, 4.6, 2.4],
    "offset[0]": [9.5, 4.9, 3.2, 1.7, 4.8, 2.5],
}
ANGLE = {
    "length": [3.7e-5, 0.048, 0.048, 0.038, 0.049, 0.05],
    "offset[0]": [3e-5, 0.04, 0.04, 0.033, 0.042, 0.044],
}


@pytest.fixture(scope="module")
def found():
    # the 61 poses of section 5.3 that calibrate; where they are is not printed
    return sensitivity(SixLinkGantryTau(prototypes.D1), six_link_poses(61))


@pytest.mark.parametrize("parameter", POSITION)
def test_positions_of_table_5_10(found, parameter):
    here = 1e3 * np.array([found.of(f"{link}.{parameter}")[0] for link in LINKS])
    np.testing.assert_allclose(here, POSITION[parameter], rtol=0.25)  # other poses of the same robot


@pytest.mark.parametrize("parameter", ANGLE)
def test_angles_of_table_5_10(found, parameter):
    # the thesis does not say how it measures rotations: the norm of the change of R, sqrt(2) of the angle, fits
    here = np.sqrt(2) * np.array([found.of(f"{link}.{parameter}")[1] for link in LINKS])
    np.testing.assert_allclose(here, ANGLE[parameter], rtol=0.25)


def test_costs_are_those_of_a_length_alone(found):
    # (|d|^2 - (L +- h)^2)^2 with |d| = L, for 61 poses and both signs
    for link, arm in zip(LINKS, [0, 1, 1, 2, 2, 2], strict=True):
        length = prototypes.D1.arms[arm].links[int(link[-2])].length
        assert found.of(f"{link}.length")[2] == pytest.approx(2 * 61 * (2 * length * 5e-5) ** 2, rel=1e-3)


def test_small_steps_are_linear():
    robot, poses = GantryTau(prototypes.L1), three_link_poses(40)
    found = sensitivity(robot, poses, step=1e-6)
    gains = np.concatenate([gain for gain, _ in tool_gain(read_arms(robot), *poses)], axis=2)
    expected = 2 * 1e-6 * np.linalg.norm(gains, axis=1).sum(axis=0)
    np.testing.assert_allclose(found.position, expected, rtol=1e-5)  # ten times the step
    assert not found.angle.any()


def test_prints_a_table_and_answers_by_name(found):
    assert "position/mm" in str(found)
    assert "(61 poses, steps of 5e-05)" in str(found)
    assert len(str(found).splitlines()) == 1 + len(found.names)
    with pytest.raises(ModelError, match=r"sensitivity: there is no 'mass', expected one of arms\[0\]"):
        found.of("mass")
