"""Systems of FMUs described and checked without running them, as their files and on the command line."""

import json
import zipfile

import pytest
from typer.testing import CliRunner

from gantrytau import ModelError
from gantrytau.commands.app import app
from gantrytau_fmu.systems.ssp.read_ssp import STRUCTURE
from gantrytau_fmu.systems.ssp.system_description import check_system, read_system
from gantrytau_fmu.systems.ssp.write_ssp import write_ssp
from tests.fmu.systems.small_fmus import Builder, variable

FAULT, MISUSE = 1, 2


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """y' = k (u - y)."""
    lines = [variable("u", "input", 0.5), variable("k", "parameter", 2.0), variable("y", "output", 1.0)]
    return Builder(tmp_path_factory.mktemp("fmus"))(
        "lag", lines, advance="v[2] = v[0] + (v[2] - v[0]) * exp(-v[1] * h);"
    )


@pytest.fixture
def system(tmp_path, lag):
    """Two of them, one behind the other."""
    parts, wires = {"a": lag, "b": lag}, [("a.y", "b.u")]
    return write_ssp(tmp_path / "two.ssp", parts, wires, stop=2.0, step=0.1, start={"b.k": 3.0})


def changed(path, old, new):
    """The same file with another structure."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    assert old in members[STRUCTURE].decode()
    members[STRUCTURE] = members[STRUCTURE].decode().replace(old, new).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def command(*arguments):
    return CliRunner().invoke(app, ["fmu", *map(str, arguments)])


def test_a_system_is_described(system):
    found = read_system(system)
    assert [(part.name, part.file, part.fmi, part.inputs, part.outputs) for part in found.components] == [
        ("a", "resources/lag.fmu", "2.0", 1, 1),
        ("b", "resources/lag.fmu", "2.0", 1, 1),
    ]
    assert found.wires == (("a.y", "b.u"),)
    assert (found.unconnected, found.start) == ({"a.u": "0.5"}, {"b.k": 3.0})
    assert (found.begin, found.stop, found.step) == (0.0, 2.0, 0.1)
    printed = command("info", system).stdout
    for line in (
        "two.ssp: a system of 2 FMUs, run by `gantrytau fmu run`",
        "default experiment: start 0 s, stop 2 s, step 0.1 s",
        "  a.y -> b.u",
        "  b.k = 3",
        "  a.u = 0.5",
    ):
        assert line in printed.splitlines()
    told = json.loads(command("info", system, "--json").stdout)
    assert told["wires"] == [["a.y", "b.u"]]
    assert told["components"][1]["name"] == "b"
    assert told["path"] == str(system)


def test_long_lists_are_cut_unless_all_is_asked_for(tmp_path, lag):
    parts = {f"p{k}": lag for k in range(15)}
    found = read_system(write_ssp(tmp_path / "many.ssp", parts, [], stop=1.0, step=0.1))
    assert "  ... and 3 more" in str(found)
    assert "p14.u = 0.5" not in str(found)
    assert "p14.u = 0.5" in found.table(None)
    assert "--all lists all of them" in command("info", tmp_path / "many.ssp").stdout


def test_a_system_is_checked_with_its_fmus(system):
    whole = command("check", system)
    assert whole.exit_code == 0
    assert f"{system}: note: nothing drives a.u, which keeps its value 0.5" in whole.stdout
    assert whole.stdout.endswith(f"{system}: no errors, 1 remark\n")
    wrong = changed(system, 'startConnector="y"', 'startConnector="z"')
    (finding,) = check_system(wrong)
    assert (finding.severity, finding.path) == ("error", str(system))
    assert finding.message.startswith("connection a.z -> b.u: a has no variable 'z'")
    found = command("check", wrong, "--json")
    assert found.exit_code == FAULT
    assert json.loads(found.stdout)["error"] == f"{system}: {finding.message}"


def test_what_is_wrong_with_an_fmu_names_it_in_the_archive(tmp_path, system, lag):
    torn = tmp_path / "torn.fmu"
    with zipfile.ZipFile(lag) as archive, zipfile.ZipFile(torn, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            copy.writestr(name, content.replace(b'initial="exact"', b'initial="never"'))
    with zipfile.ZipFile(system) as archive:
        structure = archive.read(STRUCTURE)
    with zipfile.ZipFile(system, "w") as archive:
        archive.writestr(STRUCTURE, structure)
        archive.write(torn, "resources/lag.fmu")
    findings = check_system(system)
    assert {finding.path for finding in findings} == {f"{system}: resources/lag.fmu"}
    assert "'never'" in findings[0].message
    with pytest.raises(ModelError, match=r"lag\.fmu: found a modelDescription\.xml that breaks the schema"):
        read_system(system)


def test_files_that_are_no_systems(tmp_path):
    file = tmp_path / "page.ssp"
    file.write_text("<html>")
    assert [str(finding) for finding in check_system(file)] == [
        f"{file}: error: found the beginning '<h', expected 'PK': this is no ZIP archive, so no SSP; "
        "check that it is the right file"
    ]
    assert command("info", file).exit_code == FAULT
    assert command("check", tmp_path / "peach.ssp").exit_code == MISUSE
