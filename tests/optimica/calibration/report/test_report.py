"""The report of a calibration: whole or not at all, and complete for every robot and for bad data."""

import json

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.calibration.report import report
from tests.optimica.calibration import f1_data, synthetic_d1
from tests.optimica.calibration.synthetic import NOISE, grid, nominal

HEADINGS = ("Findings", "Errors", "Principal axes", "Residual tests", "Parameters", "Correlations")
KEYS = {
    "error_m",
    "angle_error_rad",
    "covariance",
    "principal_axes",
    "residual_tests",
    "histogram",
    "findings",
}


@pytest.fixture(scope="module")
def found():
    q, r = grid(prototypes.L1)
    return calibrate(
        nominal(), Measurements(q, r + NOISE * np.random.default_rng(0).standard_normal(r.shape))
    )


def six():
    q, r, R, _ = synthetic_d1.measure(0)
    return calibrate(SixLinkGantryTau(prototypes.D1), Measurements(q, r, R))


def f1():
    poses = f1_data.f1_poses(f1_data.f1_arms(), 120)
    return calibrate(F1GantryTau(prototypes.F1), Measurements(*f1_data.measured(poses, seed=0)))


def without_poses():
    q, r, R, _ = synthetic_d1.measure(3, 180)
    return calibrate(SixLinkGantryTau(prototypes.D1), Measurements(q, r, np.roll(R, 1, axis=0)))


@pytest.mark.parametrize("make", [six, f1, without_poses])
def test_every_robot_has_all_of_it(make, tmp_path):
    page = make().report(tmp_path / "r.html")
    text = page.read_text(encoding="utf-8")
    assert all(f"<h2>{heading}" in text for heading in HEADINGS)
    assert "nan" not in text.lower().replace("nanometre", "")
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8")).keys() >= KEYS


def test_what_was_there_stays_when_a_report_fails(found, tmp_path, monkeypatch):
    page = found.report(tmp_path / "r.html")
    before = page.read_text(encoding="utf-8"), page.with_suffix(".json").read_text(encoding="utf-8")
    monkeypatch.setattr(
        report, "report_numbers", lambda found, about: {**before_numbers, "noise_m": float("nan")}
    )
    before_numbers = json.loads(before[1])
    with pytest.raises(ValueError, match="not JSON compliant"):  # a number that JSON does not know
        found.report(page)
    assert before == (page.read_text(encoding="utf-8"), page.with_suffix(".json").read_text(encoding="utf-8"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.html", "r.json"]


def test_a_report_that_cannot_be_written_leaves_nothing(found, tmp_path):
    (tmp_path / "r.json").mkdir()
    with pytest.raises(ModelError, match="cannot be written"):
        found.report(tmp_path / "r.html")
    assert [p.name for p in tmp_path.iterdir()] == ["r.json"]
    (tmp_path / "file").write_text("x", encoding="utf-8")
    with pytest.raises(ModelError, match="cannot be written"):
        found.report(tmp_path / "file" / "r.html")


@pytest.mark.parametrize("name", ["r.pdf", "r.PDF", "r.csv"])
def test_names_of_other_formats_are_refused(found, tmp_path, name):
    with pytest.raises(ModelError, match=rf"found the name '{name}', expected one that ends in \.html"):
        found.report(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_the_words_are_those_of_the_poses(found, tmp_path):
    text = found.report(tmp_path / "r.html").read_text(encoding="utf-8")
    assert f"{len(found.rows)} poses fitted, {len(found.held_out)} held out" in text
    assert "Errors of poses that were held out" in text
    q, r = grid(prototypes.L1)
    r = r + NOISE * np.random.default_rng(0).standard_normal(r.shape)
    whole = calibrate(nominal(), Measurements(q[::9], r[::9]), holdout=None)
    left_out = np.full(len(q[::9]), 3e-5)
    about = report.About(
        robot="GantryTau(L1)",
        facts={"goal": "200 um"},
        good=False,
        verdict="50 um < 60 um",
        notes=["laid over"],
        lines=np.arange(len(left_out)) + 2,
        validation=left_out,
    )
    page = report.write_report(whole, tmp_path / "w.html", about)
    text = page.read_text(encoding="utf-8")
    numbers = json.loads(page.with_suffix(".json").read_text(encoding="utf-8"))
    assert f"{len(q[::9])} poses fitted, which are all" in text
    assert "held out" not in text
    for words in ("Errors of the fitted poses", "50 um &lt; 60 um", "Not good enough", "laid over", "200 um"):
        assert words in text
    assert "position, by fits without the pose, um" in text
    assert numbers["validation_error_m"]["mean"] == pytest.approx(3e-5)
    assert numbers["date"][:2] == "20"
    assert [one["line"] for one in numbers["poses"]] == about.lines.tolist()  # type: ignore[union-attr]
    worst = max(numbers["poses"], key=lambda one: one["error_m"])
    assert worst["error_m"] == pytest.approx(whole.errors.max())
    assert np.linalg.norm(worst["vector_m"]) == pytest.approx(whole.errors.max())
    arms = nominal().modifications["arms"]
    assert numbers["nominal"]["arms[0].length"] == arms[0]["length"]
    assert numbers["nominal"]["arms[2].offset[1]"] == arms[2]["offset"][1]
    assert "<th>nominal</th><th>change</th>" in text


def test_the_frame_of_measurements_is_told(tmp_path):
    from scipy.spatial.transform import Rotation

    q, r = grid(prototypes.L1)
    turn, shift = Rotation.from_euler("zyx", [2.0, 0.3, -0.2]).as_matrix(), np.array([1.0, -2.0, 0.5])
    found = calibrate(nominal(), Measurements(q, r @ turn.T + shift))
    motion = report.report_numbers(found)["transformation"]
    back = (r @ turn.T + shift) @ np.array(motion["rotation"]).T + motion["translation_m"]
    # nominal values of the synthetic robot are some mm off, and so is the frame that suits them best
    assert np.linalg.norm(back - r, axis=1).max() < 0.02
    assert "base = R measured + t" in found.report(tmp_path / "r").read_text(encoding="utf-8")
    assert report.report_numbers(calibrate(nominal(), Measurements(q, r)))["transformation"] is None


def test_gross_errors_that_were_left_out_do_not_count(tmp_path):
    q, r = grid(prototypes.L1)
    r = r + NOISE * np.random.default_rng(0).standard_normal(r.shape)
    r[[11, 40, 41], 0] += [0.02, 0.01, 0.03]
    data = Measurements(q, r)
    robust = calibrate(nominal(), data, loss="robust")
    assert robust.left_out.tolist() == [11, 40, 41]
    assert robust.error < 3 * NOISE  # of three noisy coordinates
    assert robust.errors.max() > 0.01  # they are there, but not in the mean
    assert any("are left out of the error" in finding.message for finding in robust.findings)
    numbers = report.report_numbers(robust)
    assert numbers["left_out_rows"] == [11, 40, 41]
    assert numbers["error_m"]["max"] < 7 * NOISE
    assert calibrate(nominal(), data, holdout=[11]).left_out.size == 0


@pytest.mark.parametrize("name", ["r.html", "r", "r.json", "robot.2"])
def test_names_of_reports(found, tmp_path, name):
    page = found.report(tmp_path / "new" / name)
    assert page.name == {"robot.2": "robot.2.html"}.get(name, "r.html")
    assert sorted(p.suffix for p in page.parent.iterdir()) == [".html", ".json"]
