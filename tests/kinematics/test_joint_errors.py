"""Errors of joints: first order beside forward kinematics, the three-link robot beside its ellipsoids, rotations."""

from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics, accuracy
from gantrytau_models import DeltaRobot, FiveBar, GantryTau, StewartPlatform, prototypes
from tests.models.mechanisms.test_five_bar import meeting

matplotlib.use("Agg")
ANYHOW: Any = accuracy
SMALL = np.deg2rad([0.01, 0.01, 0.01])


@pytest.fixture(scope="module")
def delta():
    return Kinematics(DeltaRobot())


def test_random_errors_stay_within_the_first_order(delta):
    r = delta.home.r + np.random.default_rng(0).uniform(-0.15, 0.15, (20, 3))
    found = accuracy(delta, r, errors=SMALL)
    sampled = np.linalg.norm(found.sampled(200), axis=2)
    # the second order is a ten thousandth of an error of 1e-4 rad, but near the border of the workspace more
    assert (sampled.max(axis=1) <= 1.001 * found.error).all()
    worst = np.linalg.norm(
        found.displaced(SMALL * [[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]), axis=2
    ).max(axis=1)
    np.testing.assert_allclose(worst, found.error, rtol=1e-3)


def test_on_its_axis_a_delta_robot_errs_alike_in_all_arms(delta):
    errors = 1e-4 * np.eye(3)
    sizes = [accuracy(delta, delta.home.r, errors=e).error[0] for e in errors]
    np.testing.assert_allclose(sizes, sizes[0], rtol=1e-9)


def test_five_bars_beside_circles_that_meet():
    bars = Kinematics(FiveBar())
    q = np.array([[2.0, 1.0], [1.7, 0.8]])
    r, _ = bars.fk(q)
    found = accuracy(bars, r, errors=[1e-6, 0.0])
    moved = np.linalg.norm(meeting(q + np.array([1e-6, 0.0])) - meeting(q), axis=1)
    np.testing.assert_allclose(found.error, moved, rtol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(found.displaced([[1e-6, 0.0]])[:, 0], axis=1), moved, rtol=1e-4)


def test_carts_of_three_links_beside_their_ellipsoids():
    """Errors along the guideways alone are half-widths of the parallelepiped (A.4)."""
    robot = Kinematics(GantryTau(prototypes.L1))
    r = robot.home.r + np.random.default_rng(1).uniform(-0.2, 0.2, (10, 3))
    found = accuracy(robot, r, errors=[1e-5, 1e-5, 1e-5])
    for k, direction in enumerate(arm.direction for arm in prototypes.L1.arms):
        carts = np.zeros((1, 3, 3))
        carts[0, k] = 1e-5 * np.array(direction)
        exact = accuracy(robot, r, np.full((3, 3), 1e-5)).displaced(carts)[:, 0]
        np.testing.assert_allclose(found.rates[:, :, k] * 1e-5, exact, atol=1e-9)


def test_a_platform_also_turns(tmp_path):
    stewart = Kinematics(StewartPlatform(), tool="platform")
    # the last is nowhere
    r = stewart.home.r + np.array([[0.05, 0.0, 0.0], [0.0, 0.05, 0.02], [np.nan, 0.0, 0.0]])
    found = accuracy(stewart, r, errors=np.full(6, 1e-5))
    assert np.isnan(found.error).tolist() == [False, False, True]
    assert (found.turn[:2] > 0).all()
    assert found.corners.shape == (3, 64, 6)
    sampled = np.linalg.norm(found.sampled(50), axis=2).max(axis=1)
    assert (sampled[:2] <= 1.001 * found.error[:2]).all()
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 5))
    places = stewart.home.r + np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    accuracy(stewart, places, errors=np.full(6, 1e-5)).plot("turn", file=tmp_path / "turn.png")
    assert (tmp_path / "turn.png").stat().st_size > 3000


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda d: accuracy(d, d.home.r, errors=[1e-4]), "found errors of 1"),
        (lambda d: accuracy(d, d.home.r, errors=-SMALL), "of at least 0"),
        (lambda d: ANYHOW(d, d.home.r), "found neither semi_axes and errors"),
        (lambda d: ANYHOW(d, d.home.r, np.eye(3), errors=SMALL), "found both semi_axes and errors"),
        (lambda d: accuracy(d, d.home.r, errors=SMALL).turn, "joints choose the position alone"),
        (lambda d: accuracy(d, d.home.r, errors=SMALL).displaced([1.0]), "found errors of 1"),
    ],
)
def test_what_cannot_be_answered_is_refused(delta, call, words):
    with pytest.raises(ModelError, match=words):
        call(delta)


def test_no_poses_are_no_rows(delta):
    found = accuracy(delta, np.zeros((0, 3)), errors=SMALL)
    assert found.error.shape == (0,)
    assert found.displaced(np.zeros((0, 3))).shape == (0, 0, 3)
    assert "JointErrors" in repr(found)
