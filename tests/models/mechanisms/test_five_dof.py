"""The Gantry-Tau robot with five carts: lengths of its links, the six-link robot in it, its five degrees of freedom."""

from typing import Any

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau.border.refusal import ModelError
from gantrytau.kinematics import Kinematics, Limits, workspace
from gantrytau.kinematics.rotations import turned
from gantrytau_models import FiveDofGantryTau, SixLinkGantryTau, prototypes
from gantrytau_models.mechanisms.five_dof import CARTS
from gantrytau_optimica import Measurements, calibrate

WITH_TURNTABLES: Any = prototypes.F1


@pytest.fixture(scope="module")
def robot():
    return Kinematics(FiveDofGantryTau(prototypes.L1))


@pytest.fixture(scope="module")
def moved(robot):
    """400 poses and their joints, the carts up to 4 cm beside each other."""
    q = robot.home.q + np.random.default_rng(0).uniform(-0.04, 0.04, (400, 5))
    r, R = robot.fk(q)
    known = np.isfinite(r[:, 0])
    assert known.sum() > 350
    return q[known], r[known], R[known]


def test_all_links_are_as_long_as_they_are(moved):
    q, r, R = moved
    for cart, (arm, links) in enumerate(CARTS):
        record = prototypes.L1.arms[arm]
        for link in (record.links[j] for j in links):
            on_cart = np.array(link.offset) + q[:, cart, None] * np.array(record.direction)
            length = np.linalg.norm(r + R @ link.plate_offset - on_cart, axis=1)
            np.testing.assert_allclose(length, link.length, atol=1e-11)


def test_there_and_back(robot, moved):
    q, r, R = moved
    np.testing.assert_allclose(robot.ik(r, R), q, atol=1e-10)
    few = robot.ik(r[:3], R[:3])
    np.testing.assert_allclose(few, q[:3], atol=1e-10)


def test_the_jacobian_along_ways_that_it_can_go(robot, moved):
    """dq/dpose times the change of the pose by one cart is that of the cart alone."""
    q, r, R = (x[:20] for x in moved)
    jacobian = robot.jacobian(r, R)
    assert jacobian.shape == (20, 5, 6)
    step = 1e-6
    for k in range(5):
        change = step * np.eye(5)[k]
        (r_a, R_a), (r_b, R_b) = robot.fk(q - change), robot.fk(q + change)
        rates = (R_b - R_a) / (2 * step) @ np.swapaxes(R, 1, 2)
        twist = np.hstack([(r_b - r_a) / (2 * step), rates[:, [2, 0, 1], [1, 2, 0]]])
        found = np.einsum("nij,nj->ni", jacobian, twist)
        np.testing.assert_allclose(found, np.broadcast_to(np.eye(5)[k], (20, 5)), atol=1e-6)


def test_with_carts_side_by_side_it_is_the_six_link_robot(robot):
    six = Kinematics(SixLinkGantryTau(prototypes.L1))
    q = six.home.q + np.random.default_rng(1).uniform(-0.2, 0.2, (50, 3))
    r, R = six.fk(q)
    found, turns = robot.fk(q[:, [0, 1, 2, 1, 2]])
    np.testing.assert_allclose(found, r, atol=1e-9)
    np.testing.assert_allclose(turns, R, atol=1e-9)


def test_of_the_orientation_two_angles_can_be_chosen(robot):
    """Of three rotations about the axes of the world, each with what else it takes, one is out of reach."""
    home = robot.home
    kept = [robot.ik(home.r, turned(home.R[None], 0.02 * np.eye(3)[[k]])[0]) for k in range(3)]
    assert any(np.isnan(q).all() for q in kept)
    assert np.isfinite(robot.ik(home.r, home.R)).all()
    with pytest.raises(ModelError, match="found no orientation R"):
        robot.ik(home.r)


def test_ball_joints_limit_its_workspace_as_that_of_the_six_link_robot():
    limits = Limits(strokes=(0.0, 2.5), ball_joint=np.radians(40))
    six, five = (
        workspace(make(prototypes.L1), limits, spacing=0.2) for make in (SixLinkGantryTau, FiveDofGantryTau)
    )
    assert "ball joint" in str(six)
    np.testing.assert_array_equal(five.reason, six.reason)


def test_it_is_calibrated_by_poses_of_its_plate(moved):
    q, r, R = moved
    measured = Measurements(q, r + 20e-6 * np.random.default_rng(1).standard_normal(r.shape), R)
    fit = calibrate(FiveDofGantryTau(prototypes.L1), measured)
    # a direction for each of five carts, seven more numbers for each of six links
    assert len(fit.names) == 57
    assert fit.error < 40e-6  # noise of 20 um in each of three coordinates is 32 um
    with pytest.raises(ModelError, match=r"start='linear'.* expected 'nominal'"):
        calibrate(FiveDofGantryTau(prototypes.L1), measured, start="linear")
    with pytest.raises(ModelError, match=r"model=1.* its plate turns"):
        calibrate(FiveDofGantryTau(prototypes.L1), measured, model=1)


def test_it_falls_as_its_links_let_it():
    fall = simulate(FiveDofGantryTau(prototypes.L1, friction=None), stop=0.1)
    q = np.stack([fall[f"carts[{i}].s"] for i in range(5)], axis=1)
    record = prototypes.L1.arms[2]
    on_cart = np.array(record.links[2].offset) + q[:, 4, None] * np.array(record.direction)
    ends = fall["tool.r"] + fall["tool.R"] @ np.array(record.links[2].plate_offset)
    np.testing.assert_allclose(np.linalg.norm(ends - on_cart, axis=1), record.links[2].length, atol=1e-6)


def test_prototypes_of_other_structure_are_refused():
    with pytest.raises(ModelError, match="expected a Prototype such as"):
        FiveDofGantryTau(WITH_TURNTABLES)
