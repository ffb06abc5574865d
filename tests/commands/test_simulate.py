"""`gantrytau simulate`: figures, files, pictures, inputs, and runs that stop early."""

import csv
import json
import os
import signal
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gantrytau.simulation.integration import Run

FAULT, MISUSE, INTERRUPTED = 1, 2, 130


def columns(file):
    """Header -> values of a CSV file."""
    with file.open() as opened:
        rows = list(csv.reader(opened))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def test_a_pushed_cart_goes_as_far_as_newton_says(run, answer, robots):
    arguments = (
        "simulate",
        f"{robots}:Cart",
        "--set",
        "m=2",
        "--input",
        "f=3",
        "--start",
        "1",
        "--stop",
        "5",
    )
    found = answer(*arguments, "--points", "9")
    assert found["final"]["x"] == pytest.approx(3 / 2 * 4**2 / 2, rel=1e-7)  # ten times the tolerance
    assert found["final"]["v"] == pytest.approx(3 / 2 * 4, rel=1e-7)
    assert found["time"] == {"start": 1.0, "stop": 5.0, "points": 9}
    assert found["states"] == ["x", "v"]
    assert found["files"] == []
    spoken = run(*arguments, "--statistics")
    assert spoken.exit_code == 0
    assert found["statistics"]["steps"] > 5
    assert "rejected" in spoken.stdout
    assert "Cart: 1 s to 5 s, 501 points" in spoken.stdout
    assert [line.split()[:3] for line in spoken.stdout.splitlines() if line.strip().startswith("x ")] == [
        ["x", "0", "12"]
    ]


def test_only_the_outputs_that_are_asked_for_are_kept(run, answer, robots, tmp_path):
    arguments = ("simulate", f"{robots}:Cart(m=2)", "--input", "f=3", "--stop", "4", "--outputs", "x,der(v)")
    assert answer(*arguments)["final"] == pytest.approx({"x": 12.0, "der(v)": 1.5}, rel=1e-7)
    assert run(*arguments, "--output", str(tmp_path / "cart.csv")).exit_code == 0
    assert list(columns(tmp_path / "cart.csv")) == ["time [s]", "x [m]", "der(v) [m/s2]"]
    spoken = run(*arguments[:-1], "der(v)").stdout  # no state is among them: what is kept is shown
    assert "501 points, 1 variable\n" in spoken
    assert [row.split()[:3] for row in spoken.splitlines() if row.strip().startswith("der(v)")] == [
        ["der(v)", "1.5", "1.5"]
    ]
    wrong = run(*arguments[:-1], "speed")
    assert (wrong.exit_code, "no variable or parameter 'speed'" in wrong.stderr) == (MISUSE, True)


def test_names_and_units_are_not_taken_for_markup(run, robots):
    found = run("simulate", f"{robots}:Painted", "--stop", "1")
    assert found.exit_code == 0
    row = next(line for line in found.stdout.splitlines() if line.strip().startswith("level "))
    name, start, end, *_, unit = row.split()
    assert (name, start, unit) == ("level", "1", "m")
    assert float(end) == pytest.approx(np.exp(-1), abs=1e-5)  # a hundred steps, each within the tolerance


@pytest.mark.parametrize("column", [":push", ":push [N]"])
def test_an_input_comes_from_a_column(answer, robots, tmp_path, column):
    file = tmp_path / "push.csv"
    file.write_text("time [s],push [N],f\n0,0,1\n\n1,2,1\n2,2,1\n")
    found = answer(
        "simulate", f"{robots}:Cart", "--set", "m=1", "--stop", "2", "--input", f"f={file}{column}"
    )
    assert found["final"]["v"] == pytest.approx(1 + 2, rel=1e-6)  # fifty stretches, each within the tolerance
    found = answer("simulate", f"{robots}:Cart", "--set", "m=1", "--stop", "2", "--input", f"f={file}")
    assert found["final"]["v"] == pytest.approx(2, rel=1e-6)


@pytest.mark.parametrize("suffix", [".csv", ".nc", ".mat", ".parquet"])
def test_results_are_saved(answer, tmp_path, suffix):
    file = tmp_path / f"swing{suffix}"
    found = answer("simulate", "Pendulum", "--stop", "1", "--points", "11", "--output", file)
    assert found["files"] == [str(file)]
    assert file.stat().st_size > 1000  # 17 variables at 11 times
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_a_picture_is_drawn(answer, tmp_path):
    file = tmp_path / "swing.png"
    found = answer("simulate", "Pendulum", "--stop", "1", "--plot", "x,y", "--plot", "der(v_x)", "--to", file)
    assert found["files"] == [str(file)]
    assert len(np.unique(plt.imread(file).reshape(-1, 4), axis=0)) > 20  # paper, axes, the lines' colours


