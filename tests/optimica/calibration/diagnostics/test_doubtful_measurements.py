"""What calibration tells after a fit: slips, misfits, outliers of few poses, mistakes in some rows; and no false alarms."""

import re

import numpy as np
import pytest

from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import CalibrationError, Measurements, calibrate
from tests.families import first_of
from tests.optimica.calibration import synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, nominal

SIX = SixLinkGantryTau(prototypes.D1)


@pytest.fixture(scope="module")
def poses():
    q, r = grid(prototypes.L1)
    return q, r + NOISE * np.random.default_rng(4).standard_normal(r.shape)


@pytest.fixture(scope="module")
def six():
    with pytest.MonkeyPatch.context() as patch:
        for name in ("BEND", "CYCLE", "LOAD"):
            patch.setattr(synthetic_d1, name, np.zeros(3))
        return synthetic_d1.measure(3, 180)


def kinds(found):
    return {finding.kind: finding.rows.tolist() for finding in found.findings}


@pytest.mark.parametrize("size", [2e-3, 1e-4])
def test_a_cart_that_slipped_in_the_middle(poses, size):
    q, r = poses[0].copy(), poses[1]
    q[400:, 1] += size
    found = calibrate(nominal(), Measurements(q, r))
    (slip,) = found.findings
    assert slip.kind == "slip"
    assert slip.rows.tolist() == list(range(400, 779))
    off = re.search(r"q2 is off by ([+\d.]+) mm", slip.message)
    assert off
    assert float(off[1]) == pytest.approx(1e3 * size, abs=2e-3)  # noise of a step is 2 um


def test_a_cart_that_was_off_for_a_while(poses):
    q, r = poses[0].copy(), poses[1]
    q[500:580, 2] += 5e-4
    (slip,) = [f for f in calibrate(nominal(), Measurements(q, r)).findings if f.kind == "slip"]
    assert slip.rows.tolist() == list(range(500, 580))
    assert "q3" in slip.message


def test_a_slip_of_six_links(six):
    q, r, R, _ = six
    q = q.copy()
    q[90:, 0] -= 1e-3
    (slip,) = [f for f in calibrate(SIX, Measurements(q, r, R)).findings if f.kind == "slip"]
    assert slip.rows.tolist() == list(range(90, 180))
    assert "q1 is off by -1 mm" in slip.message


def test_what_a_model_does_not_know_is_no_slip(poses):
    # guideways of the L1 are not parallel: held so, they are off by up to 4 mm at their ends, smoothly
    q, r = poses
    for start in ("nominal", "linear"):
        found = calibrate(GantryTau(prototypes.L1), Measurements(q, r), model="parallel", start=start)
        assert "slip" not in kinds(found)
    # nor where guideways bend and joints on the plate are elsewhere
    robot = SixLinkGantryTau(prototypes.D1)
    for seed in range(3):
        q, r, R, rails = synthetic_d1.measure(seed)
        for model in (None, "parallel", 1, 2, 3, 4, 5):
            assert "slip" not in kinds(calibrate(robot, Measurements(q, r, R, rails=rails), model=model))


def test_one_outlier_is_no_slip(poses):
    q, r = poses[0], poses[1].copy()
    r[310] += [0.05, 0.0, 0.0]
    assert set(kinds(calibrate(nominal(), Measurements(q, r)))) == {"outliers"}


def test_good_measurements_raise_no_alarm(poses, six):
    q, r = grid(prototypes.L1)
    rng = np.random.default_rng(8)
    for count in (16, 20, 30, 60, 200):  # of eight poses for seven parameters too
        for _ in range(6):
            rows = rng.choice(len(q), count, replace=False)
            noisy = r[rows] + NOISE * rng.standard_normal((count, 3))
            found = calibrate(GantryTau(prototypes.L1), Measurements(q[rows], noisy))
            assert not {"outliers", "slip", "misfit"} & set(kinds(found))
    q, r, R, _ = six
    for count in (24, 30, 60, 120):
        rows = rng.choice(len(q), count, replace=False)
        found = calibrate(SIX, Measurements(q[rows], r[rows], R[rows]))
        assert not {"outliers", "slip", "misfit"} & set(kinds(found))


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        (lambda q, r: (q, r * [1, -1, 1]), "sign", "y with the opposite sign"),
        (lambda q, r: (q * [1, 1, -1], r), "sign", "q3 with the opposite sign"),
        (lambda q, r: (q, r / 0.0254), "millimetres", "over more than 50 m"),
        (lambda q, r: (q / 0.0254 * [1, 1, 1], 0 * r + r), "millimetres", "rows 0 to 778"),
        (lambda q, r: (q * [1, 0, 1], r), "constant", "q2 at 0 m"),
    ],
)
def test_signs_units_and_carts_that_stand_still(poses, change, kind, words):
    with pytest.raises(CalibrationError, match=words) as caught:
        calibrate(nominal(), Measurements(*change(*poses)))
    assert caught.value.kind == kind
    assert len(caught.value.rows) == 779


