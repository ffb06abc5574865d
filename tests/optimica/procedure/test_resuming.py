"""An interrupted procedure goes on where it was, and does anew what depends on a change only."""

from dataclasses import replace
from importlib import import_module
from typing import Any

import pytest

from gantrytau.ensembles import parallel_map as parts
from gantrytau.kinematics import Capsule
from gantrytau_optimica import plan_calibration
from gantrytau_optimica.procedure.motion_planning import path_cache as known_ways
from tests.families import first_of
from tests.optimica.procedure import cells
from tests.optimica.procedure.cells import varied

# of which the function has the name
planning = import_module("gantrytau_optimica.procedure.plan_calibration")
FEW: dict[str, Any] = dict(poses=9, robots=3, tape=0.003, spacing=0.25)


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(*cells.l1(), **FEW)


STAGES = {
    "workspace": (planning, "settled_workspace"),
    "candidates": (planning, "find_candidates"),
    "choice": (planning, "choose"),
    "ways": (planning, "ordered"),
    "trials": (planning, "simulated"),
    "verdict": (planning, "decide"),
}


def counted(monkeypatch):
    """How often each stage is computed."""
    counts = dict.fromkeys(STAGES, 0)
    for name, (module, function) in STAGES.items():
        original = getattr(module, function)

        def call(*args, _name=name, _original=original, **more):
            counts[_name] += 1
            return _original(*args, **more)

        monkeypatch.setattr(module, function, call)
    return counts


@pytest.mark.parametrize(
    "stage", first_of(["choice", "trials", "workspace", "candidates", "ways", "verdict"], 2)
)
def test_an_interrupted_procedure_goes_on(plan, stage, tmp_path, monkeypatch):
    module, function = STAGES[stage]
    original, calls = getattr(module, function), []

    def interrupted(*args, **more):
        calls.append(1)
        if stage != "trials" or len(calls) == 3:
            raise KeyboardInterrupt
        return original(*args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(module, function, interrupted)
        with pytest.raises(KeyboardInterrupt):
            plan_calibration(*cells.l1(), **FEW, folder=tmp_path)
    assert not list(tmp_path.rglob(".*"))  # nothing half written
    counts = counted(monkeypatch)
    found = plan_calibration(*cells.l1(), **FEW, folder=tmp_path)
    done = list(STAGES)[: list(STAGES).index(stage)]
    expected = {name: 0 if name in done else 1 for name in STAGES}
    if "trials" not in done:  # three robots and one with averaged readings, of which two were finished
        expected["trials"] = 4 - 2 * (stage == "trials")
    assert counts == expected
    cells.same(found, plan)


def test_only_what_depends_on_a_change_is_done_anew(plan, tmp_path, monkeypatch):
    plan_calibration(*cells.l1(), **FEW, folder=tmp_path)
    counts = counted(monkeypatch)
    found = plan_calibration(*cells.l1(), **FEW, folder=tmp_path, wanted=1e-6)
    assert {name: n for name, n in counts.items() if n} == {"verdict": 1}
    assert not found.verdict.good
    more = plan_calibration(*cells.l1(), **varied(FEW, poses=10), folder=tmp_path)
    assert {name: n for name, n in counts.items() if n} == {"choice": 1, "ways": 1, "trials": 4, "verdict": 2}
    assert more.measured.sum() == 10
    robot, limits, device = cells.l1()
    other = robot.modified(dict(arms=[dict(length=2.07), dict(), dict()]))
    plan_calibration(other, limits, device, **FEW, folder=tmp_path)
    assert counts["workspace"] == counts["candidates"] == 1
    plan_calibration(
        robot, replace(limits, plate=Capsule((0, 0, 0), (0, 0, 0.1), 0.05)), device, **FEW, folder=tmp_path
    )
    assert counts["workspace"] == 2


def test_a_damaged_stage_is_made_anew(plan, tmp_path):
    plan_calibration(*cells.l1(), **FEW, folder=tmp_path)
    for file in (tmp_path / "stages").glob("*.npz"):
        file.write_bytes(file.read_bytes()[:100])
    cells.same(plan_calibration(*cells.l1(), **FEW, folder=tmp_path), plan)


def test_ways_that_were_checked_are_not_checked_again(plan, tmp_path, monkeypatch):
    monkeypatch.setattr(known_ways, "OFTEN", 0.0)
    original, calls = known_ways.clear_ways, []

    def counting(fleet, a, b):
        if len(calls) == 2 and not (tmp_path / "again").exists():
            raise KeyboardInterrupt
        calls.append([(*start, *end) for start, end in zip(a.tolist(), b.tolist(), strict=True)])
        return original(fleet, a, b)

    monkeypatch.setattr(known_ways, "clear_ways", counting)
    monkeypatch.setattr(known_ways, "PART", 4)
    with pytest.raises(KeyboardInterrupt):
        plan_calibration(*cells.l1(), **FEW, folder=tmp_path)
    (tmp_path / "again").touch()
    cells.same(plan_calibration(*cells.l1(), **FEW, folder=tmp_path), plan)
    every = [way for call in calls for way in call]
    assert len(calls) > 2
    assert len(set(every)) == len(every)


def test_trials_in_processes_are_those_of_this_one(plan, monkeypatch):
    monkeypatch.setattr(parts, "WORTH", 0.0)
    cells.same(plan_calibration(*cells.l1(), **FEW), plan)
