"""Assembly modes over many poses: numbers of the thesis, distances, pictures, and requests that cannot be met."""

import math
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, StructureError
from gantrytau.kinematics import Kinematics, Limits, assembly_study, workspace
from gantrytau.viewing.film import film_of
from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes

MET = 1e-12  # m, rounding of the lengths of links
SPREAD = np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.5])  # m, rad
HOME = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def f1() -> Kinematics:
    return Kinematics(F1GantryTau(prototypes.F1))


@pytest.fixture(scope="module")
def study(f1):
    """50 poses, as in section 4.5; which ones is not printed."""
    q = HOME + SPREAD * np.random.default_rng(0).uniform(-1, 1, (50, 6))
    return assembly_study(f1, q)


def test_all_40_modes_of_50_poses_where_the_thesis_had_16_poses(study):
    assert len(study) == 50
    assert study.complete.sum() >= 49  # a pose in a hundred loses one, `.findings` says it
    # complex modes come in pairs, and 40 is even
    assert not (study.counts % 2).any()
    assert study.counts.max() == 8  # "16 real solutions", each with both signs of its quaternion
    assert sum(study.histogram.values()) == 50
    assert study.histogram == {n: int((study.counts == n).sum()) for n in set(study.counts.tolist())}
    np.testing.assert_array_equal(study.groups.sum(axis=1), study.counts)


def test_eight_modes_are_two_groups_of_four(f1):
    # section 4.5: "two groups of four", the two solutions of the kinematics of three degrees; here Table 5.5 at q = 0
    study = assembly_study(f1, np.zeros(6))
    assert study.counts.tolist() == [8]
    assert str(study).startswith("Assembly modes of F1GantryTau, 1 pose: 8 real ones, 8 in the mean")
    assert study.groups.tolist() == [[4, 4]]
    r, _ = study.modes[0].poses
    three = [c.r for c in f1.configurations(q=np.zeros(6))]
    np.testing.assert_allclose(np.sort(r[:, 2]), np.sort([p[2] for p in three]), atol=1e-9)


def test_the_branch_is_the_pose_that_forward_kinematics_answers(f1, study):
    r, R = f1.fk(study.q)
    there = study.branch >= 0
    np.testing.assert_array_equal(there, np.isfinite(r[:, 0]))
    assert there.sum() >= 25
    for k in np.flatnonzero(there):
        modes = study.modes[k]
        np.testing.assert_allclose(modes.poses[0][study.branch[k]], r[k], atol=1e-9)
        np.testing.assert_allclose(modes.poses[1][study.branch[k]], R[k], atol=1e-9)
        assert not modes.crossed[study.branch[k]]


def test_ball_joints_of_the_f1_leave_one_mode(f1):
    # Figure 4.16: poses within 45 degrees at the ball joints; carts may go half a metre either way
    limits = Limits(strokes=(-0.5, 0.5), ball_joint=math.radians(45))
    inside = workspace(f1, limits, places=30)
    q = inside.examined.q[inside.examined.inside]
    study = assembly_study(f1, q)
    assert len(study) > 20
    assert (study.branch >= 0).all()
    assert (study.counts >= 4).all()
    np.testing.assert_array_equal(study.within(math.radians(45)), 1)
    own = [angles[k] for angles, k in zip(study.angles, study.branch, strict=True)]
    expected = f1.ball_joint_angles(inside.places, np.tile(f1.home.R, (len(q), 1, 1)), q).max(axis=(1, 2))
    np.testing.assert_allclose(own, expected, atol=1e-9)
    np.testing.assert_array_equal(study.within(math.pi), study.counts)
    with pytest.raises(ModelError, match="found limit=45"):
        study.within(45.0)


def test_distances_are_those_of_the_joints_on_the_plate(f1, study):
    row = int(study.counts.argmax())
    r, R = study.modes[row].poses
    joints = np.array([link.plate_offset for arm in prototypes.F1.arms for link in arm.links])
    ends = np.einsum("kij,nj->kni", R, joints) + r[:, None]
    one_by_one = [[np.sqrt(((a - b) ** 2).sum() / 6) for b in ends] for a in ends]
    np.testing.assert_allclose(study.distances(row), one_by_one, atol=1e-14)
    others = study.distances(row)[~np.eye(len(r), dtype=bool)]
    assert study.nearest[row] == others.min()
    with_branch = np.flatnonzero(study.branch >= 0)
    assert (study.to_next[with_branch] >= study.nearest[with_branch]).all()
    assert np.isnan(np.delete(study.to_next, with_branch)).all()


def test_other_geometries_are_further_robots(f1):
    longer = f1.replaced({"arms[0].links[0].length": 2.0})
    q = HOME + np.array([[0, 0, 0, 0, 0, 0], [0, 0.1, 0, 0, 0, 0]])
    both = assembly_study([f1, longer], q)
    assert both.robot.tolist() == [0, 0, 1, 1]
    np.testing.assert_array_equal(both.q, np.concatenate([q, q]))
    alone = assembly_study(longer, q)
    np.testing.assert_array_equal(both.counts[2:], alone.counts)
    np.testing.assert_array_equal(both.distances(3), alone.distances(1))
    assert (both.modes[0].poses[0][0] != both.modes[2].poses[0][0]).any()


