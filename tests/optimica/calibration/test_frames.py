"""Frames of measurements: the base of the robot, where it is commanded, or any other, which nominal values tell from it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate, cross_validate, judge
from tests.optimica.calibration import f1_data, synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, disturbed, grid, nominal

TURN = Rotation.from_rotvec([0.3, -0.2, 2.0]).as_matrix()
SHIFT = np.array([1.0, -2.0, 0.5])


def l1():
    q, r = grid(prototypes.L1, 60)
    return nominal(2e-3), q, r + NOISE * np.random.default_rng(0).standard_normal(r.shape), None


def d1():
    q, r, R, _ = synthetic_d1.measure(1, 80)
    return SixLinkGantryTau(prototypes.D1), q, r, R


def f1():
    poses = f1_data.measured(f1_data.f1_poses(f1_data.f1_arms(), 80), seed=0)
    return F1GantryTau(prototypes.F1), *poses


ROBOTS = pytest.mark.parametrize("robot", [l1, d1, f1])


def turned(q, r, R):
    """Measurements in another frame."""
    return Measurements(q, r @ TURN.T + SHIFT, None if R is None else TURN @ R)


@ROBOTS
def test_in_the_base_nothing_of_a_frame_is_fitted(robot):
    nominal_robot, q, r, R = robot()
    base = calibrate(nominal_robot, Measurements(q, r, R), frame="base")
    assert "frame.R" not in base.parameters
    assert "frame" not in {f.kind for f in base.findings}
    fitted = calibrate(nominal_robot, Measurements(q, r, R))  # where nominal values say that it is the base
    assert (fitted.parameters["frame.R"] == np.eye(3)).all()
    assert (fitted.parameters["frame.t"] == 0).all()
    assert list(base.parameters) == list(fitted.parameters)  # no parameters of the robot
    with pytest.raises(CalibrationError, match="in another frame than the base of") as caught:
        calibrate(nominal_robot, turned(q, r, R), frame="base")
    assert caught.value.kind == "frame"
    assert "move them there, or take frame='fitted'" in str(caught.value)


@ROBOTS
def test_a_fitted_frame_stands_among_the_parameters(robot):
    nominal_robot, q, r, R = robot()
    found = calibrate(nominal_robot, turned(q, r, R))
    back, t = found.parameters["frame.R"], found.parameters["frame.t"]
    assert back @ back.T == pytest.approx(np.eye(3), abs=1e-12)
    # as well as nominal values know the base: some mm, over a metre or two
    assert back == pytest.approx(TURN.T, abs=0.01)
    assert t == pytest.approx(-TURN.T @ SHIFT, abs=0.03)
    assert "frame.t = [" in repr(found.parameters)
    with pytest.raises(ModelError, match=r"frame\.t follows from nominal values alone"):
        found.covariance(["frame.t"])


def test_places_on_two_levels_have_a_frame_too():
    """Guideways cannot be told from them alone, as y and y**2 are the same there but for two constants."""
    r = np.array([[x, y, z] for x in (0.4, 0.7, 1.0) for y in (2.6, 3.0) for z in (-0.9, -0.6, -0.3)])
    robot = GantryTau(prototypes.L1)
    q = Kinematics(robot).ik(r)
    found = calibrate(robot, turned(q, r + NOISE * np.random.default_rng(0).standard_normal(r.shape), None))
    assert found.parameters["frame.R"] == pytest.approx(TURN.T, abs=1e-3)  # noise over half a metre
    assert found.parameters["frame.t"] == pytest.approx(-TURN.T @ SHIFT, abs=1e-3)
    with pytest.raises(CalibrationError, match="in another frame than the base of"):
        calibrate(robot, turned(q, r, None), frame="base")


def test_a_linear_start_knows_the_frame_too():
    robot, q, r, _ = l1()
    found = calibrate(robot, turned(q, r, None), start="linear")
    assert found.parameters["frame.R"] == pytest.approx(TURN.T, abs=0.01)
    with pytest.raises(CalibrationError, match="in another frame than the base of GantryTau"):
        calibrate(robot, turned(q, r, None), start="linear", frame="base")


def test_the_tool_is_right_in_the_base():
    q, r = grid(prototypes.L1, 60)
    robot = GantryTau(disturbed(prototypes.L1, 5e-3))
    measured = r + NOISE * np.random.default_rng(1).standard_normal(r.shape)
    found = calibrate(robot, Measurements(q, measured), frame="base")
    assert np.linalg.norm(found.kinematics.fk(q)[0] - r, axis=1).mean() < 3 * NOISE
    # laid over nominal values instead, it would be off by what these are
    there = calibrate(robot, turned(q, measured, None))
    back = there.kinematics.fk(q)[0] @ there.parameters["frame.R"].T + there.parameters["frame.t"]
    assert np.linalg.norm(back - r, axis=1).mean() > 1e-3


def test_a_verdict_says_what_it_means_for_the_base():
    robot, q, r, _ = l1()
    here = str(judge(cross_validate(robot, Measurements(q, r)), wanted=200e-6))
    base = str(judge(cross_validate(robot, Measurements(q, r), frame="base"), wanted=200e-6))
    there = str(judge(cross_validate(robot, turned(q, r, None)), wanted=200e-6))
    assert "This is good up to a frame: coordinates are those of the frame measured, taken for" in here
    assert base.endswith("Poses were measured in the base of the robot: its coordinates are as good as this.")
    assert "This is good up to a frame: R and t follow from nominal values, so that in coordinates" in there
    assert "mm, as before, where these are 10 mm off; measure in the base of the robot" in there
