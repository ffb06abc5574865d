"""An F1 calibrated by `calibrate`, as any other robot."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate
from tests.calibration import f1_data

TRUTH = prototypes.F1


def nominal(size=2e-3, seed=1):
    """An F1 whose joints were placed by tape measure."""
    rng = np.random.default_rng(seed)
    arms = [
        replace(
            arm,
            links=tuple(
                replace(
                    link,
                    length=link.length + rng.normal(0, size),
                    plate_offset=tuple(link.plate_offset + rng.normal(0, size, 3)),
                )
                for link in arm.links
            ),
        )
        for arm in TRUTH.arms
    ]
    return F1GantryTau(replace(TRUTH, arms=arms))


@pytest.fixture(scope="module")
def data():
    poses = f1_data.f1_poses(f1_data.f1_arms(), 200)
    return poses, Measurements(*f1_data.measured(poses, seed=0))


@pytest.mark.parametrize("orientation", ["local", "unit", "free"])
def test_the_f1_is_met_up_to_noise(data, orientation):
    poses, measured = data
    found = calibrate(nominal(), measured, orientation=orientation)
    assert found.success
    assert len(found.names) == {"local": 10 + 23 + 36}.get(orientation, 10 + 24 + 38)
    # noise of the measured position is 16 um in the mean; near singular poses the plate is held ten times worse
    assert 14e-6 < np.median(found.errors) < 25e-6
    assert found.error < 40e-6
    assert np.median(found.angle_errors) < 5 * f1_data.ANGLE  # noise itself gives 1.6 of it
    r, _ = found.chains.fk(poses.q, (poses.r, poses.R))
    assert np.median(np.linalg.norm(r - poses.r, axis=1)) < 18e-6
    with pytest.raises(ModelError, match="data do not hold"):
        found.covariance([found.undetermined[0]])
    assert found.deviations["arms[0].links[0].length"] < 1e-3


def test_a_calibrated_f1_is_a_model(data):
    poses, measured = data
    found = calibrate(nominal(), measured)
    r, R = found.kinematics.fk(poses.q[:10], near=(poses.r[:10], poses.R[:10]))
    mine, turned = found.chains.fk(poses.q[:10], (poses.r[:10], poses.R[:10]))
    assert r == pytest.approx(mine, abs=1e-9)
    assert R == pytest.approx(turned, abs=1e-9)
    with pytest.raises(ModelError, match="rigid"):
        _ = calibrate(nominal(), measured, orientation="free").robot


def test_its_report_and_its_parameters(data, tmp_path):
    found = calibrate(nominal(), data[1])
    assert found.parameters["turntables[1].orientation"].shape == (4,)
    assert (
        found.parameters["turntables[1].orientation[3]"] == found.parameters["turntables[1].orientation"][3]
    )
    assert found.report(tmp_path / "f1.html").exists()
    assert (tmp_path / "f1.json").exists()


def test_outliers_and_a_robust_loss(data):
    measured = data[1]
    r = measured.r.copy()
    r[[3, 50, 121]] += [[0.003, 0, 0], [0, 0.005, 0], [0, 0, -0.004]]
    found = calibrate(nominal(), Measurements(measured.q, r, measured.R), loss="robust")
    (outliers,) = [f for f in found.findings if f.kind == "outliers"]
    # of poses that were not fitted, one near the border of what was may look as bad
    assert set(outliers.rows) >= {3, 50, 121}
    assert len(outliers.rows) <= 6
    assert np.median(found.errors) < 25e-6


def test_a_prior_by_the_last_part_of_its_name(data):
    found = calibrate(nominal(1e-4), data[1], prior={"plate_offset": 1e-4})
    assert np.median(found.errors) < 25e-6
    assert max(d for name, d in found.deviations.items() if "plate_offset" in name) < 1.2e-4
    with pytest.raises(ModelError, match="not identified"):
        calibrate(nominal(), data[1], prior={"plate_ofset": 1e-4})
    with pytest.raises(ModelError, match="one number above 0"):
        calibrate(nominal(), data[1], prior={"plate_offset": (0.1, 1e-4)})


@pytest.mark.parametrize("columns", [[1, 0, 2, 3, 4, 5], [0, 1, 2, 4, 3, 5]])
def test_swapped_columns_are_told(data, columns):
    measured = data[1]
    with pytest.raises(CalibrationError, match="stands in column") as caught:
        calibrate(nominal(), Measurements(measured.q[:, columns], measured.r, measured.R))
    assert caught.value.kind == "swapped columns"


def test_what_does_not_fit_an_f1(data):
    measured = data[1]
    with pytest.raises(CalibrationError, match="nominal lengths"):
        calibrate(nominal(), Measurements(measured.q, measured.r + np.array([0.3, 0.5, 0.2]), measured.R))
    with pytest.raises(ModelError, match="without R"):
        calibrate(nominal(), Measurements(measured.q, measured.r))
    with pytest.raises(ModelError, match="start='linear'"):
        calibrate(nominal(), measured, start="linear")
    with pytest.raises(ModelError, match="no turntables"):
        calibrate(nominal(), measured, model="parallel")
    with pytest.raises(ModelError, match="neither"):
        calibrate(nominal(), measured, method="ipopt", loss="robust")
    with pytest.raises(ModelError, match="3 actuators"):
        calibrate(nominal(), Measurements(measured.q[:, :3], measured.r, measured.R))
