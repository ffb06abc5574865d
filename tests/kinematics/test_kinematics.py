"""Kinematics of three and six links beside the equations of the models."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import Bounds, Start, translate
from gantrytau.border.refusal import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, SixLinkGantryTau, SixLinkWithWrist, prototypes

WORD: Any = "small"  # where a number is asked for
ROUNDING = 1e-12  # m, some thousand roundings of coordinates of a few metres
AXES = np.eye(3)


@pytest.fixture(scope="module")
def three():
    return Kinematics(GantryTau(prototypes.L1))


@pytest.fixture(scope="module")
def six():
    return Kinematics(SixLinkGantryTau(prototypes.D1))


def joints_near_home(kinematics, count, spread=0.2, seed=0):
    random = np.random.default_rng(seed)
    return kinematics.home.q + random.uniform(-spread, spread, (count, len(kinematics.joints)))


def link_vectors(prototype, q, r):
    """From each cart to the tool, (N, 3, 3) in m: (4.8), written out."""
    places = [
        np.array(a.offset) + q[:, i, None] * np.array(a.direction) for i, a in enumerate(prototype.arms)
    ]
    return r[:, None] - np.stack(places, axis=1)


def lengths(prototype):
    return np.array([arm.length for arm in prototype.arms])


def test_three_links_have_their_lengths_and_are_ahead_of_their_carts(three):
    random = np.random.default_rng(1)
    r = three.home.r + random.uniform(-0.3, 0.3, (500, 3))
    q = three.ik(r)
    links = link_vectors(prototypes.L1, q, r)
    np.testing.assert_allclose(
        np.linalg.norm(links, axis=2), lengths(prototypes.L1) * np.ones((500, 1)), atol=ROUNDING
    )
    assert (np.einsum("nij,ij->ni", links, [arm.direction for arm in prototypes.L1.arms]) > 0).all()


def test_three_links_agree_with_the_equations_of_the_model(three):
    q = joints_near_home(three, 5)
    r, R = three.fk(q)
    function = three.dae.function(["tool.r"], list(three.joints))
    for row in range(5):
        # of the iteration in the model
        np.testing.assert_allclose(np.ravel(function(r[row])), q[row], atol=1e-9)
    np.testing.assert_array_equal(R, np.broadcast_to(AXES, (5, 3, 3)))


def test_many_poses_are_answered_as_one_by_one(three):
    """Across the edges of the blocks in which the work goes."""
    q = joints_near_home(three, 9001)
    r, _ = three.fk(q)
    back = three.ik(r)
    np.testing.assert_allclose(back, q, atol=ROUNDING)
    for row in (0, 4095, 4096, 9000):
        np.testing.assert_allclose(three.ik(r[row]), back[row], atol=1e-15)
    assert three.ik(r[0]).shape == (3,)
    assert [a.shape for a in three.fk(q[0])] == [(3,), (3, 3)]
    assert three.ik(np.zeros((0, 3))).shape == (0, 3)


def test_out_of_reach_is_a_row_of_nan_and_the_others_stay(three):
    r = np.array([three.home.r, three.home.r + 9.0, [np.nan, 0.0, 0.0], three.home.r])
    found = three.ik(r)
    assert np.isnan(found).all(axis=1).tolist() == [False, True, True, False]
    np.testing.assert_allclose(found[[0, 3]], three.home.q * np.ones((2, 1)), atol=ROUNDING)
    r, _ = three.fk([three.home.q, [-9.0, 9.0, 0.0], [np.nan, 0.0, 0.0]])
    assert np.isnan(r).all(axis=1).tolist() == [False, True, True]


def test_guideways_need_be_neither_parallel_nor_unit_vectors():
    directions = ([1.1, 0.05, 0.0], [0.9, 0.0, 0.06], [1.0, -0.04, 0.02])
    arms = [replace(arm, direction=v) for arm, v in zip(prototypes.L1.arms, directions, strict=True)]
    prototype = replace(prototypes.L1, arms=arms)
    kinematics = Kinematics(GantryTau(prototype))
    q = joints_near_home(kinematics, 100)
    r, _ = kinematics.fk(q)
    np.testing.assert_allclose(kinematics.ik(r), q, atol=ROUNDING)
    links = link_vectors(prototype, q, r)
    np.testing.assert_allclose(
        np.linalg.norm(links, axis=2), lengths(prototype) * np.ones((100, 1)), atol=ROUNDING
    )


def test_eight_inverse_and_two_forward_solutions(three):
    q = joints_near_home(three, 4)
    r, _ = three.fk(q)
    inverse = three.configurations(r=r)
    assert len(inverse) == 8
    found = np.stack([c.q for c in inverse])
    np.testing.assert_allclose(found[0], q, atol=ROUNDING)
    assert len(np.unique(found[:, 0].round(6), axis=0)) == 8
    for c in inverse:
        length = np.linalg.norm(link_vectors(prototypes.L1, c.q, r), axis=2)
        np.testing.assert_allclose(length, lengths(prototypes.L1) * np.ones((4, 1)), atol=ROUNDING)
    here, there = three.configurations(q=q)
    np.testing.assert_allclose(here.r, r, atol=ROUNDING)
    # the two points mirror each other in the plane of the carts
    carts = r[:, None] - link_vectors(prototypes.L1, q, r)
    normal = np.cross(carts[:, 1] - carts[:, 0], carts[:, 2] - carts[:, 0])
    np.testing.assert_allclose(np.cross(here.r - there.r, normal), 0.0, atol=1e-11)
    assert here.feasible.all()
    assert there.feasible.shape == (4,)
    near, _ = three.fk(q, near=there.r)
    np.testing.assert_allclose(near, there.r, atol=ROUNDING)
    one = three.configurations(r=r[0])[0]
    assert (one.q.shape, one.r.shape, one.R.shape, bool(one.feasible)) == ((3,), (3,), (3, 3), True)


def test_solutions_beyond_the_bounds_of_the_model_are_not_feasible():
    carts = [dict(s=Bounds(-1.0, 3.0))] * 3
    kinematics = Kinematics(GantryTau(prototypes.L1, carts=carts))
    np.testing.assert_array_equal(kinematics.limits, [[-1.0, 3.0]] * 3)
    for c in kinematics.configurations(r=kinematics.home.r):
        assert c.feasible == ((c.q > -1.0) & (c.q < 3.0)).all()


def test_the_branch_is_that_of_the_start_of_the_model(three):
    other = three.configurations(q=three.home.q)[1].r
    kinematics = Kinematics(GantryTau(prototypes.L1, tool=dict(r=Start(list(other)))))
    r, _ = kinematics.fk(kinematics.home.q)
    np.testing.assert_allclose(r, other, atol=1e-6)  # carts are moved a little from where they were
    np.testing.assert_allclose(kinematics.ik(r), kinematics.home.q, atol=ROUNDING)
    assert kinematics.state(r).tolist() != three.state(three.home.r).tolist() == [1, 1, 1, 1]


def test_jacobians_are_the_slopes_of_the_inverse(three, six):
    for kinematics in (three, six):
        r, _ = kinematics.fk(joints_near_home(kinematics, 20))
        jacobian = kinematics.jacobian(r)
        assert jacobian.shape == (20, 3, 3)
        step = 1e-5  # m: errors of differences are about its square
        for k in range(3):
            slope = (kinematics.ik(r + step * AXES[k]) - kinematics.ik(r - step * AXES[k])) / (2 * step)
            np.testing.assert_allclose(jacobian[:, :, k], slope, atol=1e-8)


def test_the_jacobian_is_that_of_speeds_in_the_model(three):
    function = three.dae.function(["tool.r", "der(tool.r)"], [f"der({n})" for n in three.joints])
    r, _ = three.fk(joints_near_home(three, 1)[0])
    speed = np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(three.jacobian(r) @ speed, np.ravel(function(r, speed)), atol=1e-9)


def test_six_links_agree_with_the_equations_of_the_model(six):
    q = joints_near_home(six, 3, spread=0.05)
    r, R = six.fk(q)
    for row in range(3):
        values = six.dae.evaluate(dict(zip(six.joints, q[row], strict=True)))
        np.testing.assert_allclose(values["tool.r"], r[row], atol=1e-9)  # of consistent starts
        np.testing.assert_allclose(values["tool.R"], R[row], atol=1e-9)


def test_six_links_there_and_back(six):
    q = joints_near_home(six, 3000)
    r, R = six.fk(q)
    assert six.iterations <= 4
    np.testing.assert_allclose(six.ik(r), q, atol=1e-11)
    np.testing.assert_allclose(six.ik(r, R), q, atol=1e-11)
    assert np.ptp(R[:, 0, 1]) > 1e-3  # unlike with three links the plate turns, by parts of a degree


def test_exact_parallelograms_move_as_three_links():
    """Links of an arm parallel and of one length: a six-link robot is the three-link one (4.7)."""
    three = Kinematics(GantryTau(prototypes.L1))
    six = Kinematics(SixLinkGantryTau(prototypes.L1))
    q = joints_near_home(three, 50)
    np.testing.assert_allclose(six.fk(q)[0], three.fk(q)[0], atol=1e-11)
    np.testing.assert_allclose(six.fk(q)[1], np.broadcast_to(AXES, (50, 3, 3)), atol=1e-11)
    r, _ = three.fk(q)
    np.testing.assert_allclose(six.ik(r, AXES), q, atol=1e-11)
    np.testing.assert_allclose(six.jacobian(r), three.jacobian(r), atol=1e-9)


def test_newton_converges_quadratically(six):
    """From 1 cm beside: 1e-2, 1e-4, 1e-8, 1e-16 m. A linear method would need many more."""
    q = joints_near_home(six, 200)
    r, R = six.fk(q)
    again, _ = six.fk(q, near=(r + 0.01 * np.array([0.6, -0.5, 0.6]), R))
    assert six.iterations <= 3
    assert six.iterations_by_pose.shape == (200,)
    np.testing.assert_allclose(again, r, atol=ROUNDING)


def test_an_orientation_that_three_carts_cannot_give_is_out_of_reach(six):
    r, R = six.fk(six.home.q)
    tilted = R @ np.array([[1.0, 0, 0], [0, np.cos(0.01), -np.sin(0.01)], [0, np.sin(0.01), np.cos(0.01)]])
    assert np.isnan(six.ik(r, tilted)).all()
    loose = Kinematics(six.dae, tolerance=0.01)
    assert np.abs(loose.ik(r, tilted) - six.home.q).max() < 0.01


def test_the_jacobian_with_an_orientation_has_six_columns(six):
    r, R = six.fk(joints_near_home(six, 10))
    assert six.jacobian(r, R).shape == (10, 3, 6)
    step = 1e-7  # m, so that links miss their lengths by less than the tolerance
    slope = (six.ik(r + step * AXES[0], R) - six.ik(r - step * AXES[0], R)) / (2 * step)
    np.testing.assert_allclose(six.jacobian(r, R)[:, :, 0], slope, atol=1e-6)  # rounding by the step


def test_assembly_modes_of_six_links_and_their_inverses(six):
    found = six.configurations(q=six.home.q)
    np.testing.assert_allclose(found[0].r, six.home.r, atol=1e-8)
    assert len(found) % 2 == 0  # real ones come in pairs
    assert found[0].feasible
    inverse = six.configurations(r=six.home.r)
    assert len(inverse) == 8
    np.testing.assert_allclose(inverse[0].q, six.home.q, atol=1e-9)


def test_a_wrist_does_not_matter():
    kinematics = Kinematics(SixLinkWithWrist(prototypes.L1))
    plain = Kinematics(SixLinkGantryTau(prototypes.L1))
    q = joints_near_home(plain, 3)
    np.testing.assert_allclose(kinematics.fk(q)[0], plain.fk(q)[0], atol=ROUNDING)


def test_ball_joints_bend_as_the_link_turns(three):
    random = np.random.default_rng(5)
    r = three.home.r + random.uniform(-0.2, 0.2, (20, 3))
    links = link_vectors(prototypes.L1, three.ik(r), r) / lengths(prototypes.L1)[:, None]
    home = (
        link_vectors(prototypes.L1, three.home.q[None], three.home.r[None])[0]
        / lengths(prototypes.L1)[:, None]
    )
    angles = three.ball_joint_angles(r)
    assert angles.shape == (20, 3, 2)
    np.testing.assert_allclose(np.cos(angles[..., 0]), np.sum(links * home, axis=2), atol=1e-12)
    np.testing.assert_allclose(angles[..., 0], angles[..., 1], atol=1e-12)  # nothing turns on either end
    np.testing.assert_allclose(three.ball_joint_angles(three.home.r), 0.0, atol=1e-9)
    along_x = three.ball_joint_angles(r, cart_axes=[AXES[0]] * 3)
    np.testing.assert_allclose(np.cos(along_x[..., 0]), links[..., 0], atol=1e-12)


def test_other_parameters_without_translating_anew(three):
    longer = three.replaced(
        {"arms[1].length": prototypes.L1.arms[1].length + 1e-3, "arms[2].offset[0]": -1.8}
    )
    arms = list(prototypes.L1.arms)
    arms[1] = replace(arms[1], length=arms[1].length + 1e-3)
    arms[2] = replace(arms[2], offset=[-1.8, *arms[2].offset[1:]])
    anew = Kinematics(GantryTau(replace(prototypes.L1, arms=arms)))
    q = joints_near_home(three, 20)
    np.testing.assert_allclose(longer.fk(q)[0], anew.fk(q)[0], atol=ROUNDING)
    assert np.abs(longer.fk(q)[0] - three.fk(q)[0]).max() > 1e-4


def test_a_translated_model_is_as_good():
    dae = translate(GantryTau(prototypes.GT_A))
    kinematics = Kinematics(dae)
    assert kinematics.dae is dae
    assert "carts[0].s" in repr(kinematics)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda k: k.ik([1.0, 2.0]), "found r of 2"),
        (lambda k: k.ik(np.zeros((4, 3), dtype=complex)), "found r="),
        (lambda k: k.ik(np.zeros((4, 3)), np.zeros((2, 3, 3))), "found R of 2 x 3 x 3"),
        (lambda k: k.ik(np.zeros((4, 3)), 1.01 * np.eye(3)), "found no rotation in row 0 of R"),
        (lambda k: k.ik(np.zeros((4, 3)), np.diag([1.0, -1.0, -1.0])), "three links cannot turn"),
        (lambda k: k.fk(np.zeros((4, 6))), "found q of 4 x 6"),
        (lambda k: k.fk(np.zeros((4, 3)), near=np.zeros((2, 3))), "near of 2 rows, expected 1 or 4"),
        (lambda k: k.configurations(), "found neither of q and r"),
        (lambda k: k.configurations(q=np.zeros(3), r=np.zeros(3)), "found both of q and r"),
        (lambda k: k.ball_joint_angles(np.zeros(3), cart_axes=np.eye(2)), "found cart_axes of 2 x 2"),
        (lambda k: k.ball_joint_angles(np.zeros(3), plate_axes=np.zeros((3, 3))), "none of them zero"),
        (lambda k: k.state(np.zeros((2, 3)), q=np.zeros((3, 3))), "q of 3 rows for 2 poses, expected one"),
        (lambda k: k.replaced({"arms[0].lenght": 2.0}), "did you mean 'arms"),
        (lambda k: k.replaced({"arms[0].length": WORD}), r"arms\[0\].length: found 'small'"),
        (lambda k: k.replaced({"arms[0].offset[1]": [1.0, 2.0]}), r"offset\[1\]"),
        (lambda k: k.replaced(2.0), r"found parameters=2.0, expected \{name: value\}"),
        (lambda k: k.fk_of_five_degrees(np.zeros(6)), "expected a robot with turntables"),
    ],
)
def test_what_cannot_be_answered_is_told(three, call, words):
    with pytest.raises(ModelError, match=words):
        call(three)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("which", ["three", "six"])
def test_poses_that_are_no_numbers_disturb_nobody(which, request):
    kinematics = request.getfixturevalue(which)
    q = joints_near_home(kinematics, 4)
    r, _ = kinematics.fk(q)
    for spoilt in (np.nan, np.inf, -np.inf):
        there, joints = r.copy(), q.copy()
        there[1, 2] = joints[2, 0] = spoilt
        lost = [False, True, False, False]
        assert np.isnan(kinematics.ik(there)).all(axis=1).tolist() == lost
        assert np.isnan(kinematics.jacobian(there)).all(axis=(1, 2)).tolist() == lost
        assert np.isnan(kinematics.state(there)).any(axis=1).tolist() == lost
        assert np.isnan(kinematics.ball_joint_angles(there)).any(axis=(1, 2)).tolist() == lost
        assert np.isnan(kinematics.fk(joints)[0]).all(axis=1).tolist() == [False, False, True, False]
        found = kinematics.configurations(q=joints[2])
        assert not any(c.feasible for c in found)


def test_the_forward_kinematics_of_six_links_stays_on_its_branch(six):
    """Carts so far apart that Newton finds other ways to assemble the links, too."""
    q = joints_near_home(six, 3000, spread=2.0)
    robot = six.linked()
    found, turns = six.fk(q)
    freely, free_turns = six.fk(q, near=(robot.single_links(q, robot.repeated(3000)), six.home.R))
    there = np.isfinite(found[:, 0])
    np.testing.assert_array_equal(found[there], freely[there])
    behind = np.isfinite(freely[:, 0]) & (six.state(freely, free_turns, q)[:, 3] != robot.ahead)
    assert behind.any()
    assert not (there & behind).any()
    assert not robot.crossed(q, found, turns)[there].any()


def test_no_iterations_where_links_are_too_short(six):
    """A link is too short for a tool farther from its guideway than the link and its joint on the plate are long."""
    r = six.home.r + np.random.default_rng(3).uniform(-3.0, 3.0, (2000, 3))
    geometry = six.linked().geometry
    v = geometry.direction[geometry.arm] / np.linalg.norm(geometry.direction[geometry.arm], axis=1)[:, None]
    start = geometry.offset[geometry.arm] + geometry.on_cart
    away = np.linalg.norm(np.cross(r[:, None] - start, v), axis=2)
    short = (away > geometry.length + np.linalg.norm(geometry.on_plate, axis=1)).any(axis=1)
    assert 0 < short.sum() < 2000
    q = six.ik(r)
    assert np.isnan(q[short]).all()
    assert not six.iterations_by_pose[short].any()
    assert six.iterations_by_pose[~short].all()


def test_solutions_of_six_links_are_asked_for_one_by_one(six):
    with pytest.raises(ModelError, match="found q of 2 rows, expected one"):
        six.configurations(q=np.zeros((2, 3)))