def test_the_d1_with_three_carts_has_modes_too():
    robot = Kinematics(SixLinkGantryTau(prototypes.D1))
    q = robot.home.q + np.linspace(-0.2, 0.2, 3)[:, None] * [1, 0, -1]
    study = assembly_study(robot, q)
    assert (study.counts >= 2).all()
    assert (study.branch >= 0).all()
    for row in range(3):
        r, R = study.modes[row].poses
        joints = [link.plate_offset for arm in prototypes.D1.arms for link in arm.links]
        lengths = [link.length for arm in prototypes.D1.arms for link in arm.links]
        carts = [
            np.array(link.offset) + q[row, i] * np.array(arm.direction)
            for i, arm in enumerate(prototypes.D1.arms)
            for link in arm.links
        ]
        gaps = np.einsum("kij,nj->kni", R, np.array(joints)) + r[:, None] - np.array(carts)
        assert np.abs(np.linalg.norm(gaps, axis=2) - lengths).max() < MET


def test_prints_a_table(study):
    lines = str(study).splitlines()
    assert lines[0].startswith("Assembly modes of F1GantryTau, 50 poses: ")
    assert lines[0].endswith(f"{study.counts.mean():.3g} in the mean")
    rows = [line.split() for line in lines[2 : 2 + len(study.histogram)]]
    assert {int(row[0]): int(row[1]) for row in rows} == study.histogram
    assert f"all 40 found in {study.complete.sum()} of 50 poses" in lines


def test_histograms_count_poses(study, tmp_path):
    figure = study.plot(file=tmp_path / "modes.png")
    left, right = figure.axes
    heights = [bar.get_height() for bar in left.containers[0]]
    assert sum(heights) == 50
    assert heights == list(study.histogram.values())
    assert sum(bar.get_height() for bar in right.patches) == 50
    assert (tmp_path / "modes.png").stat().st_size > 5000
    with pytest.raises(ModelError, match=r"expected one of .*\.png"):
        study.plot(file="modes.doc")


def test_a_picture_for_each_mode(study, tmp_path):
    row = int(np.flatnonzero((study.branch >= 0) & (study.counts == 8))[0])
    figure = study.plot_modes(row, file=tmp_path / "robots.png")
    assert len(figure.axes) == 8
    titles = [axis.get_title() for axis in figure.axes]
    own = [k for k, title in enumerate(titles) if "the robot’s" in title]
    assert own == [study.branch[row]]
    free = [k for k, title in enumerate(titles) if "no links crossed" in title]
    assert len(free) == study.feasible[row]
    assert (tmp_path / "robots.png").stat().st_size > 20_000
    for wrong in (50, -1):
        with pytest.raises(ModelError, match=f"found row={wrong}"):
            study.plot_modes(wrong)


def test_the_film_shows_mode_k_from_second_k_on(study):
    row = int(study.counts.argmax())
    shown = study.motion(row)
    film = film_of(shown)
    r, R = study.modes[row].poses
    joints = np.array([link.plate_offset for arm in prototypes.F1.arms for link in arm.links])
    for k in range(len(r)):
        during = (film.times > k + 0.1) & (film.times < k + 0.9)
        place = film.values("plate[4].r", (3,))[during]
        np.testing.assert_allclose(place, np.broadcast_to(r[k] + R[k] @ joints[4], place.shape), atol=1e-12)


def test_the_page_goes_from_mode_to_mode(study, tmp_path):
    pytest.importorskip("viser")
    row = int(study.counts.argmax())
    page = study.view(row, file=tmp_path / "modes.html")
    assert page.file == tmp_path / "modes.html"
    assert page.title == f"{study.counts[row]} assembly modes of F1GantryTau"
    assert page.file.stat().st_size < 3e6


def test_links_that_cannot_meet_have_no_mode_to_show(f1):
    q = HOME + 3.0 * np.eye(6)[1]
    study = assembly_study(f1, q)
    assert study.counts.tolist() == [0]
    assert study.branch.tolist() == [-1]
    assert np.isnan(study.nearest).all()
    assert np.isnan(study.to_next).all()
    assert "apart" not in str(study)
    assert len(study.plot().axes) == 1
    for show in (study.plot_modes, study.motion):
        with pytest.raises(ModelError, match="no real mode in row 0, expected one to show; no mode is real"):
            show()


def test_what_cannot_be_studied_is_refused(f1):
    wrongly: Any = assembly_study
    with pytest.raises(ModelError, match="found GantryTau with 3 links, expected six"):
        assembly_study(GantryTau(prototypes.L1), np.zeros(3))
    with pytest.raises(ModelError, match="found no robot"):
        assembly_study([], np.zeros(6))
    for q in (np.zeros(3), [HOME, np.full(6, np.nan)], np.zeros((0, 6))):
        with pytest.raises(ModelError) as refusal:
            assembly_study(f1, q)
        assert refusal.value.argument == "q"
    with pytest.raises(ModelError):
        wrongly(F1GantryTau, HOME)


def test_modes_that_are_no_separate_poses_name_the_row(f1):
    flat = f1.replaced({f"arms[{i}].links[{j}].plate_offset": [0.1, 0, 0.1 * (i + j)]
                        for i, j in [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)]})  # fmt: skip
    with pytest.raises(StructureError, match=r"row 0 of F1GantryTau: .*one line"):
        assembly_study(flat, HOME)
