"""Choosing poses: against exhaustive search, random choice, and the spread of calibrations of measured poses."""

import itertools

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, GantryTau, prototypes
from gantrytau_optimica.calibration.arm_fit import fit_arm, scales
from gantrytau_optimica.calibration.arm_poses import poses_of
from gantrytau_optimica.calibration.arms import read_arms
from gantrytau_optimica.calibration.identifiability import Poses
from gantrytau_optimica.calibration.pose_selection import enough_poses, predict, select_poses
from tests.calibration.f1_data import f1_arms, f1_poses
from tests.calibration.linear_data import three_link_poses


@pytest.fixture(scope="module")
def f1_robot():
    return F1GantryTau(prototypes.F1)


@pytest.fixture(scope="module")
def f1_candidates():
    return f1_poses(f1_arms(), 600)


@pytest.fixture(scope="module")
def robot():
    return GantryTau(prototypes.L1)


@pytest.fixture(scope="module")
def candidates():
    return three_link_poses(400)


def information(jacobians: list[np.ndarray], rows) -> float:
    """Sum of log det of J'J of the arms at some poses."""
    return sum(np.linalg.slogdet(J[list(rows), 0].T @ J[list(rows), 0])[1] for J in jacobians)


def test_exchange_finds_nearly_the_best_of_all_choices(robot):
    few = three_link_poses(13, seed=5)
    jacobians = [arm.closure(*few)[1] * scales(arm) for arm in read_arms(robot)]
    best = max(information(jacobians, rows) for rows in itertools.combinations(range(13), 9))
    found = information(jacobians, select_poses(robot, few, 9))
    assert best - 0.3 < found <= best + 1e-9  # a per cent for each of 21 unknowns


def test_40_d_optimal_poses_of_the_f1_beat_40_random_ones(f1_robot, f1_candidates):
    def expected(rows):
        return predict(f1_robot, f1_candidates, rows, angle=2e-5).error

    chosen = expected(select_poses(f1_robot, f1_candidates, 40))
    drawn = [expected(select_poses(f1_robot, f1_candidates, 40, method="random", seed=k)) for k in range(5)]
    assert min(drawn) > 1.3 * chosen
    # as few as 20 say as much as 40 random ones
    assert expected(select_poses(f1_robot, f1_candidates, 20)) < np.mean(drawn)


def test_order_of_the_methods(robot, candidates):
    def expected(method, seed=0):
        return predict(robot, candidates, select_poses(robot, candidates, 40, method=method, seed=seed)).error

    drawn = np.mean([expected("random", seed) for seed in range(5)])
    assert expected("tool") < expected("d-optimal") < expected("condition") < drawn
    assert drawn > 1.25 * expected("d-optimal")  # a box without orientations has fewer bad choices
    assert drawn > 1.35 * expected("tool")


def test_predicted_error_is_that_of_calibrations(robot, candidates):
    # thirty calibrations of simulated measurements of the chosen poses, and forward kinematics at all candidates
    arms, rows = read_arms(robot), select_poses(robot, candidates, 30)
    predicted = predict(robot, candidates, rows, noise=1e-5)
    squares = np.zeros(len(candidates.r))
    for seed in range(30):
        noise = 1e-5 * np.random.default_rng(seed).standard_normal((30, 3))
        fitted = [fit_arm(arm, candidates.q[rows], candidates.r[rows] + noise, None).arm for arm in arms]
        r, _ = poses_of(fitted, candidates.q, candidates.r, None)
        squares += ((r - candidates.r) ** 2).sum(axis=1) / 30
    # errors of poses go together: 21 unknowns and 30 fits give their mean square to a tenth
    assert np.sqrt(squares.mean()) == pytest.approx(np.sqrt((predicted.position**2).mean()), rel=0.15)


def test_predicted_error_of_the_f1_is_that_of_calibrations(f1_robot, f1_candidates):
    arms = f1_arms()
    some, elsewhere = (
        Poses(*(each[part] for each in f1_candidates)) for part in (slice(100), slice(500, 600))
    )
    tape = 1e-3  # m; of a centimetre the turntables no longer answer linearly
    predicted = predict(f1_robot, f1_candidates, range(100), at=elsewhere, noise=1e-5, tape=tape)
    squares = np.zeros(len(elsewhere.r))
    for seed in range(15):
        rng = np.random.default_rng(seed)
        r = some.r + 1e-5 * rng.standard_normal((100, 3))
        fitted = []
        for arm in arms:
            known = tape * scales(arm)
            start = arm.moved(known * rng.standard_normal(arm.count))
            prior = dict(zip(arm.names, known, strict=True))
            fitted.append(fit_arm(start, some.q, r, some.R, tape=tape, prior=prior).arm)
        squares += ((poses_of(fitted, *elsewhere)[0] - elsewhere.r) ** 2).sum(axis=1) / 15
    assert np.sqrt(squares.mean()) == pytest.approx(np.sqrt((predicted.position**2).mean()), rel=0.25)


def test_more_poses_predict_less_error_by_the_square_root(robot, candidates):
    twice = Poses(np.tile(candidates.q, (2, 1)), np.tile(candidates.r, (2, 1)), None)
    once, both = (predict(robot, poses, at=candidates).error for poses in (candidates, twice))
    assert both == pytest.approx(once / np.sqrt(2), rel=1e-3)  # what a tape measure adds


def test_enough_poses_are_about_the_fewest(robot, candidates):
    rows = enough_poses(robot, candidates, 5e-6)
    assert predict(robot, candidates, rows).error <= 5e-6
    fewer = select_poses(
        robot, candidates, 4 * len(rows) // 5
    )  # five for one in twenty, as exchanges end unlike
    assert predict(robot, candidates, fewer).error > 5e-6


def test_rows_are_ascending_finite_and_repeatable(robot, candidates):
    q = candidates.q.copy()
    q[::2] = np.nan  # out of reach
    for method in ("d-optimal", "tool", "condition", "random"):
        rows = select_poses(robot, (q, candidates.r), 20, method=method, seed=3)
        assert len(set(rows)) == 20
        assert (np.diff(rows) > 0).all()
        assert (rows % 2 == 1).all()
        assert (rows == select_poses(robot, (q, candidates.r), 20, method=method, seed=3)).all()


def test_wrong_questions_are_told(robot, candidates):
    with pytest.raises(
        ModelError, match=r"method: found 'best', expected one of 'd-optimal', 'tool', 'condition'"
    ):
        select_poses(robot, candidates, 10, method="best")  # type: ignore
    with pytest.raises(ModelError, match=r"n: found 401, expected 1 to 400, as many poses as there are"):
        select_poses(robot, candidates, 401)
    with pytest.raises(
        ModelError, match=r"error: all 400 candidates leave .* m, expected no more than 1e-09 m"
    ):
        enough_poses(robot, candidates, 1e-9)
    with pytest.raises(ModelError, match=r"rows: found some that the candidates do not have"):
        predict(robot, candidates, [3, 400])
