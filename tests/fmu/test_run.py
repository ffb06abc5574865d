"""`gantrytau fmu run` and one FMU by itself, against known solutions."""

import csv
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau import ModelError
from gantrytau.cli import app
from gantrytau_fmu.systems.single import run_fmu
from gantrytau_fmu.systems.ssp_writing import write_ssp

from .small_fmus import Builder, variable

FAULT, MISUSE = 1, 2


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    return Builder(tmp_path_factory.mktemp("fmus"))


@pytest.fixture(scope="module")
def lag(build):
    """y' = k (u - y) from 1."""
    lines = [
        variable("u", "input", 0.0, unit="m"),
        variable("k", "parameter", 2.0),
        variable("y", "output", 1.0, unit="m"),
    ]
    return build("lag", lines, advance="v[2] = v[0] + (v[2] - v[0]) * exp(-v[1] * h);")


def run(*arguments):
    return CliRunner().invoke(app, ["fmu", "run", *map(str, arguments)])


def test_one_fmu_has_names_without_prefix(lag):
    found = run_fmu(lag, stop=1.0, step=0.25, start={"k": 3.0}, inputs={"u": 2.0})
    assert found.names == ("u", "y") or set(found.names) == {"u", "y"}
    assert found["y"] == pytest.approx(2.0 - np.exp(-3.0 * found.time), abs=1e-12)
    assert (found.unit("y"), found.title) == ("m", "lag")
    with pytest.raises(ModelError, match=r"found no stop time"):
        run_fmu(lag)
    with pytest.raises(ModelError, match=r"has no interface for model-exchange, expected one"):
        run_fmu(lag, stop=1.0, model_exchange=True)
    with pytest.raises(ModelError, match=r"Model Exchange runs in this process, found isolate"):
        run_fmu(lag, stop=1.0, model_exchange=True, isolate=True)


def test_the_command_prints_and_saves(lag, tmp_path):
    forces = tmp_path / "u.csv"
    forces.write_text("time,u [m]\n0,2\n1,2\n")
    table = tmp_path / "y.csv"
    found = run(
        lag, "--stop", 1, "--step", 0.1, "--set", "k=3", "--input", f"u={forces}", "--output", table, "--json"
    )
    assert found.exit_code == 0, found.output
    summary = json.loads(found.stdout)
    assert summary["final"]["y"] == pytest.approx(2 - np.exp(-3), abs=1e-12)
    assert summary["time"] == {"start": 0.0, "stop": 1.0, "points": 11}
    assert summary["files"] == [str(table)]
    with table.open() as opened:
        assert set(next(csv.reader(opened))) == {"time [s]", "u [m]", "y [m]"}
    spoken = run(lag, "--stop", 1, "--isolate")
    assert spoken.exit_code == 0
    assert "0 s to 1 s, 501 points, 2 variables" in spoken.stdout


def test_the_command_draws(lag, tmp_path):
    picture = tmp_path / "y.png"
    found = run(lag, "--stop", 1, "--plot", "y", "--to", picture)
    assert found.exit_code == 0, found.output
    assert picture.stat().st_size > 0


def test_the_command_runs_systems(lag, tmp_path):
    path = write_ssp(
        tmp_path / "two.ssp", {"a": lag, "b": lag}, [("a.y", "b.u")], stop=1.0, step=0.1, start={"a.k": 0.0}
    )
    summary = json.loads(run(path, "--set", "b.k=4", "--json").stdout)
    assert summary["final"] == pytest.approx({"a.y": 1, "b.y": 1, "a.u": 0, "b.u": 1}, abs=1e-12)
    refused = run(path, "--me")
    assert refused.exit_code == MISUSE
    assert "a system is simulated by Co-Simulation" in refused.output


def test_a_failing_run_saves_what_there_is(build, tmp_path):
    lines = [variable("y", "output", 0.0)]
    file = build("stops", lines, advance="if (t > 0.45) return 3; v[0] = t + h;")
    table = tmp_path / "y.csv"
    found = run(file, "--stop", 1, "--step", 0.1, "--output", table, "--json")
    assert found.exit_code == FAULT
    said = json.loads(found.stdout)
    assert said["kind"] == "SolveError"
    assert said["time"] == pytest.approx(0.5)
    assert len(table.read_text().splitlines()) == 7


def test_wrong_calls_are_told(lag, tmp_path):
    assert run(tmp_path / "no.fmu", "--stop", 1).exit_code == MISUSE
    unknown = run(lag, "--stop", 1, "--set", "q=1")
    assert unknown.exit_code == FAULT
    assert "has no variable 'q'" in unknown.output
