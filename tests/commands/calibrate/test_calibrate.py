"""`gantrytau calibrate measurements.csv`: parameters near the truth, bad measurements told with their lines."""

import csv
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from gantrytau.kinematics import Kinematics
from gantrytau_models import FiveBar, GantryTau, prototypes
from gantrytau_optimica import Measurements
from gantrytau_optimica import calibrate as calibrate_in_python

FAULT, MISUSE, INTERRUPTED = 1, 2, 130
ROBOT = ("--robot", "GantryTau(L1)")
HEADER = ["q1", "q2", "q3", "x", "y", "z"]
NOISE = 10e-6  # m, per axis
FILES = ["calibrated.toml", "report.html", "report.json"]


def true_robot(size=0.004):
    """An L1 as it was built: lengths and offsets up to 4 mm off."""
    off = np.random.default_rng(3).uniform(-size, size, (3, 4))
    arms = [
        replace(arm, length=arm.length + d[0], offset=tuple(np.add(arm.offset, d[1:])))
        for arm, d in zip(prototypes.L1.arms, off, strict=True)
    ]
    return replace(prototypes.L1, arms=tuple(arms))


def true_model(size):
    return GantryTau(true_robot(size))


def carts(robot, r):
    """Carts behind the tool from the length of each link, (N, 3)."""
    q = np.empty_like(r)
    for i, arm in enumerate(robot.arms):
        d, v = r - arm.offset, np.array(arm.direction)
        along = d @ v
        q[:, i] = (along - np.sqrt(along**2 - v @ v * ((d**2).sum(axis=1) - arm.length**2))) / (v @ v)
    return q


@pytest.fixture(scope="module")
def poses():
    """Measured rows (80, 6): q, r."""
    rng = np.random.default_rng(0)
    r = np.array([0.5, 2.9, -0.7]) + rng.uniform(-0.4, 0.4, (80, 3))
    return np.hstack([carts(true_robot(), r), r + NOISE * rng.standard_normal(r.shape)])


@pytest.fixture
def measured(tmp_path):
    """Write rows as a CSV file."""

    def write(rows, header=HEADER, name="measured.csv"):
        file = tmp_path / name
        with file.open("w", newline="") as opened:
            csv.writer(opened).writerows([header, *([f"{x:.9f}" for x in row] for row in rows)])
        return file

    return write


