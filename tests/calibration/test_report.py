"""The report of a calibration: whole or not at all, and complete for every robot and for bad data."""

import json

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.calibration import report
from tests.calibration import f1_data, synthetic_d1
from tests.calibration.synthetic import NOISE, grid, nominal

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
    monkeypatch.setattr(report, "report_numbers", lambda found: {**before_numbers, "noise_m": float("nan")})
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


@pytest.mark.parametrize("name", ["r.html", "r", "r.json", "robot.2"])
def test_names_of_reports(found, tmp_path, name):
    page = found.report(tmp_path / "new" / name)
    assert page.name == {"robot.2": "robot.2.html"}.get(name, "r.html")
    assert sorted(p.suffix for p in page.parent.iterdir()) == [".html", ".json"]
