"""Fits of few poses, which hold only part of the numbers: they end in the minimum of what is held, and foretell poses."""

import numpy as np
import pytest

from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.optimica.calibration import synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, nominal

SIX = SixLinkGantryTau(prototypes.D1)
BOX = [0.4, 0.5, 0.4]  # m, half of the workspace


def six_link_poses(seed, count, placement, monkeypatch):
    """Measurements of a straight D1, and 100 true poses; placement: m, by which joints on the plate are off."""
    for name in ("BEND", "CYCLE", "LOAD"):
        monkeypatch.setattr(synthetic_d1, name, np.zeros(3))
    monkeypatch.setattr(synthetic_d1, "PLACEMENT", placement)
    robot, R = synthetic_d1.make_d1(seed)
    rng = np.random.default_rng(5000 + seed)
    r = synthetic_d1.MIDDLE + rng.uniform(-1, 1, (count + 100, 3)) * BOX
    q = np.empty((len(r), 3))
    for i, arm in enumerate(prototypes.D1.arms):
        d, v = r - np.array(arm.offset), np.array(arm.direction)
        q[:, i] = (d @ v - np.sqrt((d @ v) ** 2 - v @ v * ((d * d).sum(-1) - arm.length**2))) / (v @ v)
    r, R = synthetic_d1.pose_of(robot, q, r, np.broadcast_to(R, (len(r), 3, 3)))
    turn = synthetic_d1.turned(rng.normal(0, synthetic_d1.ANGLE_NOISE, (count, 3)))
    noisy = r[:count] + rng.normal(0, NOISE, (count, 3))
    return Measurements(q[:count], noisy, turn @ R[:count]), (q[count:], r[count:], R[count:])


# joints placed 20 mm off turn the plate by degrees; 2 mm by a tenth of that; 0.2 mm hardly
@pytest.mark.parametrize("placement", [2e-2, 2e-3, 2e-4])
# 33 numbers at the least stand against 6 errors of each pose; beyond the border of 12 poses they leave ten times the noise
# and more: as with scipy's least squares, all numbers drawn to their nominal values by a true prior (152 um at the worst)
@pytest.mark.parametrize(("count", "most"), [(12, 300e-6), (16, 80e-6), (24, 30e-6), (40, 20e-6)])
def test_poses_of_six_links_are_foretold(placement, count, most, monkeypatch):
    for seed in range(6):
        data, (q, r, R) = six_link_poses(seed, count, placement, monkeypatch)
        found = calibrate(SIX, data, holdout=None)
        assert found.success
        assert 33 <= found.rank <= 51
        assert [f"rank {found.rank} of 51" in str(f) for f in found.findings if f.kind == "undetermined"] == (
            [True] if found.undetermined else []
        )
        position, _ = found.chains.fk(q, (r, R))
        assert np.linalg.norm(position - r, axis=1).mean() < most


@pytest.mark.parametrize(("seed", "count", "placement"), [(5, 16, 2e-3), (5, 24, 2e-4), (7, 12, 2e-4)])
def test_ipopt_ends_in_the_same_minimum(seed, count, placement, monkeypatch):
    data, _ = six_link_poses(seed, count, placement, monkeypatch)
    here, there = (calibrate(SIX, data, holdout=None, method=each) for each in ("gauss-newton", "ipopt"))
    assert here.success
    assert there.cost == pytest.approx(here.cost, rel=1e-8)
    for name, value in here.parameters.items():
        assert there.parameters[name] == pytest.approx(value, abs=1e-7)  # deviations are up to 1 cm


def test_rounding_of_the_cost_does_not_spoil_a_fit():
    # with some ten poses rounding errors change the cost by 3e-11 of it
    q, r = grid(prototypes.L1)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        rows = rng.choice(len(q), rng.integers(9, 40), replace=False)
        noisy = r[rows] + NOISE * rng.standard_normal((len(rows), 3))
        assert calibrate(nominal(1e-2, seed), Measurements(q[rows], noisy), holdout=None).success


def test_carts_out_of_reach_leave_no_pose():
    q, r = grid(prototypes.L1)
    q = q.copy()
    q[41, 1] += 10.0
    found = calibrate(GantryTau(prototypes.L1), Measurements(q, r + NOISE), loss="robust")
    (lost,) = [f for f in found.findings if f.kind == "no pose"]
    assert lost.rows.tolist() == [41]
    assert np.isfinite(found.error)
