"""What a calibration leaves: one record for rods and for named parameters, and the first finding by mistake."""

import numpy as np
import pytest

from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.optimica.calibration.named.test_named_calibration import SCARA, Scara, true_poses
from tests.optimica.calibration.synthetic import NOISE, grid

MISTAKES = {  # name -> kind of the first finding, told deviation over the true one, change of q and r
    "noise told too small": ("noise larger", 0.4, lambda q, r: (q, r)),
    "noise told too large": ("noise smaller", 4.0, lambda q, r: (q, r)),
    "poses written twice": ("duplicates", 1.0, lambda q, r: (q[[*range(80), 3, 4]], r[[*range(80), 3, 4]])),
    "a guideway that waves": ("misfit", 1.0, lambda q, r: (q, r + 5e-3 * np.sin(40 * q[:, :1]))),
}


def on_rods(told, change=lambda q, r: (q, r)):
    q, r = grid(prototypes.L1, 80)
    q, r = change(q, r + NOISE * np.random.default_rng(1).standard_normal(r.shape))
    covariance = np.broadcast_to((told * NOISE) ** 2 * np.eye(3), (len(q), 3, 3))
    return calibrate(GantryTau(prototypes.L1), Measurements(q, r).uncertain(covariance), holdout=None)


def by_names(told):
    q, r, _ = true_poses("scara")
    r = r + NOISE * np.random.default_rng(1).standard_normal(r.shape)
    covariance = np.broadcast_to((told * NOISE) ** 2 * np.eye(3), (len(q), 3, 3))
    names = ["upper.r[0]", "fore.r[0]"]
    return calibrate(Scara(), Measurements(q, r).uncertain(covariance), parameters=names, joints=SCARA)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_first_finding_is_that_of_the_mistake(mistake):
    kind, told, change = MISTAKES[mistake]
    assert on_rods(told, change).findings[0].kind == kind


@pytest.mark.parametrize("found_by", [on_rods, by_names])
def test_what_is_left_is_beside_the_told_noise_what_was_added(found_by):
    sound = found_by(1.0)
    assert sound.findings == ()
    # the size of 30 to 80 errors is known to 13 %; positions are metres, noise is 10 um
    assert list(sound.diagnostics.ratio.values()) == pytest.approx([1.0] * 3, abs=0.3)
    assert min(sound.diagnostics.explained.values()) > 1 - 1e-8
    assert {f.kind for f in found_by(4.0).findings} == {"noise smaller"}
    assert {f.kind for f in found_by(0.25).findings} == {"noise larger"}


def test_directions_that_are_held_parallel_leave_what_is_not_white():
    """Guideways of the L1 are not parallel: what neighbours leave is alike, and of noise it is not."""
    q, r = grid(prototypes.L1, 200)
    r = r + NOISE * np.random.default_rng(1).standard_normal(r.shape)
    free, held = (
        calibrate(GantryTau(prototypes.L1), Measurements(q, r), model=m).diagnostics
        for m in (None, "parallel")
    )
    assert free.facts == ()
    assert {f.kind for f in held.facts} == {"not white"}
    assert min(held.correlation.values()) > 0.5
    assert free.ratio == {}  # no noise was told