def test_parameters_are_near_the_truth_and_used_again(run, answer, measured, poses, tmp_path):
    file = measured(poses)
    found = answer("calibrate", file, *ROBOT)
    folder = tmp_path / "measured-calibrated"
    assert found["files"] == [str(folder / name) for name in FILES]
    assert found["success"] is True
    assert (found["poses_fitted"], found["poses_held_out"]) == (40, 40)
    # of three noisy coordinates: 1.6 times, and what 40 poses leave
    assert found["error_m"]["mean"] < 3 * NOISE
    assert found["findings"] == []
    for i, arm in enumerate(true_robot().arms):
        length = found["parameters"][f"arms[{i}].length"]
        assert abs(length - arm.length) < 5 * found["deviations"][f"arms[{i}].length"]
    in_python = calibrate_in_python(GantryTau(prototypes.L1), Measurements.read(file))
    again = GantryTau(prototypes.L1, **tomllib.loads((folder / "calibrated.toml").read_text()))
    for i, arm in enumerate(again.modifications["arms"]):
        assert arm["length"] == in_python.parameters[f"arms[{i}].length"]
        assert arm["offset"] == in_python.parameters[f"arms[{i}].offset"].tolist()
    spoken = run("calibrate", file, *ROBOT)
    assert spoken.exit_code == 0
    assert "um in the mean of 40 poses not fitted" in spoken.stdout
    assert "Nothing doubtful" in spoken.stdout
    line = next(line for line in spoken.stdout.splitlines() if "arms[0].length" in line)
    value, deviation, change = map(float, line.split()[1:])
    # as many digits are shown
    assert value == pytest.approx(in_python.parameters["arms[0].length"], abs=1e-7)
    assert deviation * 1e-6 == pytest.approx(in_python.deviations["arms[0].length"], rel=1e-2)
    assert change == pytest.approx(value - prototypes.L1.arms[0].length, abs=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["measured-calibrated", "measured.csv"]


def test_a_calibrated_robot_is_simulated(answer, measured, poses, tmp_path):
    answer("calibrate", measured(poses), *ROBOT, "--output", tmp_path / "a" / "b")
    values = tmp_path / "a" / "b" / "calibrated.toml"
    length = tomllib.loads(values.read_text())["arms"][1]["length"]
    settings = ("--set", values, "--set", "plate_mass=4")
    found = answer("simulate", "GantryTau(L1)", *settings, "--stop", "0.01")["final"]
    assert found["arms[1].length"] == length
    assert found["plate_mass"] == 4.0


def test_values_say_of_which_prototype_they_are(run, measured, poses, tmp_path):
    run("calibrate", measured(poses), *ROBOT)
    values = tmp_path / "measured-calibrated" / "calibrated.toml"
    assert values.read_text().splitlines()[0] == "# Parameters of GantryTau(L1)"
    found = run("check", "GantryTau(D1)", "--set", values)
    assert "calibrated.toml: these are values of L1, found with D1; expected (L1)" in found.stderr
    assert "these are values" not in run("check", "GantryTau(L1)", "--set", values).stderr


def spoilt(poses, how):
    """Rows with one of the usual mistakes."""
    rows = poses.copy()
    how(rows)
    return rows


def swap(rows):
    rows[:, [0, 1]] = rows[:, [1, 0]]


def turn(rows):
    rows[:, 3:5] *= -1


def flatten(rows):
    rows[:, 5] = -0.7


def outlying(rows):
    rows[[10, 20], 3] += 0.003


def millimetres(rows):
    rows[5, 3:] *= 1000


def all_in_millimetres(rows):
    rows *= 1000


@pytest.mark.parametrize(
    ("how", "finding", "lines", "words"),
    [
        (swap, "swapped columns", [*range(2, 82)], "q2 stands in column q1 in lines 2 to 81"),
        (turn, "rotated frame", [*range(2, 82)], "turned by 180 degrees about z in lines 2 to 81"),
        (flatten, "plane", [*range(2, 82)], "lie in a plane"),
        (outlying, "outliers", [12, 22], "lines 12 and 22 close worse"),
        (millimetres, "millimetres", [7], "r of line 7 extends over"),
        (all_in_millimetres, "millimetres", [*range(2, 82)], "divide by 1000"),
    ],
)
def test_bad_measurements_are_told_and_leave_earlier_results(
    run, fails, measured, poses, tmp_path, how, finding, lines, words
):
    folder = tmp_path / "measured-calibrated"
    folder.mkdir()
    (folder / "calibrated.toml").write_text("of an earlier run")
    file = measured(spoilt(poses, how))
    message = fails(FAULT, "calibrate", file, *ROBOT)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert message.endswith("Nothing was written")
    assert " row" not in message.replace("one row for each", "").replace("correct these rows", "")
    printed = json.loads(run("calibrate", file, *ROBOT, "--json").stdout)
    assert (printed["finding"], printed["lines"]) == (finding, lines)
    assert [path.name for path in folder.iterdir()] == ["calibrated.toml"]
    assert (folder / "calibrated.toml").read_text() == "of an earlier run"
    assert len(list(tmp_path.iterdir())) == 2  # the measurements and that folder


def test_rows_left_out_and_outliers_without_weight_are_told_by_their_lines(answer, run, measured, poses):
    rows = spoilt(poses, outlying)
    rows[30], rows[40, 2] = rows[3], np.nan
    file = measured(rows)
    text = file.read_text().splitlines()
    # an empty line holds no pose, but counts as a line
    file.write_text("\n".join([*text[:2], "", *text[2:]]))
    found = answer("calibrate", file, *ROBOT, "--robust")
    told = {f["kind"]: (f["lines"], f["message"]) for f in found["findings"]}
    assert told["nan"][0] == [43]
    assert told["nan"][1].startswith("line 43 hold")
    assert told["duplicates"][0] == [33]
    assert told["outliers"][0] == [13, 23]
    assert "lines 13 and 23 close worse" in told["outliers"][1]
    assert found["error_m"]["median"] < 3 * NOISE
    assert "outliers: lines 13 and 23" in run("calibrate", file, *ROBOT, "--robust").stdout
    page = file.with_name("measured-calibrated") / "report.html"
    assert "lines 13 and 23" in page.read_text()  # the page speaks of the same lines


def test_another_robot_and_too_few_poses(fails, measured, poses):
    assert "these are measurements" in fails(FAULT, "calibrate", measured(poses), "--robot", "GantryTau(D1)")
    few = fails(FAULT, "calibrate", measured(poses[:12]), *ROBOT, "--holdout", "second")
    assert "found 6 poses to fit 7 parameters of each link, expected 8" in few


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--prior", "length"), "--prior length: expected NAME=DEVIATION"),
        (("--prior", "length=0"), "the deviation above 0"),
        (("--constraint", "length"), "--constraint length: expected NAME=VALUE, NAME=[LEAST,MOST] or"),
        (("--constraint", "a=1", "--constraint", "a=2"), "found a twice"),
        (("--prior", "length=[1,2,3]"), "or NAME=[VALUE,DEVIATION]"),
        (("--output", __file__), "found a file, expected a folder"),
    ],
)
def test_options_that_cannot_be_used(fails, measured, poses, options, words):
    assert words in fails(MISUSE, "calibrate", measured(poses), *ROBOT, *options)


