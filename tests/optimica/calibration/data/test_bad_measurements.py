"""Measurements that something is wrong with: found, and told with the rows concerned."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate
from gantrytau_optimica.calibration.data.data_checks import repeated_rows
from tests.optimica.calibration.synthetic import NOISE, grid, inverse, nominal

TRUTH = prototypes.L1


@pytest.fixture(scope="module")
def poses():
    q, r = grid(TRUTH)
    return q, r + NOISE * np.random.default_rng(3).standard_normal(r.shape)


def refused(q, r, robot=None, **arguments):
    before = np.array(q), np.array(r)
    measurements = Measurements(q, r)
    with pytest.raises(CalibrationError) as caught:
        calibrate(robot or nominal(), measurements, **arguments)
    assert np.array_equal(measurements.q, before[0], equal_nan=True)  # nothing was overwritten
    assert np.array_equal(measurements.r, before[1], equal_nan=True)
    return caught.value


def kinds(found):
    return {finding.kind: finding.rows.tolist() for finding in found.findings}


def test_too_few_poses(poses):
    q, r = poses
    error = refused(q[:6], r[:6])
    assert error.kind == "too few poses"
    assert error.rows.tolist() == [0, 1, 2, 3, 4, 5]
    error = refused(q[::70], r[::70])  # twelve, of which six are fitted
    assert error.kind == "too few poses"
    assert "holdout=None" in str(error)


@pytest.mark.parametrize("axis", range(3))
def test_poses_in_a_plane(poses, axis):
    r = poses[1].copy()
    r[:, axis] = r[:, axis].mean()
    q = inverse(TRUTH, r)
    good = np.isfinite(q).all(axis=1)
    error = refused(q[good], r[good] + NOISE * np.random.default_rng(1).standard_normal((good.sum(), 3)))
    assert error.kind == "plane"
    assert len(error.rows) == good.sum()


def test_poses_on_a_line():
    r = np.outer(np.linspace(0, 1, 100), [0.6, 0.5, 0.4]) + np.array([0.3, 2.8, -0.9])
    assert refused(inverse(TRUTH, r), r).kind == "line"


@pytest.mark.parametrize(
    ("columns", "axes", "words"),
    [
        ([1, 0, 2], [0, 1, 2], "q1 stands in column q2, q2 stands in column q1 in"),
        ([0, 1, 2], [1, 0, 2], "x stands in column y"),
        ([0, 1, 2], [0, 2, 1], "z stands in column y"),
        ([2, 1, 0], [1, 0, 2], "x stands in column y"),
    ],
)
def test_swapped_columns(poses, columns, axes, words):
    q, r = poses
    error = refused(q[:, columns], r[:, axes])
    assert error.kind == "swapped columns"
    assert words in str(error)
    assert len(error.rows) == 779


def test_swapped_columns_in_some_rows(poses):
    q, r = poses[0], poses[1].copy()
    r[[4, 8]] = r[[4, 8]][:, [1, 0, 2]]
    error = refused(q, r)
    assert error.kind == "swapped columns"
    assert error.rows.tolist() == [4, 8]
    robust = calibrate(nominal(), Measurements(q, r), loss="robust")
    assert kinds(robust)["swapped columns"] == [4, 8]


def test_rows_with_the_same_mistake_are_told_together():
    q, r = grid(TRUTH, 200)
    q = q.copy()
    q[[4, 9]] = q[[4, 9]][:, [1, 0, 2]]
    for seed in range(
        4
    ):  # in row 9 x and z are nearly alike: as they are exchanged too, by chance links close as well
        noisy = r + NOISE * np.random.default_rng(seed).standard_normal(r.shape)
        error = refused(q, noisy, nominal(1e-2, seed))
        assert "q1 stands in column q2, q2 stands in column q1 in rows 4 and 9; correct these" in str(error)
        assert len(error.findings) == 1


@pytest.mark.parametrize("columns", [[1, 0, 2], [0, 2, 1], [2, 0, 1]])
def test_swapped_columns_in_another_frame(poses, columns):
    q, r = poses
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    error = refused(q[:, columns], r @ turn.T + [1, 2, 3])
    assert error.kind == "swapped columns"
    for k, c in enumerate(np.argsort(columns)):
        assert (f"q{k + 1} stands in column q{c + 1}" in str(error)) == (k != c)
    assert len(error.rows) == 779


def test_a_left_handed_frame(poses):
    q, r = poses
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    error = refused(q, r * [1, -1, 1] @ turn.T + [1, 2, 3])
    assert error.kind == "sign"
    assert "left-handed frame" in str(error)


@pytest.mark.parametrize(("scale_q", "scale_r"), [(1.0, 1e3), (1e3, 1.0), (1e3, 1e3)])
def test_millimetres(poses, scale_q, scale_r):
    q, r = poses
    error = refused(scale_q * q, scale_r * r)
    assert error.kind == "millimetres"
    assert len(error.rows) == 779


def test_millimetres_in_some_rows(poses):
    q, r = poses[0], poses[1].copy()
    r[50:60] *= 1e3
    error = refused(q, r)
    assert error.kind == "millimetres"
    assert error.rows.tolist() == list(range(50, 60))


def test_millimetres_of_a_small_workspace(poses):
    # poses within 20 mm extend over less than 50 m even in mm; nominal values tell
    _, r = poses
    near = np.linalg.norm(r - r.mean(axis=0), axis=1) < 0.35
    middle = r[near].mean(axis=0) + 0.05 * (r[near] - r[near].mean(axis=0))
    error = refused(inverse(TRUTH, middle), 1e3 * middle)
    assert error.kind == "millimetres"


def test_outliers(poses):
    q, r = poses[0], poses[1].copy()
    r[[5, 100, 301]] += [[3e-3, 0, 0], [0, 0.05, 0], [0, 0, 1e-3]]
    found = calibrate(nominal(), Measurements(q, r))
    assert kinds(found) == {"outliers": [5, 100, 301]}
    assert "robust" in found.findings[0].message


def test_nan(poses):
    q, r = poses[0].copy(), poses[1].copy()
    r[7, 1], q[9, 0] = np.nan, np.inf
    found = calibrate(nominal(), Measurements(q, r))
    assert kinds(found) == {"nan": [7, 9]}
    assert not {7, 9} & {*found.rows, *found.held_out}
    assert found.error < 18e-6


@pytest.mark.parametrize("seed", range(8))
def test_repeated_rows_are_those_of_a_comparison_one_by_one(seed):
    random = np.random.default_rng(seed)
    count = 2000
    q = random.integers(-2, 3, (count, 3)) * random.choice([1.0, -1.0], (count, 1))  # also -0, which equals 0
    r = random.integers(0, 1 + 3 * seed, (count, 3)) * 0.5 if seed else random.standard_normal((count, 3))
    known, again = set(), []
    for k, row in enumerate(np.hstack([q, r]) + 0.0):
        if row.tobytes() in known:
            again.append(k)
        known.add(row.tobytes())
    np.testing.assert_array_equal(repeated_rows(q, r), again)


def test_duplicated_rows(poses):
    q, r = (np.vstack([x, x[[10, 11, 10]]]) for x in poses)
    measurements = Measurements(q, r)
    assert kinds(measurements) == {"duplicates": [779, 780, 781]}
    found = calibrate(nominal(), measurements)
    assert len(found.rows) + len(found.held_out) == 779


@pytest.mark.parametrize("signs", [[-1, -1, 1], [1, -1, -1], [-1, 1, -1]])
def test_a_frame_turned_by_half_a_turn(poses, signs):
    q, r = poses
    error = refused(q, r * signs)
    assert error.kind == "rotated frame"
    assert f"about {'xyz'[signs.index(1)]}" in str(error)


def test_another_robot(poses):
    error = refused(*poses, robot=GantryTau(prototypes.D1))
    assert error.kind == "another robot"
    assert "start='linear'" in str(error)


def test_positions_that_belong_to_other_rows(poses):
    q, r = poses
    error = refused(q, r[np.random.default_rng(0).permutation(len(r))])
    assert "same pose in each row" in str(error)


def test_columns_of_another_number_of_actuators(poses):
    q, r = poses
    with pytest.raises(ModelError, match="4 actuators"):
        calibrate(nominal(), Measurements(np.column_stack([q, q[:, 0]]), r))


def test_rotations_that_are_none(poses):
    q, r = poses
    R = np.tile(np.eye(3), (len(r), 1, 1))
    R[[3, 5]] *= -1
    (finding,) = Measurements(q, r, R).findings
    assert finding.kind == "rotations"
    assert finding.rows.tolist() == [3, 5]
    assert "determinant" in str(finding)


def test_nominal_values_by_tape_are_good_enough(poses):
    q, r = poses
    for seed in range(5):
        found = calibrate(nominal(0.05, seed), Measurements(q, r))
        assert found.findings == ()
        assert found.error < 18e-6
