"""A robot calibrated from reconstructed poses: errors that poses share by the cameras are in its deviations."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.vision import reconstruct
from tests.optimica.vision.camera_rig import LENS, lines, pair, seen

LENGTHS = [f"arms[{i}].length" for i in range(3)]


@pytest.mark.nightly
def test_told_deviations_are_those_counted_over_seeds():
    r, q = lines(7, count=12, each=8)
    lengths, told = [], []
    for seed in range(120):  # which tell a deviation to 6 %
        measured = reconstruct(seen(r, pair(), seed=seed), [LENS] * 2, spacing=q).measurements(q)
        found = calibrate(GantryTau(prototypes.GT_A), measured, holdout=None)
        lengths.append([found.parameters[name] for name in LENGTHS])
        told.append([found.deviations[name] for name in LENGTHS])
    ratio = np.mean(told, axis=0) / np.std(lengths, axis=0, ddof=1)
    assert np.all((ratio > 0.8) & (ratio < 1.25))


def test_what_poses_share_adds_to_deviations_and_raises_no_alarm():
    r, q = lines(7, count=12, each=8)
    measured = reconstruct(seen(r, pair()), [LENS] * 2, spacing=q).measurements(q)
    found, apart = (
        calibrate(GantryTau(prototypes.GT_A), each, holdout=None)
        for each in (measured, Measurements(q, measured.r).uncertain(measured.covariance))
    )
    assert found.deviations[LENGTHS[0]] > 2 * apart.deviations[LENGTHS[0]]
    assert {finding.kind for finding in found.findings} <= {"frame", "shared"}
    with pytest.raises(ModelError, match="shared of 96 x 2"):
        measured.uncertain(measured.covariance, np.zeros((96, 2)))
