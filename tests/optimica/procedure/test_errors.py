"""What the procedure cannot do: path, what was found, what was expected, what to do."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Box
from gantrytau_models import FourBar
from gantrytau_optimica import LaserTracker, load_plan, plan_calibration
from gantrytau_optimica.calibration import LengthGauge
from gantrytau_optimica.procedure import robot_samples as fleet
from tests.optimica.procedure import cells
from tests.optimica.procedure.cells import varied
from tests.optimica.refusals import refused

FEW: dict[str, Any] = dict(poses=10, robots=2, tape=0.003, spacing=0.25)


@pytest.mark.parametrize(
    "wrong",
    [
        dict(wanted=200),
        dict(wanted=0.0),
        dict(tape=5),
        dict(poses=7),
        dict(robots=0),
        dict(margin=0.0),
        dict(places=300),  # beside spacing
        dict(home=[1.0, 2.0]),
        dict(home=[0.9, 0.9, 2.5]),
        dict(home=[0.0, 0.0, 2.0]),
        dict(folder="/no/such/place/cell"),
        dict(limits=dict(strokes=(0, 2))),
        dict(device="tracker"),
        dict(device=LengthGauge((1.0, 3.0, 0.0))),
    ],
)
def test_a_wrong_argument_is_refused(wrong):
    cell = dict(zip(("robot", "limits", "device"), cells.l1(), strict=True))
    policy: dict[str, Any] = cell | FEW | wrong
    with refused(*wrong):
        plan_calibration(**policy)


def test_home_that_is_out_of_reach_says_which_limit_it_breaks():
    for home, limit in (([0.9, 0.9, 2.5], "stroke"), ([0.0, 0.0, 2.0], "out of reach")):
        with pytest.raises(ModelError, match=f"the limit '{limit}' broken at home"):
            plan_calibration(*cells.l1(), **varied(FEW, home=home))


def test_wrong_kinds():
    _, limits, device = cells.l1()
    with pytest.raises(ModelError, match=r"FourBar has no 'tool\.r'"):
        plan_calibration(FourBar(), limits, device)
    six, limits, _ = cells.six_links()
    with refused("device"):  # which finds no orientations
        plan_calibration(six, limits, device, robots=1, tape=1e-3)


def test_home_in_a_collision():
    robot, limits, device = cells.l1()
    inside = dataclasses.replace(limits, obstacles=Box((0.8, 2.8, -0.6), (1.0, 3.0, -0.3)))
    with pytest.raises(ModelError, match=r"home: found .* too little clearance between arms\[\d\] and"):
        plan_calibration(robot, inside, device, **FEW)


def test_no_place_visible():
    robot, limits, _ = cells.l1()
    below = LaserTracker((1.0, 3.0, -9.0))  # steeper than its mirror turns
    with pytest.raises(ModelError, match=r"safe places, none of which the LaserTracker at \[1\.0, 3\.0"):
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
    with refused("tape"):
        plan_calibration(six, limits, device, robots=20, tape=0.1)


def test_plans_that_cannot_be_loaded(tmp_path):
    with pytest.raises(ModelError, match=r"load_plan: found no plan at .*, expected plan\.json"):
        load_plan(tmp_path)
    with pytest.raises(ModelError, match=r"load_plan: found no plan at"):
        load_plan(tmp_path / "nowhere")
    file, kind = tmp_path / "plan.json", {"kind": "gantrytau calibration plan"}
    for text, words in (
        ("{", "no calibration plan"),
        ("[]", "no calibration plan"),
        (json.dumps(kind | {"format": 1}), "of another version"),
        (json.dumps(kind), "of another version"),
        (json.dumps(kind | {"format": 2}), "'robot'"),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ModelError, match=words):
            load_plan(tmp_path)
