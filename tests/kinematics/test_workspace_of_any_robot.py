"""Workspaces of robots through their equations: areas in closed form, and every limit beside its own geometry."""

from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics, examine, workspace
from gantrytau.kinematics.rotations import turned
from gantrytau.kinematics.workspace.obstacles import Box, Capsule
from gantrytau.kinematics.workspace.pose_limits import REASONS, Limits
from gantrytau_models import DeltaRobot, FiveBar, FiveDofGantryTau, GantryTau, StewartPlatform, prototypes
from tests.models.mechanisms.test_five_bar import COUPLER, CRANK, GROUND, elbows

matplotlib.use("Agg")
PLANE = [[-0.75, 0.75], [0.12, 0.75], [0.0, 0.0]]
NO_NAMES: Any = (0.2, 2.0)


@pytest.fixture(scope="module")
def bars():
    return Kinematics(FiveBar())


@pytest.fixture(scope="module")
def delta():
    return Kinematics(DeltaRobot())


@pytest.fixture(scope="module")
def grid(bars):
    """Places of the plane, and the joints there."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 41), np.linspace(0.2, 0.6, 21))
    r = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    return r, bars.ik(r)


def test_five_bars_reach_the_lens_of_two_circles(bars):
    found = workspace(bars, box=PLANE, spacing=0.02, refine=3)
    y = np.linspace(0.12, np.sqrt((CRANK + COUPLER) ** 2 - (GROUND / 2) ** 2), 100_001)
    widths = 2 * (np.sqrt((CRANK + COUPLER) ** 2 - y**2) - GROUND / 2)
    assert found.area == pytest.approx(np.trapezoid(widths, y), abs=3 * found.uncertainty)
    assert found.uncertainty < 0.01 * found.area
    assert "out of reach" in str(found)
    assert len(found.rails) == 0


def test_limits_of_motors_and_of_passive_joints(bars, grid):
    """The angle at an elbow by the law of cosines."""
    r, q = grid
    found = examine(
        bars, r, limits=Limits(strokes=[[1.2, 3.0], [0.2, 1.9]], passive={"elbows[0].phi": (-2.0, -0.9)})
    )
    known = np.isfinite(q).all(axis=1)
    np.testing.assert_array_equal(found.reason == REASONS.index("out of reach"), ~known)
    within = ((q > [1.2, 0.2]) & (q < [3.0, 1.9])).all(axis=1)
    np.testing.assert_array_equal(found.reason == REASONS.index("stroke"), known & ~within)
    distance = np.linalg.norm(r[:, :2] + [GROUND / 2, 0.0], axis=1)
    bend = np.arccos(np.clip((distance**2 - CRANK**2 - COUPLER**2) / (2 * CRANK * COUPLER), -1, 1))
    bent = (bend > 2.0) | (bend < 0.9)
    np.testing.assert_array_equal(found.reason == REASONS.index("passive joint"), known & within & bent)
    assert min((known & ~within).sum(), (known & within & bent).sum(), found.inside.sum()) > 20
    np.testing.assert_allclose(
        found.turn[known], np.minimum(q - [1.2, 0.2], [3.0, 1.9] - q).min(axis=1)[known], atol=1e-12
    )


def test_singular_poses_are_kept_away_from(bars, grid):
    """Speeds by differences of the pose; where couplers are in line the ratio grows beyond any limit."""
    r, q = grid
    found = examine(bars, r, limits=Limits(condition=2.0))
    known = np.isfinite(q).all(axis=1)
    step = 1e-6
    slopes = np.stack(
        [(bars.ik(r + step * e) - bars.ik(r - step * e)) / (2 * step) for e in np.eye(3)[:2]], axis=2
    )
    sizes = np.linalg.svd(slopes[known], compute_uv=False)
    ratio = sizes[:, 0] / sizes[:, 1]
    np.testing.assert_allclose(found.condition[known], ratio, rtol=1e-5)
    np.testing.assert_array_equal(
        found.reason[known] == REASONS.index("near singular"), found.condition[known] > 2.0
    )
    assert 20 < (ratio > 2.0).sum() < known.sum() - 20


def test_bars_and_plate_keep_away_from_obstacles(bars, grid):
    """Distances of a ball from four segments and from the tool, all by hand."""
    r, q = grid
    middle, radius = np.array([0.1, 0.3, 0.0]), 0.02
    limits = Limits(
        obstacles=Capsule(middle, middle, radius), link_radius=0.01, plate=Capsule([0, 0, 0], [0, 0, 0], 0.03)
    )
    found = examine(bars, r, limits=limits)
    known = np.isfinite(q).all(axis=1)
    ends = elbows(q[known])
    pivots = np.broadcast_to([[-GROUND / 2, 0.0], [GROUND / 2, 0.0]], ends.shape)
    tip = np.broadcast_to(r[known, None, :2], ends.shape)
    least = np.linalg.norm(tip[:, 0] - middle[:2], axis=1) - 0.03
    for a, b in ((pivots, ends), (ends, tip)):
        share = np.clip(np.sum((middle[:2] - a) * (b - a), axis=2) / np.sum((b - a) ** 2, axis=2), 0, 1)
        apart = np.linalg.norm(a + share[:, :, None] * (b - a) - middle[:2], axis=2) - 0.01
        least = np.minimum(least, apart.min(axis=1))
    np.testing.assert_allclose(found.clearance[known], least - radius, atol=1e-6)
    assert 20 < (found.reason[known] == REASONS.index("collision")).sum() < known.sum() - 20


def test_the_workspace_of_a_delta_robot(delta, tmp_path):
    """A level slice has the symmetry of three arms, and ends where an arm is out of its limits."""
    limits = Limits(strokes=(-0.6, 1.3), condition=6.0)
    found = workspace(delta, limits, box=[[-0.5, 0.5], [-0.5, 0.5], [-0.8, -0.8]], spacing=0.02)
    assert 0.1 < found.area < 0.6
    turn = np.array([[-0.5, -np.sqrt(0.75), 0.0], [np.sqrt(0.75), -0.5, 0.0], [0.0, 0.0, 1.0]])
    again = examine(delta, found.examined.r @ turn.T, limits=limits)
    assert (again.inside != found.examined.inside).mean() < 1e-3  # but for rounding at the limits
    found.plot(file=tmp_path / "slice.png")
    assert (tmp_path / "slice.png").stat().st_size > 5000


def test_six_and_five_joints_start_with_the_orientation_of_the_start():
    stewart = Kinematics(StewartPlatform(), tool="platform")
    r = stewart.home.r + np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 3.0]])
    limits = Limits(strokes=(0.5, 1.2), condition=50.0, lever=0.3)
    found = examine(stewart, r, limits=limits)
    assert found.inside.tolist() == [True, True, False]
    np.testing.assert_allclose(found.q[:2], stewart.ik(r[:2], stewart.home.R), atol=1e-12)
    tilted = examine(stewart, r[:1], turned(stewart.home.R[None], np.array([[0.2, 0.0, 0.0]])), limits)
    assert tilted.stroke[0] != found.stroke[0]
    five = Kinematics(FiveDofGantryTau(prototypes.L1))
    slice_ = workspace(
        five, Limits(strokes=(0.0, 2.0)), box=[[0.9, 0.9], [2.5, 3.3], [-0.8, 0.0]], spacing=0.1
    )
    assert 0 < slice_.area <= 0.64


@pytest.mark.parametrize("make", [DeltaRobot, FiveBar, lambda: FiveDofGantryTau(prototypes.L1)])
def test_rates_beside_differences_of_the_forward_kinematics(make):
    robot = Kinematics(make())
    q = robot.home.q + np.random.default_rng(0).uniform(-0.03, 0.03, (5, len(robot.joints)))
    r, R = robot.fk(q)
    rates = robot.rates(r, R if robot.turning else None)
    for k in range(len(robot.joints)):
        change = 1e-6 * np.eye(len(robot.joints))[k]
        slope = (robot.fk(q + change)[0] - robot.fk(q - change)[0]) / 2e-6
        np.testing.assert_allclose(rates[:, :3, k], slope, atol=1e-6)


def test_variables_and_rates_beside_the_plane_are_nan(bars):
    beside = np.array([[0.0, 0.5, 0.0], [0.0, 0.5, 0.1], [0.0, 0.5, np.nan]])
    (elbow,) = bars.variables("elbows[0].phi", beside)
    distance = np.hypot(GROUND / 2, 0.5)
    bend = np.arccos((distance**2 - CRANK**2 - COUPLER**2) / (2 * CRANK * COUPLER))
    np.testing.assert_allclose(elbow[:, 0], [-bend, np.nan, np.nan], atol=1e-12)
    assert np.isnan(bars.rates(beside)).all(axis=(1, 2)).tolist() == [False, True, True]
    assert bars.variables([], beside) == []


def test_rates_of_robots_on_rods_and_of_six_joints():
    three = Kinematics(GantryTau(prototypes.L1))
    np.testing.assert_allclose(
        three.rates(three.home.r) @ three.jacobian(three.home.r), np.eye(3), atol=1e-12
    )
    stewart = Kinematics(StewartPlatform(), tool="platform")
    home = stewart.home
    np.testing.assert_allclose(
        stewart.rates(home.r, home.R) @ stewart.jacobian(home.r, home.R), np.eye(6), atol=1e-9
    )


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (dict(ball_joint=0.5), "found Limits.ball_joint of a robot that does not say by rods"),
        (dict(strokes=[[0, 1]] * 2), "found strokes of 2 x 2"),
        (dict(passive={"arms[0].phy": (0, 1)}), "no scalar variable 'arms.0..phy'; did you mean"),
        (dict(passive={"arms[0].phi": (1, 0)}), r"found passive=.*expected \(least, largest\)"),
        (dict(passive=NO_NAMES), "expected .* by name of a variable"),
    ],
)
def test_limits_that_it_does_not_have_are_refused(delta, limits, words):
    with pytest.raises(ModelError, match=words):
        examine(delta, delta.home.r, limits=Limits(**limits))


def test_other_mistakes(delta):
    with pytest.raises(ModelError, match="expected neither; limit its ball joints"):
        examine(GantryTau(prototypes.L1), [0.5, 3.0, -0.6], limits=Limits(condition=5.0))
    with pytest.raises(ModelError, match=r"give box=") as caught:
        workspace(delta)
    assert caught.value.argument == "box"
    with pytest.raises(ModelError, match="answers by its rods alone"):
        Kinematics(GantryTau(prototypes.L1)).variables(["carts[0].s"], [0.5, 3.0, -0.6])
    assert examine(delta, np.zeros((0, 3))).r.shape == (0, 3)
    wall = Limits(obstacles=Box([-1.0, -1.0, -0.7], [1.0, 1.0, -0.65]))
    assert examine(delta, delta.home.r, limits=wall).reason[0] == REASONS.index("collision")
