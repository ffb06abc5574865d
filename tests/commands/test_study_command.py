"""`gantrytau study`: files of studies, what is printed and written, and what is refused."""

import json
import subprocess
import sys

import numpy as np
import pytest

FAULT, MISUSE = 1, 2


@pytest.fixture
def written(tmp_path):
    """Writes the file of a study, and says where it is."""

    def write(text):
        file = tmp_path / "study.toml"
        file.write_text(text)
        return str(file)

    return write


def test_pushed_carts_go_as_far_as_newton_says(answer, run, robots, written, tmp_path):
    file = written(
        f'model = "{robots}:Cart(m=1)"\nstop = 4.0\n[over]\nm = [1.0, 2.0]\nf = {{ from = 1.0, to = 3.0, number = 3 }}\n'
    )
    found = answer("study", file, "--output", str(tmp_path / "carts.nc"), "--folder", str(tmp_path / "kept"))
    for case in found["cases"]:
        chosen = case["chosen"]
        # ten times the tolerance
        assert case["final"]["x"] == pytest.approx(chosen["f"] / chosen["m"] * 4**2 / 2, rel=1e-7)
    assert [case["chosen"]["f"] for case in found["cases"]] == [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "carts.nc", engine="h5netcdf") as table:
        assert table["x"].dims == ("m", "f.input", "time")
        assert float(table["x"].sel({"m": 2.0, "f.input": 3.0})[-1]) == pytest.approx(12.0, rel=1e-7)
    spoken = run("study", file, "--folder", str(tmp_path / "kept"))
    assert "Cart: 6 cases over m (2) x f.input (3), 0 failed" in spoken.stdout
    assert ["x", "4", "10", "24"] in [line.split() for line in spoken.stdout.splitlines()]


def test_the_example_is_a_study_that_runs(run, written, tmp_path):
    example = run("study", "--example")
    picture = tmp_path / "swings.png"
    spoken = run("study", written(example.stdout), "--plot", "x", "--to", str(picture))
    assert spoken.exit_code == 0
    assert "Pendulum: 27 cases over L (3) x x.start (9), 0 failed" in spoken.stdout
    assert picture.stat().st_size > 1000


def test_a_function_of_a_file_is_called_and_failed_cases_are_told(run, answer, written, tmp_path):
    (tmp_path / "moves.py").write_text("def area(a, b=2.0):\n    return {'area': 1 / a * b}\n")
    file = written(f'function = "{tmp_path}/moves.py:area"\n[over]\na = [0.5, 0.0, 2.0]\n')
    found = answer("study", file)
    assert [case.get("final") for case in found["cases"]] == [{"area": 4.0}, None, {"area": 1.0}]
    assert found["cases"][1]["kind"] == "ZeroDivisionError"
    assert "Failed: a=0: ZeroDivisionError: float division by zero" in run("study", file).stderr
    none = written(f'function = "{tmp_path}/moves.py:area"\n[over]\na = [0.0]\n')
    assert run("study", none).exit_code == FAULT


REFUSED = {
    'modle = "Pendulum"': "modle: there is no such key; did you mean 'model'?",
    "stop = 1.0": 'found neither of model and function, expected one, as model = "Pendulum"',
    'model = "Pendulum"\nover = 3': "over: found 3, expected a table",
    'model = "Pendulum"\nstop = 1.0\n[over]\nL = { from = 1 }': "over.L: found {'from': 1}, expected a list, or { from",
    'model = "Pendulum"\n[over]\nL = [1]': "stop",
    'function = "moves"\n[over]\na = [1]': "found function = 'moves', expected its file and name, as moves.py:fastest",
}


@pytest.mark.parametrize("text", REFUSED)
def test_wrong_files_are_refused_in_words(run, written, text):
    spoken = run("study", written(text))
    assert spoken.exit_code in (FAULT, MISUSE)
    assert REFUSED[text] in " ".join(spoken.stderr.split())


def test_a_place_that_cannot_be_written_is_told_before_the_work(run, written):
    file = written('model = "Pendulum"\nstop = 1.0\n[over]\nL = [1.0]\n')
    assert "expected .nc" in run("study", file, "--output", "found.csv").stderr
    refused = run("study", file, "--where", "proceses")
    assert refused.exit_code == MISUSE
    assert "did you mean 'processes'?" in refused.stderr


def test_the_command_runs_as_a_program_with_a_model_of_a_file(robots, written, tmp_path):
    file = written(f'model = "{robots}:Cart(m=1)"\nstop = 1.0\n[over]\nm = [1.0, 4.0]\n[inputs]\nf = 2.0\n')
    code = "from gantrytau.cli import app; app()"
    program = [sys.executable, "-c", code, "study", file, "--json"]
    found = subprocess.run(program, capture_output=True, text=True, check=True, timeout=120)
    ends = [case["final"]["v"] for case in json.loads(found.stdout)["cases"]]
    assert np.allclose(ends, [2.0, 0.5], rtol=1e-7)
