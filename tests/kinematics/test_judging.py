"""Poses whose actuators are known are judged as those whose actuators are sought."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Box, Kinematics, Limits
from gantrytau.kinematics.workspace.pose_limits import REASONS, Examiner
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes

OUT = REASONS.index("out of reach")
LIMITS = dict(ball_joint=np.radians(50), link_radius=0.02, clearance=0.01)
ROBOTS = [
    (GantryTau(prototypes.L1), Limits(strokes=(0.0, 2.0), obstacles=Box((0.6, 2.4, -3), (0.8, 2.5, -0.4)), **LIMITS)),
    (SixLinkGantryTau(prototypes.D1), Limits(strokes=(0.0, 2.0), **LIMITS)),
    (F1GantryTau(prototypes.F1), Limits(strokes=(-0.6, 0.9), **LIMITS)),
]  # fmt: skip


def poses_of(robot):
    """Poses about home by their actuators, some of them out of reach."""
    kinematics = Kinematics(robot)
    n = len(kinematics.joints)
    q = kinematics.home.q + np.random.default_rng(1).uniform(-1.0, 1.0, (300, n)) * np.where(
        np.arange(n) < 3, 0.6, 0.3
    )
    return kinematics, q, *kinematics.fk(q)


@pytest.mark.parametrize(("robot", "limits"), ROBOTS, ids=["three", "six", "turntables"])
def test_known_actuators_give_the_same_judgement(robot, limits):
    kinematics, q, r, R = poses_of(robot)
    judge = Examiner(kinematics, limits)
    known, sought = judge.judge(q, r, R), judge(r, R if q.shape[1] == 6 else None)
    reached = np.isfinite(r).all(axis=1)
    assert (known.reason[~reached] == OUT).all()
    # the actuators of a pose are those that led to it, unless an iteration that seeks them does not find it
    found = reached & (np.abs(sought.q - q).max(axis=1, initial=0.0) < 1e-6)
    assert found.sum() > 0.9 * reached.sum() > 20
    np.testing.assert_array_equal(known.reason[found], sought.reason[found])
    for name in ("stroke", "turn", "angle", "clearance"):
        np.testing.assert_allclose(getattr(known, name)[found], getattr(sought, name)[found], atol=1e-6)
    assert len(set(known.reason.tolist())) >= 2


def test_poses_that_the_links_do_not_allow_are_out_of_reach():
    robot, limits = ROBOTS[0]
    kinematics = Kinematics(robot)
    q = np.tile(kinematics.home.q, (4, 1))
    r, R = kinematics.fk(q)
    q[1, 0] += 1e-4  # links miss their lengths
    r[2] = np.nan
    other = kinematics.configurations(r=r[3])  # arms on the other sides of their carts
    q[3] = next(each.q for each in other if np.abs(each.q - q[0]).max() > 0.1)
    found = Examiner(kinematics, limits).judge(q, r, R)
    assert (found.reason == OUT).tolist() == [False, True, True, True]
    assert np.isnan(found.clearance[1:]).all()


def test_other_shapes_are_refused():
    robot, limits = ROBOTS[0]
    kinematics = Kinematics(robot)
    r, R = kinematics.fk(kinematics.home.q[None])
    for q, turns, wrong in ((kinematics.home.q, R, "q"), (kinematics.home.q[None], None, "R")):
        with pytest.raises(ModelError) as refusal:
            Examiner(kinematics, limits).judge(q, r, turns)  # type: ignore[arg-type]
        assert refusal.value.argument == wrong
