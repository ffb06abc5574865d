"""Frames of carts and turntables against (4.20) to (4.24), the model, and Table 5.5; angles of passive joints."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics, cart_joints
from gantrytau_models import F1GantryTau, GantryTau, Pendulum, SixLinkGantryTau, prototypes

ROUNDING = 1e-14  # of metres and of rotations
SPREAD = np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.5])  # m, rad


@pytest.fixture(scope="module")
def f1() -> Kinematics:
    return Kinematics(F1GantryTau(prototypes.F1))


def ry(q: float) -> np.ndarray:
    """(4.22)."""
    c, s = math.cos(q), math.sin(q)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rx(q: float) -> np.ndarray:
    """(4.24)."""
    c, s = math.cos(q), math.sin(q)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def of(u) -> np.ndarray:
    return Rotation.from_quat(u, scalar_first=True).as_matrix()


def homogeneous(R, r) -> np.ndarray:
    return np.block([[R, np.array(r)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 2, math.pi, -math.pi / 2])
def test_frames_are_those_of_the_thesis(f1, angle):
    q = np.array([0.4, 0.1, -0.2, angle, 0.7 * angle, -angle])
    _, two, three = prototypes.F1.arms
    carts = [
        np.array(arm.offset) + s * np.array(arm.direction)
        for arm, s in zip(prototypes.F1.arms, q, strict=False)
    ]
    first = of(three.turntables[0].orientation) @ ry(q[4])
    expected = [
        homogeneous(np.eye(3), carts[0]),  # (4.20)
        homogeneous(of(two.turntables[0].orientation) @ ry(q[3]), carts[1]),  # (4.21)
        homogeneous(  # (4.23)
            first @ of(three.turntables[1].orientation) @ rx(q[5]),
            carts[2] + first @ three.turntables[1].offset,
        ),
    ]
    found = cart_joints(f1, q, np.zeros(3), np.eye(3))
    np.testing.assert_allclose(found.H, expected, atol=ROUNDING)
    assert [len(frames) for frames in found.chain] == [1, 2, 3]
    np.testing.assert_allclose(found.chain[2][1], homogeneous(first, carts[2]), atol=ROUNDING)
    np.testing.assert_allclose(found.chain[1][0], homogeneous(np.eye(3), carts[1]), atol=ROUNDING)


def test_joints_stand_in_their_frames_and_links_keep_their_lengths(f1):
    # (4.16) to (4.19), the joints of each arm in its H
    q = f1.home.q + 0.3 * SPREAD * np.random.default_rng(1).uniform(-1, 1, (40, 6))
    found = cart_joints(f1, q)
    assert found.H.shape == (40, 3, 4, 4)
    links = [(i, link) for i, arm in enumerate(prototypes.F1.arms) for link in arm.links]
    assert found.links == (
        "arms[0].links[0]",
        *(f"arms[1].links[{j}]" for j in range(2)),
        *(f"arms[2].links[{j}]" for j in range(3)),
    )
    for j, (i, link) in enumerate(links):
        there = found.H[:, i] @ [*link.cart_offset, 1.0]
        np.testing.assert_allclose(found.A[:, j], there[:, :3], atol=ROUNDING)
        np.testing.assert_allclose(found.B[:, j], found.r + found.R @ link.plate_offset, atol=ROUNDING)
    reached = np.isfinite(found.r[:, 0])
    assert reached.sum() > 35
    lengths = np.array([link.length for _, link in links])
    np.testing.assert_allclose(found.length[reached], np.tile(lengths, (reached.sum(), 1)), atol=1e-12)


def test_frames_are_those_of_the_model(f1):
    at = f1.dae.evaluate()
    found = cart_joints(f1, f1.home.q)
    for k, (arm, frame) in enumerate([(1, 1), (2, 1), (2, 2)]):
        np.testing.assert_allclose(
            found.chain[arm][frame][:3, 3], np.ravel(at[f"turntables[{k}].frame_b.r"]), atol=1e-12
        )
        np.testing.assert_allclose(
            found.chain[arm][frame][:3, :3], at[f"turntables[{k}].frame_b.R"], atol=1e-12
        )
    np.testing.assert_allclose(found.r, at["tool.r"], atol=1e-12)


def test_the_facts_of_table_5_5(f1):
    found = cart_joints(f1, np.zeros(6))
    A, B = found.A, found.B
    # joints on turntables are 197.2 and 196.0 mm apart, as against 198.0 and 197.9 mm on the plate
    apart = [np.linalg.norm(x[j] - x[i]) for x in (A, B) for i, j in ((1, 2), (3, 4))]
    # the digits that are printed
    np.testing.assert_allclose(apart, [0.1972, 0.1960, 0.1980, 0.1979], atol=5e-5)
    # axes of q4 and q5 are antiparallel within 1.1 deg, which printed signs are not
    axes = found.H[1, :3, 1], found.chain[2][1][:3, 1]
    assert math.degrees(math.acos(-axes[0] @ axes[1])) < 1.15


def test_the_equal_rotation_of_arms_two_and_three(f1):
    # q4 = -q5 turns both pairs of joints by the same angle about nearly the same axis: (4.32)
    start, end = (cart_joints(f1, [0.4, 0, 0, a, -a, 0], np.zeros(3), np.eye(3)).A for a in (0.0, 0.3))
    for i, j in ((1, 2), (3, 4)):
        before, after = start[j] - start[i], end[j] - end[i]
        cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
        # joints are nearly across the axis
        assert math.acos(cosine) == pytest.approx(0.3, abs=2e-3)


def test_angles_of_joints(f1):
    q = f1.home.q + 0.2 * SPREAD * np.random.default_rng(2).uniform(-1, 1, (20, 6))
    found = cart_joints(f1, q)
    np.testing.assert_allclose(found.ball, f1.ball_joint_angles(found.r, found.R, found.q), atol=1e-12)
    # a universal joint turns by two angles across each other
    np.testing.assert_allclose(np.cos(found.universal).prod(axis=-1), np.cos(found.ball), atol=1e-12)
    home = cart_joints(f1, f1.home.q)
    assert np.abs(home.ball).max() < 1e-7  # a root of rounding
    assert np.abs(home.universal).max() < 1e-12
    np.testing.assert_array_equal(
        found.inside(math.radians(45)), found.ball.max(axis=(1, 2)) <= math.radians(45)
    )
    assert (home.left(math.radians(45)) > math.radians(44.9)).all()


def test_universal_joints_turn_first_about_their_carriers_axis():
    robot = GantryTau(prototypes.L1)
    k = Kinematics(robot)
    q = k.ik([[0.6, 3.0, -0.6], [0.9, 2.8, -0.8]])
    found = cart_joints(k, q, cart_axes=(1.0, 0.0, 0.0))
    # axis x: the first of the axes across it is y, the second x cross y = z
    unit = (found.B - found.A) / found.length[..., None]
    turned = Rotation.from_euler("YZ", found.universal[:, :, 0].reshape(-1, 2))
    np.testing.assert_allclose(turned.apply([1.0, 0.0, 0.0]), unit.reshape(-1, 3), atol=1e-12)


@pytest.mark.parametrize("robot", [GantryTau(prototypes.L1), SixLinkGantryTau(prototypes.D1)])
def test_carts_without_turntables_do_not_turn(robot):
    k = Kinematics(robot)
    found = cart_joints(k, k.home.q)
    assert found.H.shape == (3, 4, 4)
    np.testing.assert_array_equal(found.H[:, :3, :3], np.tile(np.eye(3), (3, 1, 1)))
    np.testing.assert_allclose(found.r, k.home.r, atol=1e-9)
    np.testing.assert_allclose(found.length, k.linked().geometry.length, atol=1e-9)


def test_out_of_reach_frames_remain_and_poses_are_nan(f1):
    found = cart_joints(f1, [f1.home.q, [0.4, 3.0, 0, 0, 0, 0]])
    assert np.isfinite(found.H).all()
    assert np.isfinite(found.A).all()
    assert np.isnan(found.B[1]).all()
    assert np.isnan(found.ball[1]).all()
    assert found.inside(3.0).tolist() == [True, False]


def test_what_does_not_fit_is_refused(f1):
    with pytest.raises(ModelError, match="found R without r"):
        cart_joints(f1, f1.home.q, R=np.eye(3))
    with pytest.raises(ModelError, match="found 2 positions r for 1 rows of q"):
        cart_joints(f1, f1.home.q, np.zeros((2, 3)), np.eye(3))
    for axes in (np.zeros(3), np.ones((5, 3))):
        with pytest.raises(ModelError) as caught:
            cart_joints(f1, f1.home.q, plate_axes=axes)
        assert caught.value.argument == "plate_axes"
    with pytest.raises(ModelError, match="found limit=45"):
        cart_joints(f1, f1.home.q).left(45.0)
    with pytest.raises(ModelError):
        cart_joints(Pendulum(), np.zeros(1))
