"""The whole procedure: what it predicts against what simulated calibrations reach, resumption, remaining poses, files."""

import csv
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import F1GantryTau, prototypes
from gantrytau_optimica import LaserTracker, Measurements, calibrate, load_plan, plan_calibration
from gantrytau_optimica.calibration import stereo_cameras
from gantrytau_optimica.procedure.motion_planning.clear_ways import clear_ways
from tests.optimica.procedure import cells
from tests.optimica.procedure.cells import varied

FEW: dict[str, Any] = dict(poses=14, robots=6, tape=0.003, spacing=0.2)


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(*cells.l1(), **FEW)


def test_the_verdict_is_the_error_of_the_tool(plan):
    assert plan.verdict.good
    assert plan.verdict.error == plan.trials.after.max() < 50e-6
    assert plan.trials.before.min() > 1e-3  # a tape error of 3 mm
    assert "good" in str(plan)
    assert plan.measured.sum() == 14
    assert not plan.measured[[0, -1]].any()
    np.testing.assert_array_equal(plan.q[0], plan.q[-1])


def test_a_grid_of_so_many_places():
    found = plan_calibration(*cells.l1(), poses=9, robots=1, tape=0.003, places=400)
    assert len(found.workspace.r) == pytest.approx(400, rel=0.1)


@pytest.mark.parametrize("cell", [cells.l1, cells.symmetric], ids=["l1", "symmetric"])
def test_simulated_errors_are_those_predicted(cell):
    found = plan_calibration(*cell(), **varied(FEW, robots=14))
    # standard deviations are predicted, mean distances found, which are 0.92 of them for three alike; 14 robots
    assert found.trials.in_frame.mean() == pytest.approx(0.9 * found.prediction.error, rel=0.2)
    assert (found.trials.after <= found.trials.in_frame).all()  # laid over each other best


def test_an_independent_robot_is_found_by_the_planned_poses(plan):
    # a robot that the plan has not seen, its pose by spheres, its reflector read in the axes of the tracker
    robot, _, tracker = cells.l1()
    arms = cells.other_arms(robot, 0.003, seed=77)
    q = plan.q[plan.measured]
    offsets, directions, lengths = (
        np.array([arm.values[f"{arm.name}.{name}"] for arm in arms])
        for name in ("offset", "direction", "length")
    )
    r = cells.meeting_of_spheres(offsets + q[:, :, None] * directions, lengths)
    read = tracker.measure(r, seed=5, frame="device").r
    found = calibrate(robot, plan.placed(Measurements(q, read)), holdout=None)
    for k, length in enumerate(lengths):
        name = f"arms[{k}].length"
        assert found.parameters[name] == pytest.approx(length, abs=5 * found.deviations[name])


def test_all_robots_are_safe_and_seen_at_the_poses(plan):
    _, _limits, device = cells.l1()
    q, fleet = plan.q[plan.measured], plan.cell.fleet
    for member in fleet.members:
        r, R = member.pose(q)
        assert device.sees(r, R, bars=member.bars(q, r, R)).all()
        assert (member.joints(r, None) <= 2.0 + 1e-9).all()


def test_what_is_missing_is_said():
    robot, limits, device = cells.l1()
    small = varied(FEW, poses=9, robots=2)
    noisy = replace(device, transverse_noise=1e-3, range_noise=1e-3)
    found = plan_calibration(robot, limits, noisy, **small, wanted=7e-4)
    assert not found.verdict.good
    assert "The rest is noise of the device: plan about" in str(found.verdict)
    found = plan_calibration(robot, limits, noisy, **small, wanted=1e-5)
    assert "times less noise" in str(found.verdict)
    cameras = stereo_cameras((3.5, 2.9, 1.0), (0.9, 2.9, -0.4), facing=(1.0, 0.0, 0.3))
    found = plan_calibration(robot, limits, cameras, **varied(small, poses=20), wanted=1e-3)
    assert not found.verdict.good
    assert "of each pose are averaged the Cameras errs by" in str(found.verdict)  # too much for any robot
    assert found.trials.misread > 1e-3
    cameras = stereo_cameras((3.5, 2.9, 1.0), (0.9, 2.9, -0.4), facing=(1.0, 0.0, 0.3), lens_error=0.005)
    found = plan_calibration(robot, limits, cameras, **varied(small, poses=20), wanted=5e-4)
    assert not found.verdict.good
    assert "systematic in the Cameras and more poses do not help" in str(found.verdict)
    assert found.trials.averaged > 5 * found.prediction.error


