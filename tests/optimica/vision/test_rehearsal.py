"""A plan for cameras carried out on rendered images."""

from dataclasses import replace

import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import LaserTracker, Measurements, read_cell
from gantrytau_optimica.procedure import load_planned_cell, plan_cell
from gantrytau_optimica.vision import rehearse_plan

CELL = """\
[robot]
model = "GantryTau(L1)"
tape = "3 mm"
[goal]
error = "1 mm"
poses = 16
[limits]
strokes = [0.0, 1.6]
ball_joint = "50 deg"
link_radius = "20 mm"
[device]
kind = "stereo cameras"
r = [4.5, 2.9, -0.7]
at = [1.0, 2.9, -0.7]
base = 1.0
target = [0.15, 0.0, 0.0]
facing = [1.0, 0.0, 0.0]
[plan]
robots = 2
spacing = 0.15
"""


def robot(name):
    assert name == "GantryTau(L1)"
    return GantryTau(prototypes.L1)


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.toml").write_text(CELL)
    plan_cell(read_cell(folder / "cell.toml", robot), folder / "plan")
    return load_planned_cell(folder / "plan", robot)


def test_images_alone_lead_to_the_verdict(planned):
    told = []
    found = rehearse_plan(planned, seed=1, progress=told.append)
    assert told[0] == "drawing 32 images"
    assert told[-1] == "calibrating"
    assert found.detections.pairs.sum() >= 15
    # lenses were believed to be without distortion, and are not: estimated, they hardly matter any more
    assert found.poses.cameras[0].distortion[0] == pytest.approx(0.033, abs=0.005)
    assert found.poses.cameras[1].distortion[0] == pytest.approx(-0.033, abs=0.005)
    assert found.measured.mean < 2e-3
    assert found.tool.mean < 2e-3
    assert str(found.verdict) in str(found)
    folder, path = found.files
    assert len(list((folder / "camera2").glob("*.png"))) == 16
    measured = Measurements.read(path)
    assert measured.covariance is not None
    assert measured.numbers is not None
    assert set(measured.numbers.tolist()) <= set(planned.plan.numbers[planned.plan.measured].tolist())


def test_lenses_as_believed_leave_the_error_of_the_device(planned):
    found = rehearse_plan(planned, seed=1, intrinsics="fixed")
    assert found.measured.mean > 3e-3
    assert not found.verdict.good
    assert any("intrinsics='estimate'" in finding.message for finding in found.poses.findings)


def test_plans_for_another_device_are_refused(planned):
    other = replace(planned, cell=replace(planned.cell, device=LaserTracker((4.5, 2.9, -0.7))))
    with pytest.raises(ModelError, match='for LaserTracker, expected cameras; set kind = "stereo cameras"'):
        rehearse_plan(other)
