"""Kinematics of the F1, whose turntables give the plate six degrees of freedom; and of its five-degree forms."""

import numpy as np
import pytest

from gantrytau.border.refusal import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.rotations import about, turned
from gantrytau_models import F1GantryTau, prototypes

LIMIT = np.deg2rad(45.0)  # of ball joints: Dressler (2012), Figure 4.16
AXES = np.eye(6)


@pytest.fixture(scope="module")
def f1():
    return Kinematics(F1GantryTau(prototypes.F1))


def poses(kinematics, count, turn=0.52, twist=0.2, seed=0):
    """Poses within 0.3 m of home, turned about the axes of both turntables and twisted besides, rad."""
    random = np.random.default_rng(seed)
    turns = kinematics.linked().geometry.frames(2, kinematics.home.q[None])[2]
    first, second = (axis[0] for axis, _ in turns)
    R = about(first, random.uniform(-turn, turn, count)) @ about(second, random.uniform(-turn, turn, count))
    r = kinematics.home.r + random.uniform(-0.3, 0.3, (count, 3))
    return r, turned(R @ kinematics.home.R, random.uniform(-twist, twist, (count, 3)))


def test_the_right_pose_from_the_five_degree_start_in_ten_thousand(f1):
    r, R = poses(f1, 20000)
    q = f1.ik(r, R)
    reached = np.isfinite(q[:, 0])
    bent = f1.ball_joint_angles(r[reached], R[reached], q[reached]).max(axis=(1, 2))
    inside = np.flatnonzero(reached)[bent < LIMIT][:10000]
    assert inside.size == 10000
    found, turns = f1.fk(q[inside])
    assert f1.iterations <= 6
    np.testing.assert_allclose(found, r[inside], atol=1e-10)  # 1e-12 m of the links, worsened by at most 50
    np.testing.assert_allclose(turns, R[inside], atol=1e-10)


def test_links_have_their_lengths_in_the_record(f1):
    """(4.16) to (4.24), written out for one arm after the other with the numbers of the record."""
    r, R = poses(f1, 30, seed=1)
    q = f1.ik(r, R)
    prototype = prototypes.F1
    for i, arm in enumerate(prototype.arms):
        place = np.array(arm.offset) + q[:, i, None] * np.array(arm.direction)
        turn = np.broadcast_to(np.eye(3), (30, 3, 3))
        for turntable, k in zip(arm.turntables, {0: (), 1: (3,), 2: (4, 5)}[i], strict=True):
            w, x, y, z = turntable.orientation
            seat = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ])  # fmt: skip
            place = place + turn @ turntable.offset
            turn = turn @ seat @ about(np.array(turntable.axis), q[:, k])
        for link in arm.links:
            gap = r + R @ link.plate_offset - place - turn @ link.cart_offset
            np.testing.assert_allclose(np.linalg.norm(gap, axis=1), link.length, atol=1e-11)


def test_the_f1_agrees_with_the_equations_of_the_model(f1):
    q = f1.home.q + np.array([0.02, -0.03, 0.01, 0.05, -0.04, 0.03])
    r, R = f1.fk(q)
    values = f1.dae.evaluate(dict(zip(f1.joints, q, strict=True)))
    np.testing.assert_allclose(values["tool.r"], r, atol=1e-9)  # of consistent starts
    np.testing.assert_allclose(values["tool.R"], R, atol=1e-9)


def test_the_jacobian_is_the_slope_of_the_inverse(f1):
    r, R = poses(f1, 20, seed=2)
    jacobian = f1.jacobian(r, R)
    assert jacobian.shape == (20, 6, 6)
    step = 1e-5  # m or rad: errors of differences are about its square
    for k in range(6):
        move, turn = step * AXES[k, :3], step * np.broadcast_to(AXES[k, 3:], (20, 3))
        ahead, behind = f1.ik(r + move, turned(R, turn)), f1.ik(r - move, turned(R, -turn))
        np.testing.assert_allclose(jacobian[:, :, k], (ahead - behind) / (2 * step), atol=1e-7)


def test_five_degrees_are_exact_where_links_are_parallel():
    """On the ideal F1 both parallelograms turn the plate alike, q4 = -q5, and the closed forms are no approximation."""
    ideal = Kinematics(F1GantryTau(prototypes.F1_ideal))
    random = np.random.default_rng(3)
    q = ideal.home.q + random.uniform(-0.2, 0.2, (200, 6))
    q[:, 4] = -q[:, 3]
    r, R = ideal.fk_of_five_degrees(q)
    np.testing.assert_allclose(ideal.fk(q)[0], r, atol=1e-10)
    np.testing.assert_allclose(ideal.fk(q)[1], R, atol=1e-10)
    assert ideal.iterations == 0
    np.testing.assert_allclose(ideal.ik_of_five_degrees(r, R), q, atol=1e-10)


