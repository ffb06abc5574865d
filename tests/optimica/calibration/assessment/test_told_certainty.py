"""Poses that are told to be less sure than others: deviations, outliers and the verdict are those of what was told."""

import numpy as np
import pytest

from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate, cross_validate, judge
from gantrytau_optimica.calibration.assessment.calibration_acceptance import expected_error
from tests.families import first_of
from tests.optimica.calibration.synthetic import NOISE, grid

ROBOT = GantryTau(prototypes.L1)
NAMES = [f"arms[{i}].{name}" for i in range(3) for name in ("length", "offset", "direction")]


@pytest.fixture(scope="module")
def poses():
    return grid(prototypes.L1, 120)


def measured(poses, worse, seed=0, every=4):
    """Each `every`-th pose worse by a factor, and told so."""
    q, r = poses
    s = NOISE * np.where(np.arange(len(q)) % every == 0, worse, 1.0)[:, None]
    noise = s * np.random.default_rng(seed).standard_normal(r.shape)
    return Measurements(q, r + noise).uncertain(s[:, None] ** 2 * np.eye(3))


@pytest.mark.nightly
@pytest.mark.parametrize("every", [2, 4])
@pytest.mark.parametrize("worse", [1.0, 3.0, 10.0, 100.0])
def test_told_deviations_are_those_counted_over_seeds(poses, worse, every):
    # 40 seeds tell a deviation to 11 %, of 21 parameters together to 3 %
    runs = [calibrate(ROBOT, measured(poses, worse, seed, every), holdout=None) for seed in range(40)]
    found = np.array([np.hstack([run.parameters[n] for n in NAMES]) for run in runs])
    told = np.mean([np.diag(run.covariance(NAMES)) for run in runs], axis=0)
    assert np.sqrt(np.mean(told / found.var(axis=0, ddof=1))) == pytest.approx(1.0, abs=0.1)
    expected = [expected_error(run).position for run in runs]
    q, r = poses
    off = [np.linalg.norm(run.kinematics.fk(q, near=r)[0] - r, axis=1) for run in runs]
    ratio = np.sqrt(np.mean(np.square(expected)) / np.mean(np.square(off)))
    assert 0.8 < ratio < 1.25
    assert {f.kind for run in runs for f in run.findings} == set()


@pytest.mark.parametrize("loss", first_of(["linear", "robust"]))
def test_worse_poses_leave_deviations_and_noise_those_of_the_others(poses, loss):
    without = np.arange(len(poses[0])) % 4 != 0
    worse = calibrate(ROBOT, measured(poses, 100.0), holdout=None, loss=loss)
    alone = calibrate(ROBOT, measured(poses, 100.0).select(without), holdout=None, loss=loss)
    # a robust median of 90 amounts tells a deviation to 12 %
    assert worse.noise == pytest.approx(NOISE, rel=0.12)
    told, expected = (np.sqrt(np.diag(each.covariance(NAMES))) for each in (worse, alone))
    assert told == pytest.approx(expected, rel=0.15)
    assert worse.findings == ()


def test_the_verdict_counts_poses_by_what_they_are_worth(poses):
    judged = judge(cross_validate(ROBOT, measured(poses, 100.0)), wanted=30e-6)
    assert judged.good
    assert judged.validation_error < 25e-6  # three coordinates of 10 um are 16 um in the mean
    assert 3e-6 < judged.expected_error < 8e-6


def test_a_worse_pose_that_is_off_by_more_than_was_told_is_an_outlier(poses):
    q, _ = poses
    far = measured(poses, 100.0)
    off = far.r.copy()
    off[8, 0] += 0.02  # told 1 mm
    data = Measurements(q, off).uncertain(far.covariance)
    assert [f.rows.tolist() for f in calibrate(ROBOT, data).findings if f.kind == "outliers"] == [[8]]


def test_a_device_that_is_unsure_along_one_axis_tells_deviations_by_it(poses):
    """Depth of cameras, three times worse: told and counted agree in the mean over parameters."""
    q, r = poses
    s = NOISE * np.array([3.0, 1.0, 1.0])
    covariance = np.broadcast_to(np.diag(s**2), (len(q), 3, 3))
    runs = []
    for seed in range(40):
        noise = s * np.random.default_rng(seed).standard_normal(r.shape)
        runs.append(calibrate(ROBOT, Measurements(q, r + noise).uncertain(covariance), holdout=None))
    found = np.array([np.hstack([run.parameters[n] for n in NAMES]) for run in runs])
    told = np.mean([np.diag(run.covariance(NAMES)) for run in runs], axis=0)
    assert np.sqrt(np.mean(told / found.var(axis=0, ddof=1))) == pytest.approx(1.0, abs=0.1)
