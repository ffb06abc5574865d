"""`gantrytau doctor`: it tries what it finds, and says what is broken, what is missing, and what to do."""

import importlib.metadata
import json
from dataclasses import replace

import casadi
import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

from gantrytau.commands.app import app
from gantrytau.commands.doctor import essential_probes, extra_probes, installation
from gantrytau.commands.doctor.essential_probes import Missing, Wrong
from gantrytau.commands.doctor.installation import Checked, tried

TRIED = {"ipopt", "cvodes", "idas", "newton", "matplotlib", "loky", "C compiler", "FMU"}
EXTRAS = {"results", "view", "cross", "vision", "cluster"}


def run(*arguments):
    return CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200"})


def quick(monkeypatch, *kept):
    """An examination of which only some probes do anything."""
    monkeypatch.setattr(
        installation, "_ESSENTIAL", [row for row in installation._ESSENTIAL if row[1] in kept]
    )
    monkeypatch.setattr(installation, "_EXTRAS", [row for row in installation._EXTRAS if row[0] in kept])
    for name in ("compiler", "fmu"):
        if name not in kept:
            monkeypatch.setattr(essential_probes, name, lambda: "not tried")


def findings():
    return {finding["name"]: finding for finding in json.loads(run("doctor", "--json").stdout)["findings"]}


def test_this_installation_works():
    answer = run("doctor", "--json")
    told = json.loads(answer.stdout)
    wrong = [one for one in told["findings"] if one["state"] == "broken"]
    assert not wrong
    assert (answer.exit_code, told["ok"]) == (0, True)
    found = {one["name"]: one for one in told["findings"] if one["group"] != "packages"}
    assert found.keys() == TRIED | EXTRAS | {"python"}
    for name in ("ipopt", "matplotlib", "FMU"):
        assert found[name]["seconds"] > 0
    versions = {one["name"]: one["found"] for one in told["findings"] if one["group"] == "packages"}
    assert versions["casadi"] == importlib.metadata.version("casadi")
    required = importlib.metadata.requires("gantrytau") or ()
    assert {Requirement(r).name for r in required if "extra ==" not in r} < versions.keys()


def test_a_table_is_printed(monkeypatch):
    quick(monkeypatch, "ipopt", "newton")
    answer = run("doctor")
    assert answer.exit_code == 0
    assert "solved a problem (with mumps)" in answer.stdout
    assert importlib.metadata.version("numpy") in answer.stdout
    assert "Everything works." in answer.stdout


# a package is there and imported, but what it is for fails: name -> module, attribute that raises
BREAKABLE = {
    "ipopt": ("casadi", "nlpsol"),
    "cvodes": ("casadi", "integrator"),
    "newton": ("casadi", "rootfinder"),
    "matplotlib": ("matplotlib.figure.Figure", "savefig"),
    "loky": ("gantrytau", "study"),
    "results": ("xarray", "open_dataset"),
    "view": ("viser", "ViserServer"),
    "vision": ("cv2", "findChessboardCorners"),
    "cluster": ("dask.distributed.Client", "submit"),
}


@pytest.mark.parametrize("name", BREAKABLE)
def test_what_is_there_and_does_not_work_is_broken(monkeypatch, name):
    def broken(*given, **named):
        raise RuntimeError("symbol lookup error\nsecond line")

    quick(monkeypatch, name)
    place, attribute = BREAKABLE[name]
    pytest.importorskip(place.partition(".")[0])
    monkeypatch.setattr(f"{place}.{attribute}", broken)
    answer = run("doctor")
    assert answer.exit_code == 1
    assert "RuntimeError: symbol lookup error" in answer.stdout
    assert f"broken: {name}: " in answer.stdout
    assert "pip install --force-reinstall" in answer.stdout
    assert "Traceback" not in answer.output
    found = findings()[name]
    assert found["state"] == "broken"