def test_five_degrees_are_near_where_they_are_not(f1):
    q = f1.home.q
    r, _ = f1.fk_of_five_degrees(q)
    assert 1e-5 < np.linalg.norm(r - f1.home.r) < 0.05  # m: links of an arm differ by millimetres
    assert np.abs(f1.ik_of_five_degrees(f1.home.r, f1.home.R) - q).max() < 0.1


def test_all_ways_to_reach_a_pose(f1):
    r, R = poses(f1, 1, seed=4)
    found = f1.configurations(r=r[0], R=R[0])
    np.testing.assert_allclose(found[0].q, f1.ik(r[0], R[0]), atol=1e-9)
    assert len({tuple(c.q.round(6)) for c in found}) == len(found)
    geometry = f1.linked().geometry
    q = np.stack([c.q for c in found])
    length = geometry.slopes(q, np.repeat(r, len(q), axis=0), np.repeat(R, len(q), axis=0))[0]
    np.testing.assert_allclose(length, geometry.length * np.ones((len(q), 1)), atol=1e-11)
    # uncrossed links leave each arm the two sides of its cart
    feasible = [c.q for c in found if c.feasible]
    sides = f1.state(np.repeat(r, len(feasible), axis=0), R[0], np.stack(feasible))[:, :3]
    assert len(np.unique(sides, axis=0)) == 8


def test_assembly_modes_of_a_pose(f1):
    found = f1.configurations(q=f1.home.q)
    assert len(found) in (4, 6, 8)
    np.testing.assert_allclose(found[0].r, f1.home.r, atol=1e-8)
    assert found[0].feasible
    for c in found:
        again, _ = f1.fk(f1.home.q, near=(c.r, c.R))
        np.testing.assert_allclose(again, c.r, atol=1e-9)


def test_out_of_reach_is_a_row_of_nan(f1):
    r, R = np.array([f1.home.r, f1.home.r + 3.0]), f1.home.R
    assert np.isnan(f1.ik(r, R)).all(axis=1).tolist() == [False, True]
    q = np.array([f1.home.q, f1.home.q + 5.0 * AXES[1]])
    assert np.isnan(f1.fk(q)[0]).all(axis=1).tolist() == [False, True]


def test_poses_of_bent_arms_are_found_from_a_second_start(f1):
    """With ball joints at 55 degrees or more, (4.25) may start too far away; the angles at home do then."""
    random = np.random.default_rng(5)
    spread = np.array([0.3, 0.3, 0.3, 0.18, 0.18, 0.18])
    q = f1.home.q + random.uniform(-1, 1, (20_000, 6)) * spread
    r, R = f1.fk(q)
    reached = np.all(f1.state(r, R, q)[:, :3] == f1.linked().sides, axis=1)
    assert reached.sum() > 19_990
    found = f1.ik(r[reached], R[reached])
    assert np.isfinite(found).all()
    bent = f1.ball_joint_angles(r[reached], R[reached], q[reached]).max(axis=(1, 2))
    other = np.abs(found - q[reached]).max(axis=1) > 1e-7
    assert other.mean() < 2e-3  # arms of three links have two solutions on one side there
    assert bent[other].min() > LIMIT


def test_links_of_the_branch_do_not_cross(f1):
    random = np.random.default_rng(6)
    q = f1.home.q + random.uniform(-1, 1, (3000, 6)) * np.array([1.0, 1.0, 1.0, 0.6, 0.6, 0.6])
    r, R = f1.fk(q)
    freely, turns = f1.fk(q, near=f1.fk_of_five_degrees(q))
    there, robot = np.isfinite(r[:, 0]), f1.linked()
    crossed = np.isfinite(freely[:, 0]) & robot.crossed(q, freely, turns)
    assert crossed.any()
    assert not (there & crossed).any()
    assert robot.on_branch(q, r, R)[there].all()


@pytest.mark.filterwarnings("error")
def test_poses_that_are_no_numbers_disturb_nobody(f1):
    r, R = poses(f1, 3)
    expected = f1.ik(r, R)
    for spoilt in (np.nan, np.inf):
        there = r.copy()
        there[1, 0] = spoilt
        q = f1.ik(there, R)
        assert np.isnan(q[1]).all()
        np.testing.assert_array_equal(q[[0, 2]], expected[[0, 2]])
        assert f1.configurations(r=there[1], R=R[1]) == f1.configurations(q=q[1]) == []
        assert np.isnan(f1.fk(q)[0][1]).all()


def test_what_cannot_be_answered_is_told(f1):
    r, R = f1.home.r, f1.home.R
    with pytest.raises(ModelError, match="found no orientation R, expected one"):
        f1.ik(r)
    with pytest.raises(ModelError, match="found no orientation R, expected one"):
        f1.ik_of_five_degrees(r, None)
    with pytest.raises(ModelError, match="found 2 positions and an orientation"):
        f1.configurations(r=[r, r], R=R)