def test_a_vector_of_the_robot_is_drawn_and_its_files_are_told(run, tmp_path):
    picture, table = tmp_path / "tool.png", tmp_path / "tool.csv"
    found = run(
        "simulate",
        "GantryTau(GT_A)",
        "--stop",
        "0.05",
        "--plot",
        "tool.r,arms[0].rail.frame_b.R[0,0],time",
        "--to",
        picture,
        "--output",
        table,
    )
    assert found.exit_code == 0, found.output
    assert f"Written: {table}\nWritten: {picture}" in found.stdout
    assert picture.stat().st_size > 5000


def test_a_window_is_opened_where_there_is_one(run, monkeypatch):
    shown = []
    monkeypatch.setattr(plt, "get_backend", lambda: "QtAgg")
    monkeypatch.setattr(plt, "show", lambda: shown.append(True))
    assert run("simulate", "Pendulum", "--stop", "1", "--plot", "x").exit_code == 0
    assert shown == [True]
    plt.close("all")


def test_without_a_display_the_window_has_a_remedy(fails, monkeypatch):
    monkeypatch.setattr(plt, "get_backend", lambda: "agg")
    message = fails(MISUSE, "simulate", "Pendulum", "--stop", "1", "--plot", "x")
    assert "no window can be opened here (Matplotlib draws with 'agg')" in message
    assert "--to picture.png" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--plot", "x", "--to", "picture.xyz"), "found the suffix '.xyz', expected 'window' or a picture"),
        (("--to", "a.png"), "--to a.png: found no names to draw, expected some; add --plot NAMES"),
        (("--output", "result.cvs"), "result.cvs: found the suffix '.cvs'"),
        (("--input", "f"), "--input f: expected NAME=VALUE, as --input m=2.5"),
        (("--input", "f=noise(1)"), "--input f=noise(1): there is no signal noise"),
        (("--input", "f=prbs(1, 0.1)"), "--input f=prbs(1, 0.1): "),
        (("--input", "f=no_such_file.csv:f"), "no_such_file.csv: found no file to read"),
    ],
)
def test_misuse_is_told_before_the_work(fails, monkeypatch, options, message):
    monkeypatch.setattr("gantrytau.commands.simulate_command.translate", None)
    assert message in fails(MISUSE, "simulate", "Pendulum", "--stop", "1", *options)


def test_what_cannot_be_written_is_told(fails, tmp_path):
    assert "is a folder, expected the name of a file in it" in fails(
        MISUSE, "simulate", "Pendulum", "--stop", "1", "--output", tmp_path
    )
    name = "x" * 300 + ".csv"  # longer than file systems allow
    assert "Cannot write" in fails(MISUSE, "simulate", "Pendulum", "--stop", "1", "--output", tmp_path / name)


def test_signals_take_the_seed_of_the_run(answer, fails, robots):
    arguments = ("simulate", f"{robots}:Cart(m=1)", "--stop", "1", "--input", "f=prbs(7, hold=0.1)")
    first, again, other = (answer(*arguments, "--seed", seed)["final"] for seed in ("1", "1", "2"))
    assert first == again != other
    # ten pushes of 0.1 N.s, forth or back
    assert first["v"] == pytest.approx(round(first["v"] * 10) / 10, abs=1e-7)
    assert "--seed" in fails(MISUSE, *arguments)


def test_a_solution_without_end_leaves_what_was_found(fails, run, robots, tmp_path):
    file = tmp_path / "part.csv"
    arguments = ("simulate", f"{robots}:Runaway", "--stop", "2", "--output", file)
    message = fails(FAULT, *arguments)
    assert "Runaway: the integration stopped at t = " in message
    assert f"What was computed until then is in {file}" in message
    table = columns(file)
    assert 0.9 < table["time [s]"][-1] <= 1.0
    early = table["time [s]"] < 0.5
    exact = 1 / (1 - table["time [s]"][early])
    assert np.allclose(table["x [1]"][early], exact, rtol=1e-5)  # a hundred steps; errors grow as x^2
    report = json.loads(run(*arguments, "--json").stdout)
    assert report["time"] == pytest.approx(1.0, abs=0.01)
    assert report["files"] == [str(file)]


