"""The command line: what doctor finds, and what it says when something is missing."""

import importlib.metadata
import json

import casadi
import pytest
from typer.testing import CliRunner

from gantrytau.commands import installation
from gantrytau.commands.app import app


def run(*arguments):
    return CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200"})


def findings():
    return {finding["name"]: finding for finding in json.loads(run("doctor", "--json").stdout)["findings"]}


def test_doctor_finds_this_installation_in_order():
    answer = run("doctor", "--json")
    assert answer.exit_code == 0
    assert json.loads(answer.stdout)["ok"] is True
    found = findings()
    assert found["casadi"]["found"] == importlib.metadata.version("casadi")
    assert {
        "python",
        "gantrytau",
        "numpy",
        "scipy",
        "ipopt",
        "mumps",
        "idas",
        "cvodes",
        "newton",
    } <= found.keys()
    assert {"results", "view", "cross", "cluster", "C compiler"} <= found.keys()


def test_doctor_prints_a_table():
    answer = run("doctor")
    assert answer.exit_code == 0
    assert "ipopt" in answer.stdout
    assert importlib.metadata.version("numpy") in answer.stdout


def test_a_missing_solver_fails_with_a_remedy(monkeypatch):
    monkeypatch.setattr(casadi, "has_nlpsol", lambda name: False)
    answer = run("doctor")
    assert answer.exit_code == 1
    assert "missing: ipopt: casadi lacks this plug-in; reinstall it: pip install" in answer.stdout
    assert json.loads(run("doctor", "--json").stdout)["ok"] is False


@pytest.mark.parametrize("version", [None, "3.6.7"])
def test_a_missing_or_old_package_fails_with_a_remedy(monkeypatch, version):
    real = installation._version
    monkeypatch.setattr(installation, "_version", lambda name: version if name == "casadi" else real(name))
    answer = run("doctor")
    assert answer.exit_code == 1
    assert f"{version or 'not installed'}, expected <4,>=3.8" in answer.stdout
    assert "missing: casadi: pip install 'casadi<4,>=3.8'" in answer.stdout


def test_a_missing_compiler_or_extra_is_no_failure(monkeypatch):
    real = installation._version
    monkeypatch.setattr(installation.shutil, "which", lambda name: None)
    monkeypatch.setattr(installation, "_version", lambda name: None if name == "xarray" else real(name))
    answer = run("doctor")
    assert answer.exit_code == 0
    assert "optional: C compiler: needed to compile functions and FMUs; install gcc" in answer.stdout
    assert "optional: results: pip install 'gantrytau[results]'" in answer.stdout


def test_a_compiler_that_cannot_be_run_is_reported(monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_text("no program")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    found = findings()["C compiler"]
    assert found["good"] is False
    assert "CC" in found["remedy"]


def test_without_a_command_the_help_is_shown():
    assert "doctor" in run("--help").stdout
    assert "--json" in run("doctor", "--help").stdout
