"""`gantrytau calibrate cell.toml`: plan, measure, calibrate; interrupted, wrong and incomplete."""

import json
from importlib import import_module

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau.commands.app import app
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from tests.commands.calibrate.cells import measure, read_poses, true_robot, with_lines
from tests.families import first_of

# of which the function has the name
procedure = import_module("gantrytau_optimica.procedure.plan_calibration")

FAULT, MISUSE, INTERRUPTED = 1, 2, 130
FILES = [
    "plan.html",
    "workspace.png",
    "poses.csv",
    "measurements-template.csv",
    "Calibration.mod",
    "plan.json",
    "plan.toml",
]


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The folder of a plan, what the command printed, and the plan as a record."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "cell.toml").write_text(with_lines())
    spoken = CliRunner().invoke(app, ["calibrate", str(folder / "cell.toml")])
    assert spoken.exit_code == 0, spoken.output
    printed = CliRunner().invoke(app, ["calibrate", str(folder / "cell.toml"), "--json"])
    return folder / "cell-plan", spoken, json.loads(printed.stdout)


@pytest.fixture
def folder(planned, tmp_path):
    """A copy of the folder of the plan, to be written to."""
    import shutil

    return shutil.copytree(planned[0], tmp_path / "cell-plan")


def test_the_example_is_planned(planned):
    folder, spoken, record = planned
    assert record["good"] is True
    assert record["poses"] == 20
    assert record["error_m"] < record["wanted_m"] == pytest.approx(200e-6)
    assert record["files"] == [str(folder / name) for name in FILES]
    assert all((folder / name).stat().st_size > 0 for name in FILES)
    assert "verdict    good" in spoken.stdout
    assert "with the header q1,q2,q3,x,y,z), then: gantrytau calibrate" in spoken.stdout
    assert spoken.stderr.splitlines()[0] == "workspace of the robot ..."  # progress
    assert "MoveAbsJ" in (folder / "Calibration.mod").read_text()
    assert len(read_poses(folder)[0]) == 20


def test_from_a_tape_measure_to_the_true_robot(planned, folder, answer, run):
    file = measure(folder)
    found = answer("calibrate", file)
    assert found["good"] is True
    assert found["robot"] == "GantryTau(L1)"
    assert found["poses_fitted"] == 20
    assert found["validation_error_m"] < 100e-6  # of 16 um of noise at 5 m; 16 of 20 poses fitted
    assert found["notes"] == [
        "frame: positions are in another frame than the plan; they were laid over the poses that it expects"
    ]
    assert found["findings"] == []
    for i in range(3):
        true = true_robot().modifications["arms"][i]["length"]
        name = f"arms[{i}].length"
        assert abs(found["parameters"][name] - true) < 5 * found["deviations"][name] < 5e-4
        assert abs(prototypes.L1.arms[i].length - true) > 10 * abs(found["parameters"][name] - true)
    spoken = run("calibrate", file)
    assert spoken.exit_code == 0
    assert spoken.stdout.startswith("Good: ")
    assert "200 um were wanted" in spoken.stdout


def test_the_calibrated_robot_is_right_wherever_it_goes(folder, answer):
    answer("calibrate", measure(folder))
    text = (folder / "measurements-calibrated" / "calibrated.toml").read_text()
    import tomllib

    robot = Kinematics(GantryTau(prototypes.L1, **tomllib.loads(text)))
    true = Kinematics(true_robot())
    r = np.array([0.5, 2.9, -0.7]) + np.random.default_rng(1).uniform(-0.4, 0.4, (50, 3))
    q = true.ik(r)
    apart = [np.linalg.norm(x[:, None] - x, axis=2) for x in (robot.fk(q)[0], r)]  # whatever the frame
    assert np.abs(apart[0] - apart[1]).max() < 100e-6
    nominal = Kinematics(GantryTau(prototypes.L1)).fk(q)[0]
    assert np.abs(np.linalg.norm(nominal[:, None] - nominal, axis=2) - apart[1]).max() > 1e-3