def press_ctrl_c(monkeypatch):
    """Let Ctrl-C be pressed after the first stretch of a simulation."""
    advance = Run._advance

    def pressed(run, count):
        advance(run, count)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Run, "_advance", pressed)


def test_ctrl_c_leaves_what_was_found(fails, run, tmp_path, monkeypatch):
    press_ctrl_c(monkeypatch)
    file = tmp_path / "part.csv"
    message = fails(INTERRUPTED, "simulate", "Pendulum", "--stop", "10", "--output", file)
    assert "Pendulum: simulation interrupted at t = 1 s\nWhat was computed until then is in " in message
    assert columns(file)["time [s]"][-1] == pytest.approx(1.0)  # 50 of 500 intervals
    message = fails(INTERRUPTED, "simulate", "Pendulum", "--stop", "10")
    assert "with --output its result would have been saved" in message


def test_a_missing_extra_is_told_before_the_work(fails, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    message = fails(MISUSE, "simulate", "Pendulum", "--stop", "1", "--output", tmp_path / "a.parquet")
    assert "pip install 'gantrytau[results]'" in message


def test_limits_and_singular_poses_are_met_as_the_options_say(run, answer, fails, tmp_path):
    (tmp_path / "throw.py").write_text(
        "from gantrytau import Model, Real, der\n"
        "class Throw(Model):\n"
        "    x = Real(unit='m', start=0.0, fixed=True, max=4.0)\n"
        "    v = Real(unit='m/s', start=9.81, fixed=True)\n"
        "    def equations(self):\n"
        "        yield der(self.x) == self.v\n"
        "        yield der(self.v) == -9.81\n"
    )
    thrown = ("simulate", f"{tmp_path / 'throw.py'}:Throw", "--stop", "1")
    assert "passes its max" in run(*thrown).stderr
    assert answer(*thrown, "--limits", "stop")["ended"] == "x passes its max of 4 m"
    assert answer(*thrown, "--limits", "none")["warnings"] == []
    flat = [
        f"--set={n}={v}"
        for n, v in {"ground": 1, "crank.length": 0.3, "coupler.length": 1, "rocker.length": 0.3}.items()
    ]
    flat = ("simulate", "FourBar", "--stop", "0.4", *flat)
    assert "cross it with the speeds before it" in fails(FAULT, *flat)
    assert "crossed" in answer(*flat, "--singular", "cross")["warnings"][0]


def test_what_is_not_finite_is_told_beside_the_answer(run, answer, tmp_path):
    (tmp_path / "roots.py").write_text(
        "from gantrytau import Model, Real, der, sqrt\n"
        "class Root(Model):\n"
        "    x = Real(start=1.0, fixed=True)\n"
        "    y = Real()\n"
        "    def equations(self):\n"
        "        yield der(self.x) == -1.0\n"
        "        yield self.y == sqrt(self.x - 0.5)\n"
    )
    arguments = ("simulate", f"{tmp_path / 'roots.py'}:Root", "--stop", "1", "--max-step", "0.1")
    words = "Root: y is not finite from t = 0.5"  # or 0.502, by rounding
    assert words in run(*arguments).stderr
    assert words in answer(*arguments)["warnings"][0]


def test_a_class_of_modelica_text_is_a_model(run):
    file = Path(__file__).parents[1] / "modelica" / "motions.mo"
    said = run("simulate", f"{file}:Motions.Ball", "--set", "e=0.5", "--json")
    assert json.loads(said.stdout)["ended"] == "enough"
    assert "did you mean 'Motions.Ball'" in run("simulate", f"{file}:Motions.Bal").stderr
    assert "name one, as motions.mo:Motions.Ball" in " ".join(run("check", file).stderr.split())


def test_packages_of_a_model_are_found_in_a_library(run, fails, tmp_path, monkeypatch):
    monkeypatch.delenv("MODELICAPATH", raising=False)
    drive = Path(__file__).parents[1] / "modelica" / "drive.mo"
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "Drive.mo").write_text(drive.read_text())
    file = tmp_path / "use.mo"
    file.write_text("model Use\n  Drive.Rc rc;\nend Use;\n")
    assert run("check", file, "--library", tmp_path / "parts").exit_code == 0
    assert "MODELICAPATH" not in os.environ
    assert "A library is given by its folder" in fails(FAULT, "check", file)
    assert "--library" in fails(MISUSE, "check", file, "--library", tmp_path / "none")
