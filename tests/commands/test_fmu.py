"""`gantrytau fmu export`, `check` and `info`: good answers and each refusal."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from gantrytau_fmu import Build, DefaultExperiment
from gantrytau_fmu.building.platforms import native
from tests.families import first_of
from tests.fmu.tiny_fmus import FMI2, lag2, running3

FAULT, MISUSE = 1, 2
HERE = native().name
NO_COMPILER = shutil.which("cc") is None and shutil.which("gcc") is None and shutil.which("clang") is None


@pytest.fixture
def cart(tmp_path):
    """A model of a user that is exported quickly."""
    file = tmp_path / "carts.py"
    file.write_text(
        "from gantrytau import Input, Model, Output, Parameter, Real, der\n"
        "class Cart(Model):\n"
        '    """A cart that is pushed."""\n'
        '    m = Parameter(2.0, unit="kg", description="mass")\n'
        '    x = Real(unit="m", start=0.0, fixed=True, description="place")\n'
        '    v = Real(unit="m/s", start=0.0, fixed=True)\n'
        '    f = Input(unit="N", start=0.0)\n'
        "    def equations(self):\n"
        "        yield self.v == der(self.x)\n"
        "        yield self.m * der(self.v) == self.f\n"
        "class Unfinished(Cart):\n"
        "    def equations(self):\n"
        "        yield self.v == der(self.x)\n"
    )
    return file


@pytest.fixture
def asked(monkeypatch):
    """What export is asked to do, which it does not: a small FMU takes the place of the one to be written."""
    calls = []

    def export(model, path, **policy):
        calls.append((model, policy))
        return lag2(Path(path))

    monkeypatch.setattr("gantrytau.commands.fmu.fmu_export.export_fmu", export)
    return calls


@pytest.mark.skipif(NO_COMPILER, reason="no C compiler")
@pytest.mark.parametrize("fmi", first_of(["3.0", "2.0"]))
def test_what_is_exported_passes_the_check_and_runs(run, answer, cart, tmp_path, fmi):
    file = tmp_path / "cart.fmu"
    found = answer("fmu", "export", f"{cart}:Cart", "--to", file, "--fmi", fmi, "--set", "m=5")
    assert (found["model"], found["fmi"], found["platforms"]) == ("Cart", fmi, [HERE])
    assert (found["inputs"], set(found["states"])) == (["f"], {"x", "v"})
    assert found["parameters"] == ["m"]
    assert found["size"] == file.stat().st_size
    assert found["file"] == str(file)
    checked = answer("fmu", "check", file, "--run")
    assert checked["findings"] == []
    spoken = run("fmu", "check", file)
    assert spoken.stdout == f"{file}: no errors\n"
    told = answer("fmu", "info", file)
    (mass,) = [variable for variable in told["variables"] if variable["name"] == "m"]
    assert (mass["start"], mass["unit"], mass["description"]) == (5.0, "kg", "mass")
    assert "  f  0  N" in run("fmu", "info", file).stdout


def test_an_export_is_told(run, asked, cart, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = run("fmu", "export", f"{cart}:Cart")
    assert found.exit_code == 0
    lines = found.stdout.splitlines()
    assert lines[0] == "Cart, FMI 2.0: 1 input, 1 output, 3 parameters, 1 state, 7 variables in all"
    assert lines[1] == "Platforms: none, sources only"
    assert re.fullmatch(r"\d+ kB in \d+\.\d\d s", lines[2])
    assert lines[3] == "Written: Cart.fmu"
    assert (tmp_path / "Cart.fmu").is_file()


def test_options_arrive(run, asked, cart, tmp_path):
    arguments = [
        "--fmi",
        "2",
        "--platforms",
        "native,win64",
        "--solver",
        "rodas4",
        "--interface",
        "cs",
        "--given",
        "x",
    ]
    arguments += ["--find", "f,v", "--find", "der(v)", "--states", "v", "--tolerance", "1e-7", "--no-sources"]
    arguments += [
        "--stop",
        "2",
        "--step",
        "0.5",
        "--reference",
        "--description",
        "a cart",
        "--author",
        "A. Author",
    ]
    arguments += ["--copyright", "2026 A. Author", "--license", "MIT", "--model-version", "1.2"]
    found = run("fmu", "export", f"{cart}:Cart", "--to", tmp_path / "cart.fmu", *arguments)
    assert found.exit_code == 0, found.output
    ((model, policy),) = asked
    assert type(model).__name__ == "Cart"
    assert policy == {
        "fmi": "2.0",
        "solver": "rodas4",
        "interfaces": ("co-simulation",),
        "given": ("x",),
        "find": ("f", "v", "der(v)"),
        "states": ("v",),
        "tolerance": 1e-7,
        "reference": True,
        "build": Build(
            description="a cart",
            author="A. Author",
            copyright="2026 A. Author",
            license="MIT",
            version="1.2",
            platforms=("native", "win64"),
            sources=False,
            experiment=DefaultExperiment(stop=2.0, step=0.5, tolerance=1e-7),
        ),
    }


def test_defaults_arrive(run, asked, cart, tmp_path):
    run("fmu", "export", f"{cart}:Cart", "--to", tmp_path / "cart.fmu")
    ((_, policy),) = asked
    assert policy == {
        "fmi": "3.0",
        "solver": "dopri5",
        "interfaces": ("model-exchange", "co-simulation"),
        "given": (),
        "find": (),
        "states": None,
        "tolerance": 1e-6,
        "reference": False,
        "build": Build(),
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "cart.zip"], "--to cart.zip: found the suffix '.zip', expected '.fmu'"),
        (["--stop", "0"], "--stop 0.0: expected a number above 0"),
        (["--stop", "nan"], "--stop nan: expected a number above 0"),
        (["--step", "3", "--stop", "2"], "--step 3: expected more than 0 and at most the 2 s until the stop"),
        (["--set", "n=1"], "--set n: Cart has no 'n'"),
    ],
)
def test_wrong_options_are_told_before_the_work(fails, asked, cart, arguments, message):
    assert message in fails(MISUSE, "fmu", "export", f"{cart}:Cart", *arguments)
    assert asked == []


def test_warnings_are_notes(run, answer, cart, tmp_path, monkeypatch):
    def export(model, path, **policy):
        import warnings

        warnings.warn("no compiler found. The FMU holds C sources only", stacklevel=2)
        return lag2(Path(path))

    monkeypatch.setattr("gantrytau.commands.fmu.fmu_export.export_fmu", export)
    call = ["fmu", "export", f"{cart}:Cart", "--to", tmp_path / "cart.fmu"]
    assert "Note: no compiler found. The FMU holds C sources only" in run(*call).stderr
    assert answer(*call)["warnings"] == ["no compiler found. The FMU holds C sources only"]


def test_a_fault_in_an_fmu_gives_the_exit_code(run, tmp_path):
    file = lag2(tmp_path / "lag.fmu", FMI2.replace('min="-10"', 'min="20"'))
    found = run("fmu", "check", file)
    assert found.exit_code == FAULT
    lines = found.stdout.splitlines()
    assert lines[0] == f"{file}: error: u: min 20 is above max 10"
    assert lines[-1] == f"{file}: 2 errors, 1 remark"  # the start value is below min, too; no binary
    printed = run("fmu", "check", file, "--json")
    assert printed.exit_code == FAULT
    content = json.loads(printed.stdout)
    assert content["error"] == f"{file}: u: min 20 is above max 10"
    first = {"severity": "error", "message": "u: min 20 is above max 10", "path": str(file)}
    assert content["findings"][0] == first


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_crash_is_a_finding(run, tmp_path):
    found = run("fmu", "check", running3(tmp_path / "lag.fmu", "CRASH"), "--run")
    assert found.exit_code == FAULT
    assert "error: Co-Simulation, fmi3DoStep: the process ended (SIGABRT)" in found.stdout


@pytest.mark.parametrize("command", ["check", "info"])
def test_a_file_that_is_not_there(fails, tmp_path, command):
    lag2(tmp_path / "lag.fmu")
    message = fails(MISUSE, "fmu", command, tmp_path / "lug.fmu")
    assert "lug.fmu: found no such file, expected an archive; did you mean 'lag.fmu'?" in message


def test_info_says_how_to_see_all(run, tmp_path):
    name, place = '<ScalarVariable name="u"', FMI2.index("</ModelVariables>")
    many = "".join(
        f'<ScalarVariable name="n{k}" valueReference="{20 + k}" causality="input"><Real start="0"/></ScalarVariable>'
        for k in range(14)
    )
    assert name in FMI2
    file = lag2(tmp_path / "lag.fmu", FMI2[:place] + many + FMI2[place:])
    short, whole = run("fmu", "info", file).stdout, run("fmu", "info", file, "--all").stdout
    assert short.endswith("\n\n--all lists all of them\n")
    assert "  ... and 3 more" in short
    assert "n13" not in short
    assert "n13" in whole
    assert "more" not in whole
