"""The five-bar robot beside circles that meet: forward, inverse, velocities and forces."""

import numpy as np
import pytest

from gantrytau import Start, simulate, translate
from gantrytau.kinematics import Kinematics
from gantrytau_models import FiveBar

GROUND, CRANK, COUPLER = 0.2, 0.3, 0.4


@pytest.fixture(scope="module")
def robot():
    return Kinematics(FiveBar())


def elbows(q):
    """(N, 2, 2) in the plane."""
    pivots = np.array([[-GROUND / 2, 0.0], [GROUND / 2, 0.0]])
    return pivots + CRANK * np.stack([np.cos(q), np.sin(q)], axis=2)


def meeting(q):
    """Where circles about the elbows meet, to the left of the way from elbow 0 to elbow 1; NaN where they do not."""
    one, two = np.moveaxis(elbows(q), 1, 0)
    across = two - one
    distance = np.linalg.norm(across, axis=1)
    with np.errstate(invalid="ignore"):
        height = np.sqrt(COUPLER**2 - distance**2 / 4)
    left = np.stack([-across[:, 1], across[:, 0]], axis=1) / distance[:, None]
    return (one + two) / 2 + height[:, None] * left


def outwards(r):
    """Angles of the cranks (N, 2), elbows outwards: law of cosines; NaN out of reach."""
    found = []
    for x, side in ((-GROUND / 2, 1.0), (GROUND / 2, -1.0)):
        way = r[:, :2] - [x, 0.0]
        distance = np.linalg.norm(way, axis=1)
        with np.errstate(invalid="ignore"):
            bend = np.arccos((CRANK**2 + distance**2 - COUPLER**2) / (2 * CRANK * distance))
        found.append(np.arctan2(way[:, 1], way[:, 0]) + side * bend)
    return np.stack(found, axis=1)


@pytest.mark.parametrize("count", [5, 2000])
def test_forward_is_where_two_circles_meet(robot, count):
    q = robot.home.q + np.random.default_rng(0).uniform(-0.5, 0.5, (count, 2))
    r, R = robot.fk(q)
    np.testing.assert_allclose(r[:, :2], meeting(q), atol=1e-12)
    np.testing.assert_array_equal(r[:, 2], 0.0)
    np.testing.assert_array_equal(R, np.broadcast_to(np.eye(3), (count, 3, 3)))
    np.testing.assert_allclose(robot.ik(r), q, atol=1e-12)


def test_inverse_over_a_grid_and_out_of_reach(robot):
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 41), np.linspace(0.25, 0.8, 31))
    r = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    q, expected = robot.ik(r), outwards(r)
    beyond = np.hypot(np.abs(r[:, 0]) + GROUND / 2, r[:, 1]) > CRANK + COUPLER
    assert 100 < beyond.sum() < 1000
    assert np.isnan(q[beyond]).all()
    known = np.isfinite(q).all(axis=1)
    assert known.sum() > 300
    np.testing.assert_allclose(np.cos(q[known] - expected[known]), 1.0, atol=1e-12)


def test_a_place_beside_the_plane_is_out_of_reach(robot):
    q = robot.ik([[0.0, 0.5, 0.0], [0.0, 0.5, 1e-3], [0.0, 0.5, 1e-9]])
    assert np.isnan(q).all(axis=1).tolist() == [False, True, False]
    assert np.isnan(robot.jacobian([0.0, 0.5, 1e-3])).all()


def test_the_jacobian_beside_differences(robot):
    r = np.random.default_rng(1).uniform([-0.15, 0.35, 0.0], [0.15, 0.65, 0.0], (300, 3))
    jacobian = robot.jacobian(r)
    assert jacobian.shape == (300, 2, 3)
    for k in range(2):
        step = 1e-6 * np.eye(3)[k]
        slope = (robot.ik(r + step) - robot.ik(r - step)) / 2e-6
        np.testing.assert_allclose(jacobian[:, :, k], slope, atol=1e-6)
    np.testing.assert_array_equal(jacobian[:, :, 2], 0.0)  # across the plane it cannot go


