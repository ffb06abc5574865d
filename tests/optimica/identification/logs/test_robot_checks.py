"""A log beside the robot that it is said to be of."""

import numpy as np
import pytest

from gantrytau import ModelError, translate
from gantrytau.kinematics.kinematics import Kinematics, driven_joints
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog
from gantrytau_optimica.identification import check_motion
from gantrytau_optimica.identification.logs.log_checks import slopes
from gantrytau_optimica.identification.logs.robot_checks import nominal_forces

RATIO = 190.0  # N by N.m of the drives of the L1


@pytest.fixture(scope="module")
def robot():
    return translate(GantryTau(prototypes.L1))


@pytest.fixture(scope="module")
def log(robot):
    """Two thousand rows of the robot with its nominal values, 20 N of noise."""
    t = np.arange(2100) / 250
    r = [0.85, 2.6, -0.55] + 0.1 * np.sin(np.outer(t, [3.0, 4.1, 5.3]))
    q = Kinematics(robot).ik(r)
    v, a, _, inner = slopes(t, q, 3)
    f = nominal_forces(robot, driven_joints(robot), q[inner], v, a)
    return MotionLog(t[inner], q[inner], f + 20 * np.random.default_rng(5).normal(size=f.shape))


def kinds(robot, log):
    return [finding.kind for finding in check_motion(robot, log)]


def test_a_log_of_the_robot_has_no_findings(robot, log):
    assert kinds(robot, log) == []
    assert log.findings == ()


@pytest.mark.parametrize(("factor", "words"), [(1 / RATIO, "times smaller"), (1e3, "times larger")])
def test_forces_in_another_unit_are_told_with_their_ratio(robot, log, factor, words):
    (found,) = check_motion(robot, MotionLog(log.t, log.q, log.f * factor))
    assert found.kind == "unit of force"
    assert words in found.message
    ratio = float(found.message.split()[2])
    # noise and smoothing; sizes are what is told
    assert max(factor, 1 / factor) == pytest.approx(ratio, rel=0.05)


def test_forces_of_the_opposite_sign_are_told(robot, log):
    turned = MotionLog(log.t, log.q, -log.f)
    assert kinds(robot, turned) == ["sign of force"]
    assert [f.kind for f in turned.findings] == ["sign of force"]


def test_late_forces_of_the_whole_robot_are_told(log):
    for lag in (3, 8):  # fewer are lost in what masses that change with the pose leave
        (found,) = MotionLog(log.t, log.q, np.roll(log.f, lag, axis=0)).findings
        assert f"forces are {lag} samples late" in found.message


def test_rows_outside_of_the_workspace_are_told(robot, log):
    q = log.q.copy()
    q[40:50, 1] += 5.0
    (found,) = check_motion(robot, MotionLog(log.t, q, log.f))[:1]
    assert found.kind == "workspace"
    assert found.rows.tolist() == list(range(40, 50))
    millimetres = MotionLog(log.t, log.q * 1e3, log.f)
    assert kinds(robot, millimetres)[0] == "workspace"


def test_two_of_three_carts_are_refused(robot, log):
    with pytest.raises(ModelError, match=r"found 2 actuators, expected the 3 of GantryTau: carts\[0\].s"):
        check_motion(robot, MotionLog(log.t, log.q[:, :2], log.f[:, :2]))
