"""`gantrytau demo`: the figures it prints and the files it leaves."""

import csv
import json
import signal

import pytest
from typer.testing import CliRunner

from gantrytau.cli import app


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    answer = CliRunner().invoke(app, ["demo", "--json", "--output", str(folder)])
    assert answer.exit_code == 0, answer.output
    return folder, json.loads(answer.stdout)


def test_times_beside_the_thesis(shown):
    _, figures = shown
    times = [row["time"] for row in figures["rows"]]
    assert times[0] < 0.9137
    assert times[1:] == pytest.approx([0.92103, 0.97598, 0.974057], abs=2e-5)
    assert [row["thesis_time"] for row in figures["rows"]] == [0.9074, 0.9191, 0.9968, 0.97612]


def test_pictures_and_trajectories_are_written(shown):
    folder, figures = shown
    assert sorted(file.name for file in folder.iterdir()) == sorted(
        f.rsplit("/", 1)[-1] for f in figures["files"]
    )
    for name in ("paths.png", "torques.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    with (folder / "line_w0.csv").open() as file:
        rows = list(csv.reader(file))
    assert len(rows) == 152  # header, start, 50 elements of 3 points
    assert rows[0][:2] == ["time [s]", "robot.tool.r[0] [m]"]
    assert float(rows[-1][1]) == pytest.approx(1.711, abs=1e-7)


def test_unwritable_folder_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    answer = CliRunner().invoke(app, ["demo", "--output", str(tmp_path / "file")])
    assert answer.exit_code == 2
    assert "Cannot write into" in answer.output
    assert "--output" in answer.output


def test_interrupted_solve_leaves_the_unfinished_motion(tmp_path, monkeypatch):
    from gantrytau_optimica import ipopt

    reached = ipopt._Watch.eval

    def press_at_ten(self, arg):
        if self.iteration == 10:
            signal.raise_signal(signal.SIGINT)
        return reached(self, arg)

    monkeypatch.setattr(ipopt._Watch, "eval", press_at_ten)
    answer = CliRunner().invoke(app, ["demo", "--output", str(tmp_path)])
    assert answer.exit_code == 130
    assert "interrupted" in answer.output
    assert [file.name for file in tmp_path.iterdir()] == ["unfinished.csv"]