def test_symmetric_poses(robot):
    """On the axis of symmetry both cranks mirror each other; a place and its mirror image change their cranks."""
    on_axis = robot.ik(np.column_stack([np.zeros(50), np.linspace(0.3, 0.6, 50), np.zeros(50)]))
    np.testing.assert_allclose(on_axis.sum(axis=1), np.pi, atol=1e-12)
    one, other = robot.ik([[0.12, 0.45, 0.0], [-0.12, 0.45, 0.0]])
    np.testing.assert_allclose(one, np.pi - other[::-1], atol=1e-12)
    # across and along the ground
    right = np.array([[np.pi / 2, np.pi / 2], [np.pi, np.pi / 2], [np.pi / 2, 0.0]])
    np.testing.assert_allclose(robot.fk(right)[0][:, :2], meeting(right), atol=1e-12)


def test_torques_hold_a_force_at_the_tool_by_virtual_work():
    """In a vertical plane at rest: tau = -J^-T f for the weight of the tool, bars without mass."""
    light = dict(m=1e-12)
    robot = FiveBar(n=[0.0, -1.0, 0.0], cranks=[light, light], couplers=[light, light], tool_mass=2.0)
    dae = translate(robot)
    r = [0.1, 0.0, 0.5]
    statics = dae.function(
        ["tool.r[0]", "tool.r[2]", "tool.v[0]", "tool.v[2]", "der(tool.v[0])", "der(tool.v[2])"],
        ["cranks[0].tau", "cranks[1].tau"],
    )
    tau = np.array([float(x) for x in statics(r[0], r[2], 0.0, 0.0, 0.0, 0.0)])
    jacobian = Kinematics(dae).jacobian(r)[:, [0, 2]]  # dq/dr
    np.testing.assert_allclose(jacobian.T @ tau, [0.0, 2.0 * 9.81], atol=1e-9)  # 1e-12 kg of bars


def test_in_any_plane_and_with_other_lengths():
    tilted = FiveBar(n=[0.0, 1.0, 1.0], e=[1.0, 0.0, 0.0], couplers=[dict(length=0.45), {}])
    kinematics = Kinematics(tilted)
    q = kinematics.home.q + np.random.default_rng(2).uniform(-0.2, 0.2, (300, 2))
    r, _ = kinematics.fk(q)
    np.testing.assert_allclose(r @ [0.0, 1.0, 1.0], 0.0, atol=1e-12)
    flat = np.stack([r[:, 0], r @ [0.0, np.sqrt(0.5), -np.sqrt(0.5)]], axis=1)
    distance = np.linalg.norm(flat[:, None] * [1.0, -1.0] - elbows(q), axis=2)
    distance = np.minimum(
        np.abs(distance - [0.45, 0.4]).max(axis=1),
        np.abs(np.linalg.norm(flat[:, None] - elbows(q), axis=2) - [0.45, 0.4]).max(axis=1),
    )
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(kinematics.ik(r), q, atol=1e-11)


def test_it_swings_and_keeps_its_energy_and_its_lengths():
    swing = simulate(FiveBar(n=[0.0, -1.0, 0.0]), stop=0.3)
    q = np.stack([swing["cranks[0].phi"], swing["cranks[1].phi"]], axis=1)
    flat = swing["tool.r"][:, [0, 2]]
    np.testing.assert_allclose(np.linalg.norm(flat[:, None] - elbows(q), axis=2), COUPLER, atol=1e-6)
    assert swing["tool.r"][-1, 2] < swing["tool.r"][0, 2] - 0.05  # it falls


def test_a_start_on_the_other_side():
    below = Kinematics(FiveBar(tool=dict(r=Start([0.0, -0.02, 0.0]))))
    np.testing.assert_allclose(below.fk(below.home.q)[0], below.home.r, atol=1e-12)