def test_a_sensor_that_hangs(poses):
    q, r = poses[0].copy(), poses[1].copy()
    r[40:60], q[100:110] = r[40], q[100]
    found = calibrate(nominal(), Measurements(q, r))
    stuck = [f.rows.tolist() for f in found.findings if f.kind == "stuck"]
    assert stuck == [list(range(41, 60)), list(range(101, 110))]
    assert found.error < 18e-6


def test_orientations_written_in_another_way(six):
    q, r, R, _ = six
    for wrong, words in (
        (np.swapaxes(R, 1, 2), "R transposed"),
        (scalar_last(R), "scalar of the quaternions"),
    ):
        with pytest.raises(CalibrationError, match=words) as caught:
            calibrate(SIX, Measurements(q, r, wrong))
        assert caught.value.kind == "orientations"
    mixed = R.copy()
    mixed[4:9] = np.swapaxes(R[4:9], 1, 2)
    with pytest.raises(CalibrationError, match="R transposed") as caught:
        calibrate(SIX, Measurements(q, r, mixed))
    assert caught.value.rows.tolist() == [4, 5, 6, 7, 8]


def scalar_last(R):
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat()  # columns x, y, z, w, which are read as w, x, y, z


def test_measurements_a_row_late(six):
    q, r, R, _ = six
    with pytest.raises(CalibrationError, match="same pose in each row") as caught:
        calibrate(SIX, Measurements(q[:-1], r[1:], R[1:]))
    assert caught.value.kind == "misfit"


def test_orientations_of_other_rows_are_doubtful(six):
    # this plate turns by a milliradian: within a layer of poses the row before is nearly right, between layers it is not
    q, r, R, _ = six
    found = calibrate(SIX, Measurements(q, r, np.roll(R, 1, axis=0)))
    assert {"no pose", "misfit", "outliers"} & set(kinds(found))
    assert found.noise > 3 * NOISE


@pytest.mark.parametrize("axis", range(3))
def test_six_links_in_any_frame(six, axis):
    from scipy.spatial.transform import Rotation

    q, r, R, _ = six
    turn = Rotation.from_rotvec(np.roll([2.5, 0.4, -0.3], axis)).as_matrix()
    here, there = (
        calibrate(SIX, Measurements(q, *pose)) for pose in ((r, R), (r @ turn.T + [3, -2, 5], turn @ R))
    )
    assert [f.kind for f in there.findings if f.kind != "undetermined"] == ["frame"]
    assert there.error == pytest.approx(here.error, rel=0.1)  # what data do not hold starts elsewhere
    for i in range(3):
        found = there.parameters[f"arms[{i}].direction"]
        assert found == pytest.approx(turn @ here.parameters[f"arms[{i}].direction"], abs=1e-3)


@pytest.mark.parametrize("start", ["nominal", "linear"])
def test_a_prior_speaks_of_nominal_values_in_any_frame(poses, start):
    q, r = poses
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = calibrate(
        nominal(1e-3), Measurements(q, r @ turn.T + [1, 2, 3]), start=start, prior={"length": 1e-7}
    )
    for name in (f"arms[{i}].length" for i in range(3)):
        assert found.parameters[name] == pytest.approx(found.nominal_rods.values[name], abs=1e-6)


@pytest.mark.parametrize("size", first_of([0.01, 0.001, 0.05, 0.2]))
@pytest.mark.parametrize("holdout", first_of(["second", None]))
def test_one_wrong_pose_is_told_alone(size, holdout):
    """What data hold is decided by the noise of the others: they hold all lengths, and their deviations."""
    q, r = grid(prototypes.L1, 80)
    r = r + NOISE * np.random.default_rng(1).standard_normal(r.shape)
    r[10, 0] += size
    found = calibrate(nominal(), Measurements(q, r), holdout=holdout)
    assert [(finding.kind, finding.rows.tolist()) for finding in found.findings] == [("outliers", [10])]
    assert found.rank == 21
    assert found.covariance(["arms[0].length"]).shape == (1, 1)
