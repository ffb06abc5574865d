"""`gantrytau doctor`: it tries what it finds, and says what is broken, what is missing, and what to do."""

import importlib.metadata
import json

import pytest
from packaging.requirements import Requirement

from gantrytau.commands.doctor import doctor_command, trials


def test_this_installation_works(answer):
    told = answer("doctor")
    assert told["ok"]
    found = {one["name"]: one for one in told["findings"]}
    assert {"python", "simulate", "optimize", "fmu", "viser", "numpy"} <= found.keys()
    assert found["casadi"]["found"] == importlib.metadata.version("casadi")
    assert all(found[name]["seconds"] > 0 for name in ("simulate", "optimize", "fmu"))


def broken(folder):
    print("a banner")
    raise RuntimeError("symbol lookup error\nsecond line")


def silent(folder):
    raise SystemExit


@pytest.mark.parametrize(
    ("trial", "words"),
    [
        (broken, "RuntimeError: symbol lookup error"),
        (silent, "SystemExit: without words"),
        (lambda folder: trials.expect("x", 1.0, 2.0, 0.1), "ArithmeticError: x is 1, expected 2"),
    ],
)
def test_what_is_there_and_does_not_work_is_broken(run, monkeypatch, trial, words):
    monkeypatch.setattr(doctor_command, "TRIALS", [("solver", trial, True, "install it anew")])
    table = run("doctor")
    found = {one["name"]: one for one in json.loads(run("doctor", "--json").stdout)["findings"]}["solver"]
    assert (table.exit_code, found["state"], found["found"]) == (1, "broken", words)
    assert "broken: solver: install it anew" in table.stdout
    assert "second line" not in table.output


def test_a_missing_compiler_or_extra_is_no_failure(run, monkeypatch):
    def missing(folder):
        raise trials.CompilerMissing("there is no C compiler")

    monkeypatch.setattr(doctor_command, "TRIALS", [("fmu", missing, False, "install gcc")])
    monkeypatch.setattr(importlib.metadata, "version", without("viser"))
    table = run("doctor")
    assert table.exit_code == 0
    assert "optional: fmu: install gcc" in table.stdout
    assert "optional: viser: pip install 'gantrytau[view]'" in table.stdout


def without(missing):
    real = importlib.metadata.version

    def version(name):
        if name == missing:
            raise importlib.metadata.PackageNotFoundError
        return real(name)

    return version


def test_a_missing_or_old_package_fails_with_a_remedy(monkeypatch):
    monkeypatch.setattr(importlib.metadata, "version", without("numpy"))
    assert doctor_command.package("packages", Requirement("numpy>=2")).remedy == "pip install 'numpy>=2'"
    old = doctor_command.package("packages", Requirement("casadi>=99"))
    assert (old.state, old.harmful) == ("broken", True)
    assert "expected >=99" in old.found