def test_a_place_from_which_little_is_seen_is_told():
    robot, limits, _ = cells.l1()
    near = LaserTracker((2.0, 3.0, 0.0), elevation=(-0.3, 0.3))
    found = plan_calibration(robot, limits, near, **varied(FEW, robots=2))
    assert "another place for it would show more" in str(found.verdict)
    assert len(found.unseen) > 0
    assert not near.sees(found.unseen).all()


def test_progress_is_told():
    told = []
    plan_calibration(*cells.l1(), **varied(FEW, robots=2), progress=lambda *each: told.append(each))
    assert [stage for stage, done, of in told if done == of] == [
        "workspace", "candidates", "choice", "ways", "trials", "verdict",
    ]  # fmt: skip
    assert ("trials", 1, 2) in told


def test_remaining_poses_go_again_without_collision(plan):
    q = plan.q[plan.measured]
    done = Measurements(q[2:9], plan.r[plan.measured][2:9])
    rest = plan.remaining(done)
    assert sorted(map(tuple, rest.q[rest.measured])) == sorted(map(tuple, np.delete(q, np.s_[2:9], axis=0)))
    assert clear_ways(plan.cell.fleet, rest.q[:-1], rest.q[1:]).all()
    nothing = plan.remaining(Measurements(q, plan.r[plan.measured]))
    assert not nothing.measured.any()
    lost = plan.r[plan.measured].copy()
    lost[5] = np.nan  # not seen
    assert plan.remaining(Measurements(q, lost)).q[
        plan.remaining(Measurements(q, lost)).measured
    ].tolist() == [q[5].tolist()]
    with pytest.raises(ModelError, match=r"remaining: found measurements of 2 actuators, expected 3 as the"):
        plan.remaining(Measurements(q[:, :2], plan.r[plan.measured]))


def test_files_hold_the_plan(plan, tmp_path):
    folder = plan.write(tmp_path / "cell", name="CalibrateL1")
    assert sorted(path.name for path in folder.iterdir()) == [
        "CalibrateL1.mod", "measurements-template.csv", "plan.html", "plan.json", "poses.csv", "workspace.png",
    ]  # fmt: skip
    with (folder / "poses.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["number"]) for row in rows] == list(range(1, len(plan.q) + 1))
    np.testing.assert_allclose([[float(row[f"q{k}"]) for k in (1, 2, 3)] for row in rows], plan.q, atol=1e-9)
    assert [row["measured"] == "1" for row in rows] == plan.measured.tolist()
    json.loads(
        (folder / "plan.json").read_text(encoding="utf-8"), parse_constant=lambda word: pytest.fail(word)
    )
    page = (folder / "plan.html").read_text(encoding="utf-8")
    assert page.index("Good: go ahead") < page.index("What to do") < page.index("Poses")
    assert 'src="data:image/png;base64,' in page
    assert page.count("<td>measure</td>") == 14


def test_a_loaded_plan_is_the_plan(plan, tmp_path):
    robot, limits, _ = cells.l1()
    loaded = load_plan(plan.write(tmp_path))
    cells.same(loaded, plan)
    assert str(loaded).splitlines()[0] == str(plan).splitlines()[0]
    assert loaded.program() == plan.program()
    q = plan.q[plan.measured]
    done = Measurements(q[:8], plan.r[plan.measured][:8])
    kept = loaded.remaining(done)  # the same ways, without the robot
    np.testing.assert_array_equal(kept.q, plan.q)
    assert kept.measured.sum() == 6
    known = load_plan(tmp_path, robot, limits).remaining(done)
    assert sorted(map(tuple, known.q[known.measured])) == sorted(map(tuple, q[8:]))
    kept.write(tmp_path / "rest")
    assert not (tmp_path / "rest" / "workspace.png").exists()
    longer = robot.modified(dict(arms=[dict(length=2.1), dict(), dict()]))
    with pytest.raises(ModelError, match=r"arms\[0\].length = 2.1, expected 2.06.* as planned; .* or plan"):
        load_plan(tmp_path, longer, limits)
    strict = replace(limits, clearance=limits.clearance + 0.05)  # the cell has changed since
    less = load_plan(tmp_path, robot, strict)
    anew = less.remaining(done)
    assert less.cell is not None
    assert clear_ways(less.cell.fleet, anew.q[:-1], anew.q[1:]).all()
    assert anew.measured.sum() + len(anew.lost) - len(plan.lost) == 6
    limits = replace(limits, strokes=(-0.6, 0.9))
    with pytest.raises(ModelError, match=r"load_plan: found F1GantryTau with .* expected the robot of the"):
        load_plan(tmp_path, F1GantryTau(prototypes.F1), limits)