def test_missing_poses_are_told_and_planned_again(folder, run, answer):
    numbers, q = read_poses(folder)
    left = [2, 3, 11]
    file = measure(folder, [k for k in range(20) if k not in left])
    found = answer("calibrate", file)
    assert found["missing"] == [numbers[k] for k in left]
    assert found["poses_fitted"] == 17
    assert found["program"] == str(folder / "rest" / "CalibrationRest.mod")
    again, rest = read_poses(folder / "rest")
    assert len(again) == 3
    assert np.abs(np.sort(rest, axis=0) - np.sort(q[left], axis=0)).max() < 1e-9
    spoken = run("calibrate", file)
    assert (
        f"3 planned poses are not measured, numbers {numbers[2]}, {numbers[3]}, {numbers[11]} of"
        in spoken.stderr
    )


def test_measured_poses_are_not_planned_anew(folder, fails, answer, tmp_path):
    measure(folder)
    file, before = tmp_path / "cell.toml", (folder / "poses.csv").read_text()
    file.write_text(with_lines(error='error = "0.3 mm"'))
    answer("calibrate", file, "--output", folder)  # the same poses
    file.write_text(with_lines(poses="poses = 12"))
    message = fails(MISUSE, "calibrate", file, "--output", folder)
    assert "measurements.csv: found measurements of an earlier plan" in message
    assert (folder / "poses.csv").read_text() == before


def test_without_validation_the_verdict_says_so(folder, run):
    for rows, options in (
        (slice(None), ("--holdout", "none")),
        (slice(0, 18, 2), ()),
    ):  # nine: seven are too few
        result = run("calibrate", measure(folder, rows), *options, "--json")
        found = json.loads(result.stdout)
        assert result.exit_code == FAULT
        assert found["good"] is False
        assert found["validation_error_m"] is None
        assert "no poses that were not fitted validate this" in found["verdict"]
    assert found["poses_fitted"] == 9


def test_too_few_poses_still_say_which_are_missing(folder, run):
    found = run("calibrate", measure(folder, slice(0, 5)))
    assert found.exit_code == FAULT
    assert "15 planned poses are not measured" in found.stderr
    assert "found 5 usable poses, expected 8" in found.stderr
    assert (folder / "rest" / "CalibrationRest.mod").is_file()
    assert not (folder / "measurements-calibrated").exists()


def swapped(table):
    return table[:, [1, 0, 2, 3, 4, 5]]


def in_millimetres(table):
    return table * [1e3, 1e3, 1e3, 1, 1, 1]


def other_poses(table):
    return table + np.array([0.01, 0.02, -0.01, 0, 0, 0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (swapped, "q1 stands in column q2, q2 stands in column q1"),
        (in_millimetres, "undo this: q in mm"),
        (other_poses, "q1, q2, ... must be those of poses.csv"),
    ],
)
def test_actuators_that_are_not_those_of_the_plan(folder, fails, change, words):
    message = fails(FAULT, "calibrate", measure(folder, change=change))
    assert words in message
    assert "--robot 'GantryTau(L1)'" in message
    assert not (folder / "rest").exists()


def test_swapped_axes_are_not_taken_for_another_frame(folder, fails):
    mirrored = measure(folder, change=lambda table: table[:, [0, 1, 2, 4, 3, 5]])
    message = fails(FAULT, "calibrate", mirrored)
    assert "two of the columns x, y, z are swapped, or one has the wrong sign" in message
    assert message.endswith("Nothing was written")
    assert not (folder / "measurements-calibrated").exists()


def test_a_template_that_is_not_filled_in(folder, fails):
    message = fails(MISUSE, "calibrate", folder / "measurements-template.csv")
    assert "found no line with numbers in all columns, expected the poses that were measured; fill" in message


def test_less_than_wanted_is_told(folder, run):
    file = measure(folder)
    text = (folder / "plan.toml").read_text()
    (folder / "plan.toml").write_text(text.replace('error = "0.2 mm"', 'error = "5 um"'))
    spoken, printed = run("calibrate", file), run("calibrate", file, "--json")
    assert (spoken.exit_code, printed.exit_code) == (FAULT, FAULT)
    assert spoken.stdout.startswith("NOT GOOD ENOUGH: ")
    assert "5 um were wanted" in json.loads(printed.stdout)["error"]


