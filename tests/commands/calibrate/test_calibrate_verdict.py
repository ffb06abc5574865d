"""What `gantrytau calibrate measurements.csv` makes of a plan's measurements: when it says good, and of what."""

import csv
import html
import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau.commands.app import app
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.calibration import told_by_tool
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.diagnostics.tool_error import tool_error
from tests.commands.calibrate import cells

FAULT, MISUSE = 1, 2


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The folder of a plan of 20 poses."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "cell.toml").write_text(cells.with_lines())
    spoken = CliRunner().invoke(app, ["calibrate", str(folder / "cell.toml")])
    assert spoken.exit_code == 0, spoken.output
    return folder / "cell-plan"


@pytest.fixture
def folder(planned, tmp_path):
    """A copy of it, to be written to."""
    import shutil

    return shutil.copytree(planned, tmp_path / "cell-plan")


def true_error(found, folder):
    """Mean distance of the calibrated robot from the true one over planned poses, m, laid over each other best."""
    text = (folder / "measurements-calibrated" / "calibrated.toml").read_text()
    _, q = cells.read_poses(folder)
    a = Kinematics(GantryTau(prototypes.L1, **tomllib.loads(text))).fk(q)[0]
    b = Kinematics(cells.true_robot()).fk(q)[0]
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    U, _, V = np.linalg.svd(b.T @ a)
    turn = U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V
    return float(np.linalg.norm(a @ turn.T - b, axis=1).mean())


def test_few_poses_are_not_good_however_well_they_fit(folder, run):
    """Eight of twenty: they fit to some um, and the tool is off by millimetres elsewhere."""
    file = cells.measure(folder, slice(0, 8))
    spoken = run("calibrate", file)
    assert spoken.exit_code == FAULT
    assert spoken.stdout.startswith("NOT GOOD ENOUGH: no poses that were not fitted validate this")
    found = json.loads(run("calibrate", file, "--json").stdout)
    assert found["error_m"]["mean"] < 100e-6
    assert true_error(found, folder) > found["wanted_m"]
    assert found["expected_error_m"] > found["wanted_m"]
    # a deviation of normal errors, of which one robot has one draw
    assert 0.1 < true_error(found, folder) / found["expected_error_m"] < 3


def test_a_good_verdict_is_true(folder, answer):
    found = answer("calibrate", cells.measure(folder))
    assert found["good"] is True
    assert true_error(found, folder) < found["wanted_m"] / 2
    assert true_error(found, folder) < 3 * found["expected_error_m"]


def test_outliers_that_have_no_weight_do_not_count(folder, run):
    def change(table):
        table[[3, 12], 3:5] += [[0.02, 0.0], [0.0, -0.01]]
        return table

    file = cells.measure(folder, change=change)
    spoken = run("calibrate", file, "--robust")
    assert spoken.exit_code == 0, spoken.output
    assert "in the mean of poses that were not fitted, two outliers left out, " in spoken.stdout
    found = json.loads(run("calibrate", file, "--robust", "--json").stdout)
    assert found["left_out_lines"] == [5, 14]
    assert found["validation_error_m"] < 100e-6
    assert found["error_m"]["max"] < 200e-6
    assert true_error(found, folder) < 50e-6


def test_more_noise_than_the_device_has_is_told(folder, run):
    def change(table):
        table[:, 3:] += 3e-4 * np.random.default_rng(3).standard_normal((len(table), 3))
        return table

    spoken = run("calibrate", cells.measure(folder, change=change))
    assert spoken.exit_code == FAULT
    told = r"noise: what is left needs noise of \d+ um in each coordinate, 1\d(\.\d)? um are foretold of the device"
    assert re.search(told, spoken.stdout)