def test_what_is_no_table_of_poses(fails, measured, poses, tmp_path):
    assert "found no FILE, expected measurements" in fails(MISUSE, "calibrate", *ROBOT)
    for robot in (ROBOT, ()):  # without a robot too: a plan is not asked for beside a file that is not there
        assert "nowhere.csv: there is no such" in fails(MISUSE, "calibrate", tmp_path / "nowhere.csv", *robot)


def test_without_a_robot_its_name_is_asked_for(fails, measured, poses):
    file = measured(poses)
    message = fails(MISUSE, "calibrate", file)
    assert f"gantrytau calibrate {file} --robot 'GantryTau(L1)'" in message


@pytest.fixture
def rails(measured):
    """Files of the straight guideways, for `--rails`."""
    s = np.linspace(-1.5, 1.5, 7)
    files = []
    for k, arm in enumerate(true_robot().arms):
        points = np.column_stack([s, np.add(arm.offset, s[:, None] * np.array(arm.direction))])
        files.append(str(measured(points, ["q", "x", "y", "z"], f"rail{k}.csv")))
    return ",".join(files)


def test_ipopt_linear_start_and_rails_agree(answer, measured, poses, rails):
    file = measured(poses)
    lengths = [
        np.array([answer("calibrate", file, *ROBOT, *o)["parameters"][f"arms[{i}].length"] for i in range(3)])
        for o in ((), ("--method", "ipopt"), ("--start", "linear"), ("--model", "2", "--rails", rails))
    ]
    assert np.abs(lengths[1] - lengths[0]).max() < 1e-9
    assert np.abs(lengths[2] - lengths[0]).max() < 1e-9
    assert np.abs(lengths[3] - lengths[0]).max() < 1e-3  # two numbers fewer for each arm: not the same fit


