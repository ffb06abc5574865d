"""How far a calibration can be trusted: poses that were not fitted, and the error of the tool, against the truth."""

import numpy as np
import pytest

from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate, cross_validate, judge
from gantrytau_optimica.calibration import held_out, told_by_tool

NOISE = 20e-6  # m per axis
ROBOT = GantryTau(prototypes.L1)


def measured(count, seed=1):
    """The nominal robot itself, measured with noise."""
    kinematics = Kinematics(ROBOT)
    random = np.random.default_rng(seed)
    q = kinematics.home.q + random.uniform(-0.4, 0.4, (4 * count, 3))
    r, _ = kinematics.fk(q)
    good = np.flatnonzero(np.isfinite(r).all(axis=1))[:count]
    return Measurements(q[good], r[good] + NOISE * random.standard_normal((count, 3)))


def test_each_pose_is_foretold_by_a_fit_without_it():
    data = measured(40)
    checked = cross_validate(ROBOT, data, parts=4)
    assert len(checked.calibration.rows) == 40
    alone = calibrate(ROBOT, data, holdout=np.arange(1, 40, 4))
    np.testing.assert_allclose(checked.errors[1::4], alone.errors, rtol=1e-9)
    # three axes of noise, whose mean length is 1.6 deviations, and what 30 poses leave of the fit
    assert 1.6 * NOISE < checked.error < 1.6 * NOISE * np.sqrt(2)


def test_gross_errors_do_not_count():
    data = measured(40)
    r = data.r.copy()
    r[[3, 17]] += 0.01
    checked = cross_validate(ROBOT, Measurements(data.q, r), loss="robust")
    assert checked.calibration.left_out.tolist() == [3, 17]
    assert len(checked.good) == 38
    assert checked.error < 3 * NOISE < checked.errors[3]


def test_poses_that_were_held_out_validate_too():
    found = calibrate(ROBOT, measured(40))
    checked = held_out(found)
    assert np.isnan(checked.errors[found.rows]).all()
    assert checked.error == pytest.approx(float(found.error))
    assert np.isnan(held_out(calibrate(ROBOT, measured(40), holdout=None)).error)


def test_a_verdict_needs_both_errors_to_be_small():
    checked = cross_validate(ROBOT, measured(40))
    good = judge(checked, wanted=100e-6)
    assert good.good
    assert good.validation_error == checked.error
    assert str(good).startswith("good: ")
    bad = judge(checked, wanted=10e-6)
    assert not bad.good
    assert "10 um were wanted; look at the findings" in str(bad)
    fitted = judge(calibrate(ROBOT, measured(40), holdout=None), wanted=1e-3)
    assert not fitted.good  # however well they fit
    assert "no poses that were not fitted validate this" in str(fitted)


def test_too_few_poses_are_foretold_by_none():
    checked = cross_validate(ROBOT, measured(9))  # seven numbers of each link
    assert np.isnan(checked.errors).all()
    assert not judge(checked, wanted=1.0).good
    with pytest.raises(CalibrationError, match="found 6 usable poses"):
        cross_validate(ROBOT, measured(6))


def test_what_data_hold_needs_no_word():
    found = calibrate(ROBOT, measured(40))
    assert told_by_tool(found) is found