def test_the_report_says_all_of_it(folder, answer):
    found = answer("calibrate", cells.measure(folder))
    page = html.unescape((folder / "measurements-calibrated" / "report.html").read_text())
    numbers = json.loads((folder / "measurements-calibrated" / "report.json").read_text())
    assert "20 poses fitted, which are all" in page
    assert "held out" not in page
    for words in (
        "Good",
        "GantryTau(L1)",
        "200 um, error of the tool",
        "LaserTracker at (4.5, 2.9, -0.7) m",
        "laid over",
        "the target that was measured",
        "by fits without the pose",
        found["verdict"],
    ):
        assert words in page, words
    assert numbers["validation_error_m"]["mean"] == found["validation_error_m"]
    assert [one["line"] for one in numbers["poses"]] == list(range(2, 22))
    motion = found["transformation"]
    R, t = np.array(motion["rotation"]), np.array(motion["translation_m"])
    c, s = np.cos(2.5), np.sin(2.5)
    # where the tracker stands, less the target at x = 50 mm, which takes the place of the tool; some mm of tape
    assert t == pytest.approx([4.45, 2.9, -0.7], abs=0.03)
    np.testing.assert_allclose(R, [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=0.01)


def test_the_frame_is_printed(folder, run):
    spoken = run("calibrate", cells.measure(folder)).stdout
    assert "base = R measured + t:" in spoken
    assert "R = [-0.80" in spoken


STRETCHED = (4e-3, -3e-3, 2e-3)  # m, of the links
BASE_NOISE = 20e-6  # m


def stretched():
    """An L1 with longer and shorter links, all else as it is nominally."""
    arms = [replace(arm, length=arm.length + d) for arm, d in zip(prototypes.L1.arms, STRETCHED, strict=True)]
    return Kinematics(GantryTau(replace(prototypes.L1, arms=tuple(arms))))


def measured_in_base(folder, off=(0.0, 0.0, 0.0), turn=None):
    """What is read in the base of the robot, of a point `off` the tool; or in axes turned from it. File, q and tool."""
    _, q = cells.read_poses(folder)
    r = stretched().fk(q)[0]
    read = r + off + BASE_NOISE * np.random.default_rng(0).standard_normal(r.shape)
    file = folder / "measurements.csv"
    with file.open("w", newline="") as opened:
        rows = np.hstack([q, read if turn is None else read @ turn.T]).tolist()
        csv.writer(opened).writerows([["q1", "q2", "q3", "x", "y", "z"], *rows])
    return file, q, r


def off_in_base(folder, q, r):
    """How far the calibrated robot is from where it was measured, in the mean of poses, without laying it over them."""
    text = (folder / "measurements-calibrated" / "calibrated.toml").read_text()
    return float(
        np.linalg.norm(
            Kinematics(GantryTau(prototypes.L1, **tomllib.loads(text))).fk(q)[0] - r, axis=1
        ).mean()
    )


@pytest.mark.parametrize(
    ("off", "words", "said"),
    [(0.05, "the target, 50 mm from", ()), (0.0, "the tool itself, not", ("--frame", "base"))],
)
def test_what_was_measured_in_the_base_is_right_there(folder, answer, off, words, said):
    file, q, r = measured_in_base(folder, (off, 0.0, 0.0))
    found = answer("calibrate", file, *said)
    nominal = np.linalg.norm(Kinematics(GantryTau(prototypes.L1)).fk(q)[0] - r, axis=1).mean()
    # 21 numbers from 20 poses know the mean of them to about the noise
    assert off_in_base(folder, q, r) < 3 * BASE_NOISE < nominal / 100
    assert found["notes"] == [found["notes"][0]]
    assert found["notes"][0].startswith(f"target: positions in the base of the robot are those of {words}")
    assert found["transformation"] is None
    ends = "its coordinates are as good as this." if said else "--frame base says that it is."
    assert found["verdict"].endswith(ends)
    assert ("good up to a frame" in found["verdict"]) != bool(said)


def test_a_fitted_frame_says_what_it_means_for_the_base(folder, answer, run):
    c, s = np.cos(0.02), np.sin(0.02)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    file, q, r = measured_in_base(folder, turn=turn)
    found = answer("calibrate", file)
    assert "This is good up to a frame: R and t follow from nominal values" in found["verdict"]
    (told,) = re.findall(r"may be off by ([\d.]+) mm, as before, where these are 5 mm off", found["verdict"])
    off = off_in_base(folder, q, r)
    assert 1e-3 < off < 3e-3 * float(told)  # links are off by less than tape, one draw of three
    text = (folder / "measurements-calibrated" / "calibrated.toml").read_text()
    table = "\n".join(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# [frame]"))
    lines = [line.removeprefix("# ") for line in text.splitlines() if line.startswith(("# R =", "# t ="))]
    frame = tomllib.loads("\n".join([table, *lines]))["frame"]
    assert np.array(frame["R"]) == pytest.approx(np.array(found["transformation"]["rotation"]))
    assert np.array(frame["R"]) == pytest.approx(turn.T, abs=0.02)
    calibrated = Kinematics(GantryTau(prototypes.L1, **tomllib.loads(text))).fk(q)[0]
    measured = Measurements.read(file).r
    assert calibrated == pytest.approx(measured @ np.array(frame["R"]).T + frame["t"], abs=5 * BASE_NOISE)
    values = folder / "measurements-calibrated" / "calibrated.toml"
    assert run("check", "GantryTau(L1)", "--set", values).exit_code == 0
    refused = run("calibrate", file, "--frame", "base")
    assert refused.exit_code == FAULT
    assert "m off the poses of the plan beside it in the median, expected 0.025 m at most" in refused.stderr
    assert "take --frame fitted for another frame" in refused.stderr


def test_a_cell_says_in_which_frame_its_device_measures(folder, answer, fails):
    cell = folder / "plan.toml"
    cell.write_text(cell.read_text().replace('frame = "fitted"', 'frame = "base"'))
    file, *_ = measured_in_base(folder)
    assert "Poses were measured in the base of the robot" in answer("calibrate", file)["verdict"]
    assert "good up to a frame" in answer("calibrate", file, "--frame", "fitted")["verdict"]
    cell.write_text(cell.read_text().replace('frame = "base"', 'frame = "bass"'))
    assert "device.frame: found \"bass\"; did you mean 'base'?" in fails(2, "calibrate", cell)


def test_the_template_is_filled_in(folder, answer, fails):
    """With numbers, decimal commas of a spreadsheet, and cells that are left empty for what was not seen."""
    plain = cells.measure(folder)
    with plain.open() as opened:
        measured = list(csv.reader(opened))[1:]
    with (folder / "measurements-template.csv").open() as opened:
        rows = list(csv.reader(opened))
    for row, values in zip(rows[1:], measured, strict=True):
        row[4:] = values[3:]
    rows[5][4:] = ["", "", ""]
    text = "\n".join(";".join(cell.replace(".", ",") for cell in row) for row in rows)
    plain.write_text(text)
    found = answer("calibrate", plain)
    assert found["good"] is True
    assert found["missing"] == [int(rows[5][0])]
    assert found["findings"] == []
    rows[3][0], rows[7][0] = rows[7][0], rows[3][0]
    plain.write_text("\n".join(",".join(row) for row in rows))
    assert f"line 4 has number {rows[3][0]} and q = (" in fails(FAULT, "calibrate", plain)


def test_what_is_expected_is_not_taken_for_what_was_measured(folder, fails):
    message = fails(FAULT, "calibrate", folder / "poses.csv")
    assert "found x, y, z as the plan expects them, expected what was measured" in message
    assert not (folder / "rest").exists()


def test_the_rest_stays_when_measurements_fail(folder, run):
    program = folder / "rest" / "CalibrationRest.mod"
    run("calibrate", cells.measure(folder, slice(0, 15)))
    before = program.read_text()
    assert "p0" in before
    for rows, code in ((slice(0, 0), MISUSE), (slice(0, 5), FAULT)):
        assert run("calibrate", cells.measure(folder, rows)).exit_code == code
        assert program.read_text() == before


def test_only_what_moves_the_tool_is_told():
    """Six links: the joints of the plate and the carts move together without moving the tool."""
    robot = SixLinkGantryTau(prototypes.L1)
    kinematics = Kinematics(robot)
    q = kinematics.home.q + np.random.default_rng(0).uniform(-0.3, 0.3, (60, 3))
    r, R = kinematics.fk(q)
    good = np.isfinite(r).all(axis=1)
    q, r, R = q[good], r[good], R[good]
    every = PoseArrays(q, r, R)
    expected = tool_error(robot, every, every, noise=1e-5, tape=0.002)
    assert len(expected.loose) > 3
    assert expected.loose[0].moves < 50e-6
    noise = 1e-5 * np.random.default_rng(1).standard_normal(r.shape)
    found = calibrate(robot, Measurements(q, r + noise, R))
    assert len(found.undetermined) > 10
    told = told_by_tool(found, expected, least=100e-6, tape=0.002)
    message = next(f.message for f in told.findings if f.kind == "undetermined")
    assert "do not move the tool: this is harmless" in message
    assert "arms" not in message
    few = tool_error(robot, PoseArrays(q[:6], r[:6], R[:6]), every, noise=1e-5, tape=0.002)
    moving = told_by_tool(found, few, least=20e-6, tape=0.002)
    message = next(f.message for f in moving.findings if f.kind == "undetermined")
    assert "data do not hold all that moves the tool; where nominal values are 2 mm off, together" in message
    # a direction that is not held moves the tool as far as moving the numbers along it does
    assert few.loose[0].moves == max(one.moves for one in few.loose)
