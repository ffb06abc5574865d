"""What goes wrong while poses are measured: drifts, jumps, every k-th row, so many wrong rows that a fit follows them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau_models import F1GantryTau, GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate
from tests.optimica.calibration import f1_data, synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, inverse, nominal

OFF = 1e-3  # m, a hundred times the noise


def l1(seed=0, count=60, mixed=True):
    """Poses of an L1 in a mixed order, or in that of a grid."""
    q, r = grid(prototypes.L1)
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(q), count, replace=False)
    rows = rows if mixed else np.linspace(0, len(q) - 1, count).round().astype(int)
    return nominal(2e-3, seed), q[rows], r[rows] + NOISE * rng.standard_normal((count, 3)), None


def d1(seed=0, count=60, mixed=True):
    with pytest.MonkeyPatch.context() as patch:
        for name in ("BEND", "CYCLE", "LOAD"):
            patch.setattr(synthetic_d1, name, np.zeros(3))
        q, r, R, _ = synthetic_d1.measure(seed, count)
    order = np.random.default_rng(seed).permutation(count) if mixed else np.arange(count)
    return SixLinkGantryTau(prototypes.D1), q[order], r[order], R[order]


def f1(seed=0, count=60, mixed=True):
    poses = f1_data.measured(f1_data.f1_poses(f1_data.f1_arms(), count, seed=seed), seed=seed)
    return F1GantryTau(prototypes.F1), *poses


ROBOTS = pytest.mark.parametrize("robot", [l1, d1, f1])


def found_in(robot, q, r, R):
    """The findings by kind, but for what data do not hold."""
    found = calibrate(robot, Measurements(q, r, R))
    return {f.kind: f for f in found.findings if f.kind != "undetermined"}


def size(words, finding):
    """The number that a message names."""
    found = re.search(words, finding.message)
    assert found, finding.message
    return float(found[1])


def moved(r, along, axis=0):
    """Positions with an offset that differs from row to row, (N,) in m, along an axis."""
    r = r.copy()
    r[:, axis] += along
    return r


@ROBOTS
def test_positions_that_drift(robot):
    nominal_robot, q, r, R = robot()
    kinds = found_in(nominal_robot, q, moved(r, OFF * np.linspace(0, 1, len(r))), R)
    assert "slip" not in kinds
    assert size(r"positions drift by ([\d.]+) mm", kinds["drift"]) == pytest.approx(1.0, abs=0.05)
    assert "measure again, the first poses once more at the end" in kinds["drift"].message
    assert len(kinds["drift"].rows) == len(r)


def test_a_drift_that_settles_and_one_in_the_order_of_the_places():
    t = np.linspace(0, 1, 60)
    robot, q, r, R = l1()
    settled = found_in(robot, q, moved(r, OFF * (1 - np.exp(-5 * t)), 2), R)["drift"]
    # a polynomial of the third degree
    assert size(r"drift by ([\d.]+) mm", settled) == pytest.approx(1.0, abs=0.1)
    robot, q, r, R = l1(mixed=False)
    drift = found_in(robot, q, moved(r, OFF * t), R)["drift"]
    assert size(r"drift by ([\d.]+) mm", drift) == pytest.approx(1.0, abs=0.1)  # hardly told from the numbers
    assert drift.message.endswith("an error of the model may look the same: a mixed order tells")


def test_an_actuator_and_a_frame_that_drift():
    robot, q, r, R = d1()
    q = q.copy()
    q[:, 1] += OFF * np.linspace(0, 1, len(q))
    assert "q2 drifts by +1" in found_in(robot, q, r, R)["drift"].message
    robot, q, r, R = d1()
    turn = Rotation.from_rotvec(np.outer(np.linspace(0, 5e-4, len(r)), [0, 0, 1])).as_matrix()
    assert "drift" in found_in(robot, q, np.einsum("nij,nj->ni", turn, r), turn @ R)


@ROBOTS
def test_positions_that_jump(robot):
    nominal_robot, q, r, R = robot()
    kinds = found_in(nominal_robot, q, moved(r, np.where(np.arange(len(r)) < 35, 0.0, OFF), 1), R)
    assert kinds["jump"].rows.tolist() == list(range(35, len(r)))
    assert size(r"positions lie off by ([\d.]+) mm", kinds["jump"]) == pytest.approx(1.0, abs=0.05)
    assert "the device or the robot was moved; calibrate the parts apart" in kinds["jump"].message


@ROBOTS
@pytest.mark.parametrize(("first", "step"), [(0, 3), (1, 3), (0, 6), (3, 6), (1, 2)])
def test_every_other_row_is_wrong(robot, first, step):
    """Whichever half they fall in: every second row is held out."""
    nominal_robot, q, r, R = robot()
    wrong = np.arange(len(r)) % step == first
    kinds = found_in(nominal_robot, q, moved(r, OFF * wrong, 1), R)
    rows = set(np.flatnonzero(wrong))
    if step == 2:  # nothing says which half is right
        assert "outliers" in kinds or "period" in kinds
    else:
        assert set(kinds["period"].rows) == rows
        # 38 numbers of an arm of an F1 follow 20 wrong rows so far that not all of these stand out
        assert robot is f1 or set(kinds["outliers"].rows) == rows
        word = {3: "third", 6: "sixth"}[step]
        assert f"in every {word} row, rows {first}, {first + step}, " in kinds["period"].message


@pytest.mark.parametrize("robot", [l1, d1])
def test_a_third_of_the_rows_is_wrong_by_chance(robot):
    nominal_robot, q, r, R = robot()
    wrong = np.zeros(len(r), dtype=bool)
    wrong[np.random.default_rng(5).choice(len(r), len(r) // 3, replace=False)] = True
    kinds = found_in(nominal_robot, q, moved(r, OFF * wrong, 1), R)
    assert set(kinds) == {"outliers"}
    assert kinds["outliers"].rows.tolist() == np.flatnonzero(wrong).tolist()


def test_rows_that_are_off_by_less_than_an_outlier_are_told_by_their_period():
    robot, q, r, R = l1()
    kinds = found_in(robot, q, moved(r, np.where(np.arange(60) % 3 == 0, OFF / 10, 0.0), 1), R)
    assert set(kinds) == {"period"}
    assert kinds["period"].rows.tolist() == list(range(0, 60, 3))


@pytest.mark.parametrize("mixed", [True, False])
def test_clean_measurements_raise_no_alarm(mixed):
    for seed in range(20):
        for count in (16, 30, 60):
            assert not found_in(*l1(seed, count, mixed))
    for seed in range(6):
        assert not found_in(*d1(seed, 50, mixed))
    assert not found_in(*f1())


def test_an_error_of_the_model_is_no_drift():
    """Guideways of the L1 are not parallel; held so they leave 1 mm, whose course over a grid is smooth."""
    _, q, r, _ = l1(count=200, mixed=False)
    found = calibrate(GantryTau(prototypes.L1), Measurements(q, r), model="parallel")
    assert not {"drift", "jump", "period"} & {f.kind for f in found.findings}
    for seed in range(3):  # and guideways that bend
        q, r, R, _ = synthetic_d1.measure(seed, 100)
        kinds = found_in(SixLinkGantryTau(prototypes.D1), q, r, R)
        assert not {"drift", "jump", "period", "outliers"} & set(kinds)


def test_a_scale_that_all_guideways_share():
    """As of a device that takes air for warmer than it is; where a model has directions of length 1."""
    truth = replace(
        prototypes.L1,
        arms=tuple(
            replace(arm, direction=tuple(np.array(arm.direction) / np.linalg.norm(arm.direction)))
            for arm in prototypes.L1.arms
        ),
    )
    r = grid(prototypes.L1)[1][::10]
    q = inverse(truth, r)
    r = r + NOISE * np.random.default_rng(0).standard_normal(r.shape)
    assert not found_in(GantryTau(truth), q, r, None)
    kinds = found_in(GantryTau(truth), q, 1.0002 * r, None)
    assert set(kinds) == {"scale"}
    assert size(r"all guideways are ([\d.]+) m long", kinds["scale"]) == pytest.approx(1.0002, abs=3e-5)
    assert "look at the scale of the device (temperature, refraction)" in kinds["scale"].message


@pytest.mark.parametrize(("of_q", "of_r", "words"), [(1, 1e-3, "r in km"), (1e-3, 1e-3, "q and r in km")])
def test_metres_that_were_divided_by_a_thousand_once_more(of_q, of_r, words):
    robot, q, r, _ = l1()
    with pytest.raises(CalibrationError, match=words) as caught:
        calibrate(robot, Measurements(q * of_q, r * of_r))
    assert caught.value.kind == "kilometres"
