"""What the procedure cannot do: path, what was found, what was expected, what to do."""

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Box
from gantrytau_models import FourBar
from gantrytau_optimica import LaserTracker, LengthGauge, load_plan, plan_calibration
from gantrytau_optimica.procedure import robot_samples as fleet
from tests.optimica.procedure import cells
from tests.optimica.procedure.cells import varied

FEW: dict[str, Any] = dict(poses=10, robots=2, tape=0.003, spacing=0.25)


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        (
            dict(wanted=200),
            r"plan_calibration\.wanted: found 200, expected a length in m .* 200 um as 200e-6",
        ),
        (dict(wanted=0.0), r"plan_calibration\.wanted: found 0\.0"),
        (dict(tape=5), r"plan_calibration\.tape: found 5, .*write 5 mm as 0\.005"),
        (dict(tape=math.nan), r"plan_calibration\.tape: found nan"),
        (dict(poses=7), r"plan_calibration\.poses: found 7, expected a whole number from 8"),
        (dict(poses=10.5), r"plan_calibration\.poses: found 10\.5"),
        (dict(robots=0), r"plan_calibration\.robots: found 0, expected a whole number from 1"),
        (dict(margin=0.0), r"plan_calibration\.margin: found 0\.0, .* no way can be shown to be clear"),
        (
            dict(places=300),
            r"found places=300, expected none beside spacing",
        ),
        (
            dict(spacing=None, places=2.5),
            r"plan_calibration: found places=2\.5, expected a whole number",
        ),
        (dict(home=[1.0, 2.0]), r"plan_calibration\.home: found \[1\.0, 2\.0\], expected 3 finite numbers"),
        (dict(home=[0.9, 0.9, 2.5]), r"home: found the limit 'stroke' broken at home"),
        (dict(home=[0.0, 0.0, 2.0]), r"home: found the limit 'out of reach' broken at home"),
        (dict(folder="/no/such/place/cell"), r"folder: found no folder '/no/such/place' to make it in"),
    ],
)
def test_wrong_numbers(policy, message):
    with pytest.raises(ModelError, match=message):
        plan_calibration(*cells.l1(), **(FEW | policy))


def test_wrong_kinds():
    robot, limits, device = cells.l1()
    wrong: list[Any] = [dict(strokes=(0, 2)), "tracker"]
    with pytest.raises(ModelError, match=r"limits: found dict, expected gantrytau\.kinematics\.Limits"):
        plan_calibration(robot, wrong[0], device)
    with pytest.raises(ModelError, match=r"device: found str, expected a device such as LaserTracker"):
        plan_calibration(robot, limits, wrong[1])
    with pytest.raises(ModelError, match=r"FourBar has no 'tool\.r'"):
        plan_calibration(FourBar(), limits, device)
    with pytest.raises(ModelError, match=r"device: found LengthGauge, which finds no position"):
        plan_calibration(robot, limits, LengthGauge((1.0, 3.0, 0.0)), **FEW)
    six, limits, _ = cells.six_links()
    with pytest.raises(
        ModelError, match=r"device: found LaserTracker for a robot with six links, .* orientations"
    ):
        plan_calibration(six, limits, device, robots=1, tape=1e-3)


def test_home_in_a_collision():
    robot, limits, device = cells.l1()
    inside = dataclasses.replace(limits, obstacles=Box((0.8, 2.8, -0.6), (1.0, 3.0, -0.3)))
    with pytest.raises(
        ModelError,
        match=r"home: found .* too little clearance between arms\[\d\] and obstacles\[0\] \(Box\) .* give home=",
    ):
        plan_calibration(robot, inside, device, **FEW)


def test_no_place_visible():
    robot, limits, _ = cells.l1()
    below = LaserTracker((1.0, 3.0, -9.0))  # steeper than its mirror turns
    with pytest.raises(
        ModelError, match=r"safe places, none of which the LaserTracker at \[1\.0, 3\.0, -9\.0\] sees"
    ):
        plan_calibration(robot, limits, below, **FEW)


def test_no_safe_place():
    robot, limits, device = cells.l1()
    home = np.array([0.79235, 0.95542, 0.97288])
    narrow = dataclasses.replace(limits, strokes=np.stack([home - 1e-4, home + 1e-4], axis=1), obstacles=())
    with pytest.raises(
        ModelError, match=r"found no place in the workspace that keeps the limits|found no safe place"
    ):
        plan_calibration(robot, narrow, device, **varied(FEW, home=home, spacing=0.05))


def test_robots_that_cannot_be_put_together(monkeypatch):
    monkeypatch.setattr(fleet, "DRAWS", 1)
    six, limits, device = cells.six_links()
    with pytest.raises(
        ModelError, match=r"plan_calibration\.tape: found 0\.1 m, with which 1 of 1 robots could not"
    ):
        plan_calibration(six, limits, device, robots=20, tape=0.1)


def test_plans_that_cannot_be_loaded(tmp_path):
    with pytest.raises(ModelError, match=r"load_plan: found no plan at .*, expected plan\.json"):
        load_plan(tmp_path)
    with pytest.raises(ModelError, match=r"load_plan: found no plan at"):
        load_plan(tmp_path / "nowhere")
    file = tmp_path / "plan.json"
    file.write_text("{", encoding="utf-8")
    with pytest.raises(ModelError, match=r"that is no JSON"):
        load_plan(tmp_path)
    file.write_text("[]", encoding="utf-8")
    with pytest.raises(ModelError, match=r"that is no calibration plan, expected one"):
        load_plan(tmp_path)
    for older in ({"format": 1}, {}):
        file.write_text(json.dumps({"kind": "gantrytau calibration plan", **older}), encoding="utf-8")
        with pytest.raises(
            ModelError, match=r"of format (1|without a number), of another version .*plan again"
        ):
            load_plan(file)
    file.write_text(json.dumps({"kind": "gantrytau calibration plan", "format": 2}), encoding="utf-8")
    with pytest.raises(ModelError, match=r"without 'robot', expected a whole plan; plan again"):
        load_plan(file)
