"""`gantrytau demo`: its motions, their files, and what bad places and Ctrl-C get."""

import csv
import json
import os
import signal
from dataclasses import replace

import matplotlib
import pytest
from typer.testing import CliRunner

import gantrytau_optimica
from gantrytau.commands.app import app
from gantrytau.commands.demo.motion_problems import OnLine

matplotlib.use("Agg")
# s, on ever finer meshes; the line by its phase plane; those with weights on 50 elements of free torques
TIMES = [0.91313, 0.92103, 0.97598, 0.973782]
TRAJECTORIES = ["free_w0", "free_w0001", "free_w001", "line_w0", "free_branch", "six_link"]
FILES = ["paths.png", "torques.png", "six_link.png", *(f"{key}.csv" for key in TRAJECTORIES)]


def test_the_demo_solves_its_motions_and_writes_its_files(tmp_path):
    folder = tmp_path / "new" / "folder"
    folder.mkdir(parents=True)
    (folder / "paths.png").write_text("old")
    found = CliRunner().invoke(app, ["demo", "--json", "--output", str(folder)])
    assert found.exit_code == 0, found.output
    answer = json.loads(found.stdout)
    times = [row["time"] for row in answer["rows"]]
    assert times == pytest.approx(TIMES, rel=1e-3)  # the accuracy to which they are refined
    branch, six_link = answer["more"]
    assert branch["time"] == pytest.approx(0.8602, rel=1e-3)
    # by Lagrange's equations and rod tensions, 20 elements
    assert six_link["time"] == pytest.approx(0.4160, rel=3e-3)
    for row in [*answer["rows"], branch, six_link]:
        assert row["refined"], row["row"]
        assert row["violation"] < 1e-3, row["row"]  # between the nodes as well: nothing rings
    assert "not printed in the thesis" in answer["why"]
    assert [row["thesis_time"] for row in answer["rows"]] == [0.9074, 0.9191, 0.9968, 0.97612]
    assert sorted(os.listdir(folder)) == sorted(FILES)
    assert sorted(answer["files"]) == sorted(str(folder / name) for name in FILES)
    for name in FILES:
        assert (folder / name).stat().st_size > 1000, name
    with (folder / "line_w0.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["robot.tool.r[1] [m]"]) == pytest.approx(2.51, abs=1e-8)
    assert float(rows[-1]["robot.tool.r[1] [m]"]) == pytest.approx(3.46, abs=1e-8)
    assert float(rows[-1]["time [s]"]) == pytest.approx(times[3], abs=1e-9)
    assert "torque[0] [N.m]" in rows[0]
    header = (folder / "six_link.csv").read_text().splitlines()[0]
    assert "robot.carts[2].f [N]" in header
    assert "torque" not in header


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    found = CliRunner().invoke(app, ["demo", "--output", str(tmp_path / "file" / "below")])
    assert found.exit_code == 2
    assert "Cannot write into" in found.output
    assert "--output" in found.output
    assert "Traceback" not in found.output


def test_ctrl_c_leaves_a_message_and_the_unfinished_motion(tmp_path, monkeypatch):
    solve = gantrytau_optimica.optimize

    def interrupted(problem, *, progress, **policy):
        def press(iteration: int, objective: float) -> None:
            progress(iteration, objective)
            if iteration == 4:
                signal.raise_signal(signal.SIGINT)

        return solve(problem, progress=press, **policy)

    monkeypatch.setattr(gantrytau_optimica, "optimize", interrupted)
    found = CliRunner().invoke(app, ["demo", "--output", str(tmp_path)])
    assert found.exit_code == 130
    assert "interrupted after" in found.output
    assert "unfinished" in found.output
    assert (tmp_path / "unfinished.csv").stat().st_size > 1000
    assert "Traceback" not in found.output


def test_motions_that_are_not_as_exact_as_wanted_are_told_on_the_screen(tmp_path, monkeypatch):
    solve, found = gantrytau_optimica.optimize, []

    def missing(problem, **policy):
        if not found:  # one motion stands for all: only what is told of it is looked at
            optimum = solve(OnLine, refine=policy["refine"])
            found.append(optimum.with_notes(refinement=replace(optimum.refinement, reached=False)))
        return found[0]

    monkeypatch.setattr(gantrytau_optimica, "optimize", missing)
    screen = CliRunner().invoke(app, ["demo", "--output", str(tmp_path)])
    assert screen.exit_code == 0, screen.output
    assert screen.output.count("NOT refined to 0.001") == 6
    assert "six links, robot D1: NOT refined to 0.001" in screen.output
