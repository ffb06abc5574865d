"""`gantrytau fmu run` and one FMU by itself, against known solutions."""

import csv
import json
import shutil
import signal

import numpy as np
import pytest
from typer.testing import CliRunner

from gantrytau import Model, ModelError, Output, Parameter, Real, SolveError, der
from gantrytau.commands.app import app
from gantrytau.progress import Progress
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from gantrytau_fmu.systems.ssp.write_ssp import write_ssp
from tests.fmu.systems.small_fmus import variable

FAULT, MISUSE, INTERRUPTED = 1, 2, 130


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


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "q=1"], "q: lag.fmu has no variable 'q'; there is u, k, y."),
        (["--set", "y=1"], "a continuous output that is calculated, expected a parameter, an input"),
        (["--input", "uu=1"], "uu: lag.fmu has no variable 'uu'; did you mean 'u'?"),
        (["--step", "0"], "--step 0.0: expected more than 0 and at most the 1 s that are simulated"),
        (["--order", "jakobi"], "'jakobi' is not one of"),
        (["--order", "jacobi"], "--order jacobi: found one FMU, expected a system (.ssp); leave it out"),
        (["--me", "--isolate"], "--me --isolate: Model Exchange runs in this process, expected one of them"),
    ],
)
def test_wrong_calls_are_told_in_the_words_of_the_command(lag, arguments, words):
    found = run(lag, *([] if "--stop" in arguments else ["--stop", 1]), *arguments)
    assert found.exit_code == MISUSE
    assert words in found.output
    assert arguments[0] in found.output


def test_files_that_cannot_be_run(lag, tmp_path):
    assert run(tmp_path / "no.fmu", "--stop", 1).exit_code == MISUSE
    (tmp_path / "page.fmu").write_text("<html>")
    for name, kind in (("page.fmu", "FMU"), ("page.ssp", "SSP")):
        (tmp_path / name).write_text("<html>")
        page = run(tmp_path / name, "--stop", 1)
        assert page.exit_code == FAULT
        assert (
            f"{name}: found the beginning '<h', expected 'PK': this is no ZIP archive, so no {kind}; check"
            in page.output
        )
    assert run(lag).exit_code == MISUSE
    assert "expected one in s, as --stop 1.0" in run(lag).output


def test_inputs_that_nothing_drives_are_a_note(lag, tmp_path):
    found = run(lag, "--stop", 1)
    assert (
        found.stderr
        == "Note: nothing drives 1 input, which keeps its value: u = 0; give it with --input or --set\n"
    )
    printed = run(lag, "--stop", 1, "--json")
    assert printed.stderr == ""
    assert json.loads(printed.stdout)["warnings"] == [found.stderr.removeprefix("Note: ").strip()]
    assert run(lag, "--stop", 1, "--input", "u=0").stderr == ""
    path = write_ssp(tmp_path / "two.ssp", {"a": lag, "b": lag}, [("a.y", "b.u")], stop=1.0, step=0.1)
    assert "Note: nothing drives 1 input, which keeps its value: a.u = 0; give" in run(path).stderr


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    """x'' = -x from 1, exported with Model Exchange."""

    class Swing(Model):
        x = Output(unit="m", start=1.0, fixed=True)
        v = Real(unit="m/s", start=0.0, fixed=True)
        stiffness = Parameter(1.0, unit="1/s2")

        def equations(self):
            yield self.v == der(self.x)
            yield der(self.v) == -self.stiffness * self.x

    if not any(map(shutil.which, ("cc", "gcc", "clang"))):
        pytest.skip("no C compiler")
    return export_fmu(Swing(), tmp_path_factory.mktemp("swing") / "swing.fmu")


def test_an_interrupted_integration_saves_what_there_is(swing, tmp_path, monkeypatch):
    class Pressing(Progress):
        def at(self, t):
            if t > 0.45:
                signal.raise_signal(signal.SIGINT)

    table = tmp_path / "x.csv"
    whole = run(swing, "--me", "--stop", 1, "--step", 0.1, "--output", table)
    assert whole.exit_code == 0, whole.output
    assert len(table.read_text().splitlines()) == 12
    monkeypatch.setattr("gantrytau_fmu.systems.model_exchange.Progress", Pressing)
    found = run(swing, "--me", "--stop", 1, "--step", 0.1, "--output", table, "--json")
    assert found.exit_code == INTERRUPTED, found.output
    said = json.loads(found.stdout)
    assert said["error"].startswith("swing.fmu: the integration was interrupted at t = 0.5 s")
    assert said["files"] == [str(table)]
    rows = list(csv.DictReader(table.open()))
    assert float(rows[-1]["time [s]"]) == pytest.approx(0.5)
    assert float(rows[-1]["x [m]"]) == pytest.approx(np.cos(0.5), abs=1e-3)  # CVode at its relative 1e-5
    lost = run(swing, "--me", "--stop", 1, "--step", 0.1)
    assert "with --output its result would have been saved" in lost.output


def test_an_integration_that_fails_keeps_what_there_is(swing, monkeypatch):
    class Failing(Progress):
        def at(self, t):
            if t > 0.45:
                raise RuntimeError("the integrator gave up")

    monkeypatch.setattr("gantrytau_fmu.systems.model_exchange.Progress", Failing)
    with pytest.raises(SolveError, match=r"swing\.fmu: the integration failed after t = 0\.\d+ s") as caught:
        run_fmu(swing, stop=1.0, step=0.1, model_exchange=True)
    assert caught.value.result.time[-1] == pytest.approx(caught.value.time)
