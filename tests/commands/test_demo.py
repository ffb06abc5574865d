"""`gantrytau demo`: the four motions, their files, and what bad places and Ctrl-C get."""

import csv
import json
import os
import signal

import matplotlib
import pytest
from typer.testing import CliRunner

import gantrytau_optimica
from gantrytau.commands.app import app

matplotlib.use("Agg")
TIMES = [0.913510, 0.92103, 0.97598, 0.97406]  # s, independently computed on the same mesh
FILES = ["paths.png", "torques.png", "free_w0.csv", "free_w0001.csv", "free_w001.csv", "line_w0.csv"]


def test_the_demo_solves_the_four_motions_and_writes_its_files(tmp_path):
    folder = tmp_path / "new" / "folder"
    folder.mkdir(parents=True)
    (folder / "paths.png").write_text("old")
    found = CliRunner().invoke(app, ["demo", "--json", "--output", str(folder)])
    assert found.exit_code == 0, found.output
    answer = json.loads(found.stdout)
    times = [row["time"] for row in answer["rows"]]
    assert times[0] < TIMES[0] + 1.5e-4  # converged runs scatter there, and a faster branch exists
    assert times[1:] == pytest.approx(TIMES[1:], abs=2e-5)
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
