"""Choosing poses: against exhaustive search, random choice, and the spread of calibrations of measured poses."""

import itertools

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, GantryTau, prototypes
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.design.pose_exchange import _Choice
from gantrytau_optimica.calibration.design.pose_selection import enough_poses, predict, select_poses
from gantrytau_optimica.calibration.fitting.fit_arm import fit_arm
from gantrytau_optimica.calibration.links.arm_closure import read_arms
from gantrytau_optimica.calibration.links.arm_factors import scales
from gantrytau_optimica.calibration.links.arm_poses import poses_of
from tests.optimica.calibration.f1_data import f1_arms, f1_poses
from tests.optimica.calibration.linear_data import three_link_poses
from tests.optimica.calibration.synthetic import grid
from tests.optimica.refusals import refused


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


def expected_error(robot, candidates, method, seeds):
    chosen = [select_poses(robot, candidates, 40, method=method, seed=seed) for seed in seeds]
    return np.array([predict(robot, candidates, rows).error for rows in chosen])


@pytest.mark.parametrize("seed", [1, 4])  # the worst of six boxes, and one as most are
def test_40_d_optimal_poses_of_three_links_beat_40_random_ones(robot, seed):
    box = three_link_poses(400, seed=seed)
    drawn, chosen = (
        expected_error(robot, box, method, seeds)
        for method, seeds in (("random", range(20)), ("d-optimal", range(2)))
    )
    assert drawn.mean() > 1.3 * chosen.max()
    assert drawn.min() > 1.1 * chosen.max()


def test_40_d_optimal_poses_of_a_grid_beat_40_random_ones(robot):
    whole = PoseArrays(*grid(prototypes.L1), None)  # the 779 poses of section 5.2
    drawn, chosen = (
        expected_error(robot, whole, method, range(10 if method == "random" else 1))
        for method in ("random", "d-optimal")
    )
    assert drawn.mean() > 1.4 * chosen.max()


def test_d_optimal_poses_are_that_but_for_what_was_given_away(robot, candidates):
    """A design of Fedorov's exchange alone, written here anew, holds hardly more information."""
    jacobians = [arm.closure(*candidates)[1] * scales(arm) for arm in read_arms(robot)]
    rows = list(select_poses(robot, candidates, 40, method="random"))
    while True:
        best, exchange = information(jacobians, rows), None
        variances = [
            np.einsum("ni,ij,nj->n", J[:, 0], np.linalg.inv(J[rows, 0].T @ J[rows, 0]), J[:, 0])
            for J in jacobians
        ]
        new = int(
            np.argmax(np.where(np.isin(range(400), rows), 0.0, np.prod(1 + np.array(variances), axis=0)))
        )
        for old in rows:
            trial = [*(k for k in rows if k != old), new]
            if (found := information(jacobians, trial)) > best + 1e-6:
                best, exchange = found, trial
        if exchange is None:
            break
        rows = exchange
    # slack, and luck
    assert information(jacobians, select_poses(robot, candidates, 40)) > best - 21 * (0.014 + 0.007)


def test_the_least_error_of_all_choices_is_nearly_found(robot):
    few = three_link_poses(13, seed=5)
    every = [predict(robot, few, rows).error for rows in itertools.combinations(range(13), 11)]
    assert predict(robot, few, select_poses(robot, few, 11, method="tool")).error < 1.05 * min(every)


@pytest.mark.parametrize("W", [None, np.diag([1.0, 2.0, 3.0, 0.5])])
def test_exchanges_are_followed_by_rank_updates(W):
    J = np.random.default_rng(0).standard_normal((30, 2, 4))
    choice, inside = _Choice(J, W), np.arange(10)

    def value(rows):
        return _Choice(J, W).renew(np.array(rows))

    before = choice.renew(inside)
    assert choice.growth(1.0, np.array([20]))[0] == pytest.approx(value([*inside, 20]) - before, rel=1e-9)
    assert choice.growth(-1.0, np.array([3]))[0] == pytest.approx(
        value(inside[inside != 3]) - before, rel=1e-9
    )
    choice.move(20, 1.0)
    choice.move(3, -1.0)
    fresh = _Choice(J, W)
    fresh.renew(np.array([*inside[inside != 3], 20]))
    assert choice.half == pytest.approx(fresh.half, abs=1e-12)
    assert choice.inverse == pytest.approx(fresh.inverse, abs=1e-12)


@pytest.mark.parametrize("method", ["d-optimal", "tool", "condition", "random"])
def test_one_all_and_alike(robot, method):
    few = three_link_poses(30)
    for n in (1, 29, 30):
        assert len(set(select_poses(robot, few, n, method=method))) == n
    alike = PoseArrays(np.tile(few.q[:1], (30, 1)), np.tile(few.r[:1], (30, 1)), None)
    assert len(set(select_poses(robot, alike, 5, method=method))) == 5


def test_more_of_the_same_choice_is_never_worse(robot, candidates):
    errors = [
        predict(robot, candidates, select_poses(robot, candidates, n)).error for n in (10, 20, 40, 80, 400)
    ]
    assert np.all(np.diff(errors) < 0)


def test_a_mask_says_the_same_as_rows(robot, candidates):
    mask = np.arange(400) % 7 == 0
    found = [predict(robot, candidates, rows).error for rows in (mask, np.flatnonzero(mask))]
    assert found[0] == found[1]


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
        PoseArrays(*(each[part] for each in f1_candidates)) for part in (slice(100), slice(500, 600))
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
    twice = PoseArrays(np.tile(candidates.q, (2, 1)), np.tile(candidates.r, (2, 1)), None)
    once, both = (predict(robot, poses, at=candidates).error for poses in (candidates, twice))
    assert both == pytest.approx(once / np.sqrt(2), rel=1e-3)  # what a tape measure adds


def test_enough_poses_are_about_the_fewest(robot, candidates):
    rows = enough_poses(robot, candidates, 5e-6)
    assert predict(robot, candidates, rows).error <= 5e-6
    # five for one in twenty, as exchanges end unlike
    fewer = select_poses(robot, candidates, 4 * len(rows) // 5)
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


def test_wrong_questions_are_refused(robot, candidates):
    with refused("n"):
        select_poses(robot, candidates, 401)
    with refused("error"):
        enough_poses(robot, candidates, 1e-9)
    with refused("rows"):
        predict(robot, candidates, [3, 400])
    with pytest.raises(ModelError, match="no finite numbers in any of 400 rows"):
        select_poses(robot, (np.nan * candidates.q, candidates.r), 4)