def test_a_model_that_no_robot_holds_leaves_no_earlier_values(run, answer, measured, poses, rails, tmp_path):
    file, folder = measured(poses), tmp_path / "measured-calibrated"
    answer("calibrate", file, *ROBOT)
    found = run("calibrate", file, *ROBOT, "--model", "2", "--rails", rails)
    assert found.exit_code == 0
    assert "No calibrated.toml: GantryTau has no parameters" in found.stdout
    assert sorted(path.name for path in folder.iterdir()) == FILES[1:]


def test_ctrl_c_writes_nothing(run, measured, poses, tmp_path, monkeypatch):
    def pressed(*arguments, **policy):
        raise KeyboardInterrupt

    monkeypatch.setattr("gantrytau.commands.calibrate.measurement_file.calibrate", pressed)
    file = measured(poses)
    found = run("calibrate", file, *ROBOT)
    assert found.exit_code == INTERRUPTED
    assert found.stderr.strip() == "Interrupted; nothing was written"
    assert [path.name for path in tmp_path.iterdir()] == ["measured.csv"]


def test_a_report_that_fails_leaves_earlier_results(run, answer, measured, poses, tmp_path, monkeypatch):
    file, folder = measured(poses), tmp_path / "measured-calibrated"
    answer("calibrate", file, *ROBOT)
    before = {path.name: path.read_text() for path in folder.iterdir()}

    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gantrytau_optimica.calibration.report.report.html_report", full)
    found = run("calibrate", file, *ROBOT, "--holdout", "none")
    assert found.exit_code == MISUSE
    assert "No space left on device; name another place" in found.stderr
    assert {path.name: path.read_text() for path in folder.iterdir()} == before
    assert len(list(tmp_path.iterdir())) == 2


def test_a_fit_that_does_not_settle_is_no_result(fails, measured, poses, tmp_path, monkeypatch):
    from gantrytau_optimica import Calibration

    monkeypatch.setattr(Calibration, "success", property(lambda found: False))
    file = measured(poses)
    assert "did not settle" in fails(FAULT, "calibrate", file, *ROBOT)
    assert [path.name for path in tmp_path.iterdir()] == ["measured.csv"]


def test_constraints_are_kept(answer, fails, measured, poses):
    file = measured(poses)
    length = "arms[0].length=[2.05,2.06]"
    kept = (
        "--constraint",
        f"{length},arms[1].length=arms[2].length",
        "--constraint",
        "|arms[0].direction|=1",
    )
    found = answer("calibrate", file, *ROBOT, "--method", "ipopt", *kept)
    values = found["parameters"]
    assert 2.05 - 1e-9 <= values["arms[0].length"] <= 2.06 + 1e-9
    assert values["arms[1].length"] == pytest.approx(values["arms[2].length"], abs=1e-9)
    assert np.linalg.norm(values["arms[0].direction"]) == pytest.approx(1.0, abs=1e-9)
    assert "--constraint" in fails(MISUSE, "calibrate", file, *ROBOT, *kept)


def test_any_robot_by_the_names_of_its_parameters(run, answer, tmp_path):
    """Five bars whose cranks are 3 mm too long: found, and written for --set."""
    built = Kinematics(FiveBar(crank_length=0.303))
    random = np.random.default_rng(0)
    q = built.home.q + random.uniform(-0.5, 0.5, (30, 2))
    r = built.fk(q)[0] + NOISE * random.standard_normal((30, 3))
    file = tmp_path / "bars.csv"
    Measurements(q, r).write(file)
    by_name = ("--robot", "FiveBar", "--holdout", "none", "--parameters")
    found = answer("calibrate", file, *by_name, "crank_length")
    assert found["parameters"]["crank_length"] == pytest.approx(
        0.303, abs=4 * found["deviations"]["crank_length"]
    )
    written = tomllib.loads((tmp_path / "bars-calibrated" / "calibrated.toml").read_text())
    assert written == {"crank_length": found["parameters"]["crank_length"]}
    wrong = run("calibrate", file, *by_name, "crank_lenght")
    assert wrong.exit_code == MISUSE
    assert "--parameters" in wrong.stderr