def test_a_plan_that_is_not_good_says_so(run, folder, tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines(error='error = "1 um"'))
    # on top of the stages that do not ask for it
    found = run("calibrate", file, "--output", folder, "--json")
    assert found.exit_code == FAULT
    record = json.loads(found.stdout)
    assert record["good"] is False
    assert "wanted" in record["error"]
    assert len(record["files"]) == len(FILES)


def test_interrupted_it_goes_on_where_it_was(planned, run, tmp_path, monkeypatch):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines())
    whole, simulated = procedure.simulated, iter(range(10))

    def pressed(*arguments, **policy):
        if next(simulated) == 1:
            raise KeyboardInterrupt
        return whole(*arguments, **policy)

    monkeypatch.setattr(procedure, "simulated", pressed)
    found = run("calibrate", file)
    assert found.exit_code == INTERRUPTED
    assert "Interrupted in the stage 'simulated calibrations, 1 of 2 done'" in found.stderr
    assert "the same command goes on from there" in found.stderr
    assert not (tmp_path / "cell-plan" / "plan.json").exists()

    def again(*arguments, **policy):
        raise AssertionError("this stage was finished")

    monkeypatch.setattr(procedure, "simulated", whole)
    monkeypatch.setattr(procedure, "settled_workspace", again)
    assert run("calibrate", file).exit_code == 0
    one, other = (json.loads((f / "plan.json").read_text()) for f in (planned[0], tmp_path / "cell-plan"))
    assert one == other


def test_options_that_the_file_of_a_cell_replaces(fails, folder, tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(with_lines())
    assert "found --robot" in fails(MISUSE, "calibrate", file, "--robot", "GantryTau(L1)", "--model", "1")
    assert "leave --set and" in fails(MISUSE, "calibrate", measure(folder), "--set", "arms[0].length=2.0")


def test_a_robot_of_a_file_is_found_from_the_folder_of_the_plan(folder, answer, tmp_path):
    (tmp_path / "robots.py").write_text(
        "from gantrytau_models import GantryTau, prototypes\nrobot = GantryTau(prototypes.L1)\n"
    )
    (tmp_path / "cell.toml").write_text(with_lines(model='model = "robots.py:robot"'))
    record = answer("calibrate", tmp_path / "cell.toml", "--output", folder)
    assert record["good"] is True
    found = answer("calibrate", measure(folder))
    assert found["robot"] == f"{tmp_path / 'robots.py'}:robot"


@pytest.mark.parametrize(("kind", "links"), first_of([("f1", "turntables"), ("six", "six links")]))
def test_examples_of_plates_that_turn_work_at_once(run, tmp_path, kind, links):
    text = run("calibrate", "--example", kind).stdout
    text = text.replace("robots = 20", "robots = 2\nspacing = 0.25").replace("poses = 40", "poses = 24")
    file = tmp_path / "cell.toml"
    file.write_text(text)
    record = run("calibrate", file)
    assert record.exit_code == 0, record.output
    assert f"({links}) with a TMac" in record.stdout
    assert "none of 2 robots drawn" in record.stdout  # fewer than is usual
    command = record.stdout.splitlines()[-1].rpartition("then: ")[2]
    assert command.startswith(f"gantrytau calibrate {tmp_path / 'cell-plan' / 'measurements.csv'}")
    assert command in (tmp_path / "cell-plan" / "plan.html").read_text()
    header = (tmp_path / "cell-plan" / "measurements-template.csv").read_text().splitlines()[0]
    assert header.endswith("x,y,z,qw,qx,qy,qz")


def test_plans_of_another_version_are_told(folder, fails):
    file, plan = measure(folder), folder / "plan.json"
    numbers = json.loads(plan.read_text())
    plan.write_text(json.dumps(numbers | {"format": 1}))
    assert "of format 1, of another version of gantrytau, expected format" in fails(MISUSE, "calibrate", file)
    del numbers["lost"]
    plan.write_text(json.dumps(numbers))
    message = fails(MISUSE, "calibrate", file)
    assert "without 'lost', expected a whole plan; plan again" in message
    assert "KeyError" not in message