def test_what_answers_wrongly_is_broken(monkeypatch):
    quick(monkeypatch, "cvodes")
    monkeypatch.setattr(essential_probes.math, "exp", lambda x: 3.0)
    assert "x(1 s) is 0.367879445, expected 3" in findings()["cvodes"]["found"]
    assert run("doctor").exit_code == 1


def test_code_for_the_wrong_processor_is_no_cross_compiler(monkeypatch):
    pytest.importorskip("ziglang")
    monkeypatch.setattr(extra_probes, "AARCH64", 1)
    assert (
        tried("extras", "cross", extra_probes.cross, "").found
        == "Wrong: what zig wrote is no code for aarch64-linux"
    )


def test_a_missing_solver_fails_with_a_remedy(monkeypatch):
    quick(monkeypatch, "ipopt")
    monkeypatch.setattr(casadi, "has_nlpsol", lambda name: False)
    answer = run("doctor")
    assert answer.exit_code == 1
    assert "casadi lacks the plug-in ipopt" in answer.stdout
    assert (
        "missing: ipopt: optimize needs it; reinstall it: pip install --force-reinstall casadi"
        in answer.stdout
    )
    assert json.loads(run("doctor", "--json").stdout)["ok"] is False


@pytest.mark.parametrize("version", [None, "3.6.7"])
def test_a_missing_or_old_package_fails_with_a_remedy(monkeypatch, version):
    quick(monkeypatch)
    real = installation._version
    monkeypatch.setattr(installation, "_version", lambda name: version if name == "casadi" else real(name))
    answer = run("doctor")
    assert answer.exit_code == 1
    assert f"{version or 'not installed'}, expected <4,>=3.8" in answer.stdout
    assert "casadi: pip install 'casadi<4,>=3.8'" in answer.stdout


@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_a_missing_compiler_or_extra_is_no_failure(monkeypatch, extra):
    quick(monkeypatch, extra, "compiler", "fmu")
    parts = {"results": "xarray", "view": "viser", "cross": "ziglang", "vision": "opencv-python-headless"}
    gone, real = parts.get(extra, "dask"), installation._version
    monkeypatch.setattr(essential_probes.shutil, "which", lambda name: None)
    monkeypatch.setattr(essential_probes, "_exported", lambda *given: missing())
    monkeypatch.setattr(installation, "_version", lambda name: None if name == gone else real(name))
    answer = run("doctor")
    assert answer.exit_code == 0
    assert "optional: C compiler: needed to compile functions and FMUs; install gcc" in answer.stdout
    assert f"optional: {extra}: pip install 'gantrytau[{extra}]'" in answer.stdout
    assert f"{gone} not installed" in answer.stdout
    assert "What is installed works." in answer.stdout


def missing():
    raise Missing("there is no C compiler")


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("no program", "named by CC"),
        ("#!/bin/sh\necho 'cannot find crt1.o' >&2; exit 1", "fails: cannot find crt1.o"),
        ("#!/bin/sh\nexit 0", "the program it made"),
    ],
)
def test_a_compiler_that_does_not_compile_is_broken(monkeypatch, tmp_path, script, words):
    quick(monkeypatch, "compiler")
    broken = tmp_path / "cc"
    broken.write_text(script)
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    found = findings()["C compiler"]
    assert found["state"] == "broken"
    assert words in found["found"]
    assert run("doctor").exit_code == 1


def test_probes_that_raise_what_they_like_are_told_in_one_line():
    def leaves():
        raise SystemExit(3)

    def silent():
        raise ValueError

    def chatty():
        print("a banner")
        return "went well"

    assert tried("", "a", leaves, "").found == "SystemExit: 3"
    assert tried("", "a", silent, "").found == "ValueError: without words"
    assert tried("", "a", chatty, "").found == "went well"
    assert replace(Checked("", "a", "", "not installed"), essential=False).harmful is False
    assert issubclass(Wrong, Exception)


def test_without_a_command_the_help_is_shown():
    assert "doctor" in run("--help").stdout
    assert "--json" in run("doctor", "--help").stdout
