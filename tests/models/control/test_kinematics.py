"""Closed forms of the kinematics against the robot itself, and what they say out of reach."""

import numpy as np
import pytest

from gantrytau import ModelError, translate
from gantrytau_models import ForwardKinematics, GantryTau, InverseKinematics, prototypes
from tests.models.mechanisms.test_gantry_tau import CARTS, mapped, random_motions, symmetric

ROBOTS = {"L1": prototypes.L1, "D1": prototypes.D1, "GT_A": prototypes.GT_A, "symmetric": symmetric()}


@pytest.fixture(params=ROBOTS)
def prototype(request):
    return ROBOTS[request.param]


def closed(model, given, find):
    """A model without states as a function."""
    dae = translate(model)
    assert not dae.states
    assert not dae.algebraics
    return dae.function(given, find)


def test_inverse_kinematics_are_those_of_the_robot(prototype):
    positions = random_motions(prototype)[0]
    expected = mapped(translate(GantryTau(prototype)).function(["tool.r"], CARTS), positions)
    found = mapped(closed(InverseKinematics(prototype), ["r"], ["q", "status", "reach"]), positions)
    assert np.abs(found[:, :3] - expected).max() < 1e-12  # m, a thousand roundings
    assert np.all(found[:, 3] == 0)
    assert np.all(found[:, 4:] > 0)


def test_forward_kinematics_are_those_of_the_robot(prototype):
    robot = translate(GantryTau(prototype))
    positions = random_motions(prototype, seed=1)[0]
    carts = mapped(robot.function(["tool.r"], CARTS), positions)
    expected = mapped(robot.function(CARTS, ["tool.r"]), *carts.T)
    found = mapped(closed(ForwardKinematics(prototype), ["q"], ["r", "status"]), carts)
    assert np.abs(found[:, :3] - expected).max() < 1e-12
    assert np.abs(found[:, :3] - positions).max() < 1e-12
    assert np.all(found[:, 3] == 0)


def test_symmetric_poses_are_exact():
    inverse = closed(InverseKinematics(symmetric()), ["r"], ["q"])
    forward = closed(ForwardKinematics(symmetric()), ["q"], ["r"])
    # in the plane of symmetry, between two guideways, and on the third one itself
    for tool in ([2.0, 0.0, 0.4], [2.0, 0.0, 0.0], [2.0, 0.0, 1.0]):
        q = np.ravel(inverse(tool))
        assert q[0] == q[1]
        np.testing.assert_allclose(np.ravel(forward(q)), tool, atol=1e-13)
    assert np.ravel(inverse([2.0, 0.0, 1.0]))[2] == 0.0


def test_other_side_of_the_carts(prototype):
    # links of the same length, the tool behind its carts
    positions = random_motions(prototype, seed=2)[0]
    behind = closed(InverseKinematics(prototype, side=[-1.0] * 3), ["r"], ["q"])
    for tool, q in zip(positions, mapped(behind, positions), strict=True):
        for arm, s in zip(prototype.arms, q, strict=True):
            link = tool - np.array(arm.offset) - s * np.array(arm.direction)
            assert np.linalg.norm(link) == pytest.approx(arm.length, rel=1e-12)
            assert link @ np.array(arm.direction) < 0


def test_two_solutions_are_mirrored_at_the_plane_of_the_carts(prototype):
    q = mapped(closed(InverseKinematics(prototype), ["r"], ["q"]), random_motions(prototype, seed=3)[0])
    one = mapped(closed(ForwardKinematics(prototype), ["q"], ["r"]), q)
    other = mapped(closed(ForwardKinematics(prototype, side=-1.0), ["q"], ["r"]), q)
    for a, b, carts in zip(one, other, q, strict=True):
        for arm, s in zip(prototype.arms, carts, strict=True):
            cart = np.array(arm.offset) + s * np.array(arm.direction)
            assert (a - cart) @ (a - cart) == pytest.approx((b - cart) @ (b - cart), rel=1e-12)
            assert (a - b) @ ((a + b) / 2 - cart) == pytest.approx(0.0, abs=1e-12)


def test_out_of_reach_the_arm_is_told_and_all_is_finite(prototype):
    find = ["q", "reach", "status"]
    inverse = closed(InverseKinematics(prototype), ["r"], find)
    slopes = closed(InverseKinematics(prototype), ["r"], find).jacobian()
    arm = prototype.arms[1]
    along = np.array(arm.direction) / np.linalg.norm(arm.direction)
    across = np.cross(along, [0.0, 0.0, 1.0])
    for too_far in (1e-9, 0.1, 1.0, 1e3):
        tool = np.array(arm.offset) + 0.7 * along + (arm.length + too_far) * across / np.linalg.norm(across)
        q, reach, status = (np.ravel(x) for x in inverse(tool))
        assert status == 1
        assert reach[1] == pytest.approx(-too_far, rel=1e-5)
        assert q[1] == pytest.approx(0.7 / np.linalg.norm(arm.direction), abs=1e-9)  # the nearest place
        assert np.all(np.isfinite([*q, *reach]))
        derivatives = slopes(tool, *inverse(tool))
        assert all(d.is_regular() for d in derivatives)


def test_margins_change_sign_where_the_robot_can_reach_no_more(prototype):
    inverse = closed(InverseKinematics(prototype), ["r"], ["reach", "status"])
    robot = translate(GantryTau(prototype)).function(["tool.r"], CARTS)
    random = np.random.default_rng(4)
    middle = np.mean([arm.offset for arm in prototype.arms], axis=0)
    seen = set()
    for tool in middle + random.uniform(-2.5, 2.5, (200, 3)):
        reach, status = (np.ravel(x) for x in inverse(tool))
        q = np.ravel(robot(tool))
        np.testing.assert_array_equal(np.isnan(q), reach < 0)
        assert (status == 0) == np.all(np.isfinite(q))
        seen.add(float(status[0]))
    assert seen == {0.0, 1.0}


def test_links_that_do_not_meet_give_a_status(prototype):
    forward = closed(ForwardKinematics(prototype), ["q"], ["r", "margin", "status"])
    slopes = forward.jacobian()
    for q in ([9.0, 0.0, 0.0], [0.0, -50.0, 0.0], [0.0, 0.0, 1e4]):
        r, margin, status = (np.ravel(x) for x in forward(q))
        assert status == 1
        assert margin < 0
        assert np.all(np.isfinite(r))
        derivatives = slopes(q, *forward(q))
        assert all(d.is_regular() for d in derivatives)


def test_carts_in_one_line_give_a_status():
    arms = [dict(length=2.0, offset=[0.0, y, 0.0], direction=[1.0, 0.0, 0.0]) for y in (-1.0, 0.0, 1.0)]
    forward = closed(ForwardKinematics(prototypes.GT_A, arms=arms), ["q"], ["r", "status"])
    for q in ([0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [1.0, 1.0, 1.0]):
        r, status = (np.ravel(x) for x in forward(q))
        assert status == 2
        assert np.all(np.isfinite(r))


def test_what_is_no_prototype_is_refused():
    for model in (ForwardKinematics, InverseKinematics):
        with pytest.raises(ModelError, match=f"{model.__name__}: found 'L1', expected a Prototype"):
            model("L1")  # pyright: ignore[reportArgumentType]
        with pytest.raises(ModelError, match="expected a Prototype"):
            model(prototypes.F1)  # pyright: ignore[reportArgumentType]
