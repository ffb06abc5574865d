"""An F1 calibrated by `calibrate`, as any other robot."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate
from gantrytau_optimica.calibration.fitting.fit_arm import fit_arm
from tests.optimica.calibration import f1_data

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
    with pytest.raises(ModelError, match="a number above 0"):
        calibrate(nominal(), data[1], prior={"plate_offset": -1e-4})
    name, value = "arms[0].links[0].length", float(TRUTH.arms[0].links[0].length) + 1e-3
    held = calibrate(nominal(), data[1], prior={name: (value, 1e-9)})  # a pair: about a value of its own
    assert held.parameters[name] == pytest.approx(value, abs=1e-6)


def test_the_frame_of_the_device_is_another(data):
    poses, measured = data
    turn = Rotation.from_rotvec([0.9, -1.4, 2.0]).as_matrix()
    there = Measurements(measured.q, measured.r @ turn.T + [3.0, -2.0, 5.0], turn @ measured.R)
    for orientation in ("free", "local"):
        here, found = (calibrate(nominal(), each, orientation=orientation) for each in (measured, there))
        assert "frame" in {f.kind for f in found.findings}
        assert np.median(found.errors) == pytest.approx(np.median(here.errors), rel=0.05)
    assert there.R is not None
    r, R = found.kinematics.fk(poses.q[:10], near=(there.r[:10], there.R[:10]))  # the robot moved there
    assert r == pytest.approx(poses.r[:10] @ turn.T + [3.0, -2.0, 5.0], abs=2e-4)
    assert R == pytest.approx(turn @ poses.R[:10], abs=2e-4)


def test_positions_of_another_size_make_another_robot(data):
    measured = data[1]
    found = calibrate(nominal(), Measurements(measured.q, 1.3 * measured.r, measured.R))
    (far,) = [f for f in found.findings if f.kind == "far"]
    assert "arms[0].links[0].length by" in far.message


def test_signs_and_degrees_of_turntables_are_told(data):
    measured = data[1]
    for change, kind in (
        (np.r_[np.ones(3), np.full(3, 180 / np.pi)], "degrees"),
        (np.r_[np.ones(3), -1, 1, 1], "sign"),
    ):
        with pytest.raises(CalibrationError) as caught:
            calibrate(nominal(1e-4), Measurements(measured.q * change, measured.r, measured.R))
        assert caught.value.kind == kind


def test_no_alarm_for_good_measurements(data):
    poses, _ = data
    for seed in range(20, 30):
        found = calibrate(F1GantryTau(TRUTH), Measurements(*f1_data.measured(poses, seed=seed)))
        assert {f.kind for f in found.findings} == {"undetermined"}


def test_links_of_different_arms_vary_together(data):
    poses, _ = data
    robot = F1GantryTau(TRUTH)
    names = [
        "arms[0].links[0].length",
        "arms[1].links[0].length",
        "arms[1].links[1].length",
        "arms[2].links[0].length",
    ]
    arms = f1_data.f1_arms()
    runs = []
    for seed in range(60):
        noisy = f1_data.measured(poses, seed=seed)
        fitted = [fit_arm(arm, *noisy).arm.values for arm in arms]
        runs.append([float(fitted[int(name[5])][name]) for name in names])
    sample = np.corrcoef(runs, rowvar=False)
    C = np.mean(
        [
            calibrate(robot, Measurements(*f1_data.measured(poses, seed=seed)), holdout=None).covariance(
                names
            )
            for seed in range(5)
        ],
        axis=0,
    )
    told = C / np.sqrt(np.outer(np.diag(C), np.diag(C)))
    assert told == pytest.approx(sample, abs=0.4)  # three of 1 / sqrt(60)
    assert np.abs(told - np.diag(np.diag(told)))[0].max() > 0.4
    spread = np.std(runs, axis=0, ddof=1)
    assert np.sqrt(np.diag(C)) == pytest.approx(spread, rel=0.27)  # three of 9 %


@pytest.mark.parametrize("columns", [[1, 0, 2, 3, 4, 5], [0, 1, 2, 4, 3, 5], [2, 0, 1, 3, 4, 5]])
def test_swapped_columns_are_told(data, columns):
    measured = data[1]
    with pytest.raises(CalibrationError, match="stands in column") as caught:
        calibrate(nominal(), Measurements(measured.q[:, columns], measured.r, measured.R))
    assert caught.value.kind == "swapped columns"


def test_what_does_not_fit_an_f1(data):
    measured = data[1]
    with pytest.raises(CalibrationError, match="nominal lengths") as caught:
        calibrate(nominal(), Measurements(measured.q, 3.3 * measured.r, measured.R))
    assert caught.value.kind == "another robot"
    assert len(caught.value.rows) == 200
    with pytest.raises(ModelError, match="without R"):
        calibrate(nominal(), Measurements(measured.q, measured.r))
    with pytest.raises(ModelError, match="start='linear'"):
        calibrate(nominal(), measured, start="linear")
    with pytest.raises(ModelError, match="no turntables"):
        calibrate(nominal(), measured, model="parallel")
    with pytest.raises(ModelError, match="3 actuators"):
        calibrate(nominal(), Measurements(measured.q[:, :3], measured.r, measured.R))
