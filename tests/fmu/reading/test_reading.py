"""What an FMU is, read from FMUs made by hand; and what is refused."""

import json
import random
import re
import struct

import pytest

from gantrytau import GantryTauError, ModelError
from gantrytau_fmu.building.archive import universal
from gantrytau_fmu.reading.read_fmu import read_fmu
from tests.fmu.tiny_fmus import BUILD, FMI2, FMI3, TERMINALS, lag2, lag3, pack


@pytest.fixture
def path(tmp_path):
    return tmp_path / "lag.fmu"


def test_an_fmu_of_fmi_2_is_described(path):
    fmu = read_fmu(lag2(path))
    assert (fmu.fmi, fmu.name, fmu.token, fmu.tool) == ("2.0", "Lag", "{lag-2}", "by hand")
    assert [(each.kind, each.identifier) for each in fmu.interfaces] == [
        ("model-exchange", "lag"),
        ("co-simulation", "lag"),
    ]
    capabilities = fmu.interface("co-simulation").capabilities
    assert capabilities["canHandleVariableCommunicationStepSize"] is True
    assert capabilities["canGetAndSetFMUstate"] is False
    assert fmu.inputs == ("u",)
    assert fmu.outputs == ("y",)
    assert fmu.states == ("x",)
    assert fmu.parameters == ("k", "on", "file")
    assert fmu.dependencies == {"y": ("x",), "der(x)": None}
    assert (fmu.indicators, fmu.platforms, fmu.sources) == (1, (), ("sources/lag.c",))
    said = fmu.experiment
    assert (said.start, said.stop, said.tolerance, said.step) == (0.0, 2.0, 1e-4, 0.1)
    assert fmu.size == path.stat().st_size
    assert fmu.unpacked == len(FMI2) + 1


def test_the_variables_of_fmi_2(path):
    fmu = read_fmu(lag2(path))
    u, rate, y = fmu.variable("u"), fmu.variable("der(x)"), fmu.variable("y")
    assert (u.reference, u.type, u.causality, u.variability) == (1, "Real", "input", "continuous")
    assert (u.start, u.unit, u.min, u.max, u.nominal) == (
        0.25,
        "m",
        -10.0,
        10.0,
        2.0,
    )  # from its declared type
    assert (rate.derivative, rate.unit, rate.start, rate.initial) == ("x", "m/s", None, "calculated")
    assert (y.description, y.min, y.shape) == ("what is seen", None, ())
    assert [fmu.variable(name).start for name in ("k", "on", "file")] == [3, True, "a.txt"]


@pytest.mark.parametrize("said", [True, False])
def test_derivatives_of_fmi_3_have_names_of_their_own(path, said):
    words = "".join(
        f' provides{kind}="{str(said).lower()}"'
        for kind in ("DirectionalDerivatives", "AdjointDerivatives", "PerElementDependencies")
    )
    fmu = read_fmu(lag3(path, FMI3.replace("<CoSimulation", f"<CoSimulation{words}")))
    names = ("providesDirectionalDerivatives", "providesDirectionalDerivative", "providesAdjointDerivatives")
    for name in (*names, "providesPerElementDependencies"):
        assert fmu.interface("co-simulation").capabilities[name] is said
        assert fmu.interface("model-exchange").capabilities[name] is False
    two = FMI2.replace("<CoSimulation", '<CoSimulation providesDirectionalDerivative="true"')
    found = read_fmu(lag2(path, two)).interface("co-simulation").capabilities
    assert found["providesDirectionalDerivative"] is True
    assert "providesDirectionalDerivatives" not in found


def test_an_fmu_of_fmi_3_is_described(path):
    fmu = read_fmu(lag3(path))
    assert (fmu.fmi, fmu.token, fmu.indicators) == ("3.0", "{lag-3}", 1)
    p = fmu.variable("p")
    assert (p.shape, p.start) == ((2, 3), (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert fmu.variable("seen").reference == fmu.variable("y").reference
    assert fmu.dependencies == {"y": ("x",), "der(x)": ("x", "u")}
    assert fmu.sources == ("sources/lag.c",)
    (terminal,) = fmu.terminals
    assert (terminal.name, terminal.kind, terminal.description) == ("port", "shaft", "where it is seen")
    assert terminal.members == {"in": "u", "inner.y": "y"}


def test_platforms_have_a_binary_for_each_interface(path):
    binaries = [
        "linux64/lag.so",
        "x86_64-darwin/lag.dylib",
        "win64/lag.dll",
        "linux32/lag.so",
        "aarch64-linux/other.so",
        "aarch64-darwin/lag.so",
        "riscv64-linux/lag.so.1",
    ]
    fmu = read_fmu(
        pack(path, {"modelDescription.xml": FMI2} | {f"binaries/{name}": b"" for name in binaries})
    )
    assert fmu.platforms == ("x86-linux", "x86_64-darwin", "x86_64-linux", "x86_64-windows")


ELF_ARM = b"\x7fELF".ljust(18) + struct.pack("<H", 183)
PE_ARM = b"MZ".ljust(0x3C) + struct.pack("<I", 0x40) + b"PE\0\0" + struct.pack("<H", 0xAA64)


@pytest.mark.parametrize(
    ("name", "head", "platforms"),
    [
        ("linux64/lag.so", ELF_ARM, ("aarch64-linux",)),
        ("linux64/lag.so", ELF_ARM[:10], ("x86_64-linux",)),
        ("win64/lag.dll", PE_ARM, ("aarch64-windows",)),
        ("darwin64/lag.dylib", universal(b"", b""), ("aarch64-darwin", "x86_64-darwin")),
        ("darwin64/lag.dylib", struct.pack("<2I", 0xFEEDFACF, 0x0100000C), ("aarch64-darwin",)),
        ("darwin64/lag.dylib", b"?", ("x86_64-darwin",)),
    ],
)
def test_a_folder_of_fmi_2_says_the_system_and_the_library_its_processors(path, name, head, platforms):
    assert (
        read_fmu(pack(path, {"modelDescription.xml": FMI2, f"binaries/{name}": head})).platforms == platforms
    )


def test_it_prints_itself(path):
    lines = str(read_fmu(lag2(path))).splitlines()
    assert lines[0] == "Lag: FMI 2.0, Model Exchange and Co-Simulation, from by hand"
    assert lines[1:3] == ["first-order lag", "binaries for none; with sources"]
    assert lines[3].startswith("1 input, 1 output, 3 parameters, 1 state, 7 variables; ")
    assert lines[4] == "default experiment: start 0 s, stop 2 s, step 0.1 s, tolerance 0.0001"
    assert "  u  0.25  m" in lines
    assert "  y    m  what is seen" in lines
    assert "  file  a.txt" in lines
    assert "  p[2, 3]  1 2 3 4 ..." in str(read_fmu(lag3(path)))


def test_long_lists_are_cut(path):
    more = "".join(
        f'<Float64 name="q{k}" valueReference="{10 + k}" causality="parameter" variability="fixed" start="{k}"/>'
        for k in range(20)
    )
    text = FMI3.replace("</ModelVariables>", f"{more}</ModelVariables>")
    assert "  ... and 9 more" in str(read_fmu(lag3(path, text)))


@pytest.mark.parametrize("make", [lag2, lag3])
def test_it_becomes_json(path, make):
    found = json.loads(json.dumps(read_fmu(make(path)).as_dict()))
    assert found["inputs"] == ["u"]
    assert found["interfaces"]["co-simulation"]["identifier"] == "lag"
    assert {variable["name"] for variable in found["variables"]} >= {"u", "x", "der(x)", "y"}
    assert found["path"] == str(path)


def test_an_unknown_name_gets_a_proposal(path):
    with pytest.raises(ModelError, match=r"lag.fmu: Lag has no variable 'der\(X\)'; did you mean"):
        read_fmu(lag2(path)).variable("der(X)")


def test_an_interface_that_is_not_there(path):
    fmu = read_fmu(lag2(path))
    with pytest.raises(ModelError, match="found only model-exchange, co-simulation, expected"):
        fmu.interface("scheduled-execution")


@pytest.mark.parametrize(
    ("version", "remedy"),
    [("1.0", "export it again as FMI 2.0 or 3.0"), ("4.0", "use one of these"), ("3.1", "use one of these")],
)
def test_other_versions_are_refused(path, version, remedy):
    with pytest.raises(ModelError, match=f"found FMI version '{version}', expected 2.0 or 3.0; {remedy}"):
        read_fmu(lag2(path, FMI2.replace('fmiVersion="2.0"', f'fmiVersion="{version}"')))


def test_xml_of_something_else_is_refused(path):
    with pytest.raises(ModelError, match="begins with 'html', expected fmiModelDescription"):
        read_fmu(pack(path, {"modelDescription.xml": "<html/>"}))


def test_a_description_that_breaks_the_schema_is_refused(path):
    text = (
        FMI2.replace('causality="', 'causality="un').replace("<Integer", "<Complex").replace("guid=", "gid=")
    )
    with pytest.raises(ModelError) as error:
        read_fmu(lag2(path, text))
    message = str(error.value)
    assert f"{path}: found a modelDescription.xml that breaks the schema of FMI 2.0" in message
    assert "\n  modelDescription.xml, line " in message
    assert len(message.splitlines()) == 5
    assert re.fullmatch(r"  \.\.\. and \d more", message.splitlines()[-1])


@pytest.mark.parametrize(("name", "text"), [("build", BUILD), ("terminals", TERMINALS)])
def test_other_files_that_break_their_schema_are_refused(path, name, text):
    with pytest.raises(ModelError, match=r"attribute 'fmiVersion'.*"):
        read_fmu(lag3(path, **{name: text.replace('fmiVersion="3.0"', 'fmiVersion="2.0"')}))


@pytest.mark.parametrize(
    ("make", "old", "new", "words"),
    [
        (lag2, 'index="5"', 'index="55"', "list index out of range"),
        (lag2, 'derivative="3"', 'derivative="30"', "model variable index 30 which does not exist"),
        (lag2, 'declaredType="Length"', 'declaredType="Width"', 'declaredType="Width" which has not been'),
        (lag2, '"input"', '"input" variability="fixed"', "illegal combination"),
        (lag3, '<Output valueReference="5"', '<Output valueReference="50"', "it names 50, which it does not"),
        (lag3, '<Dimension start="2"/>', '<Dimension valueReference="77"/>', "it names 77, which it does"),
    ],
)
def test_a_description_that_contradicts_itself_is_refused(path, make, old, new, words):
    text = (FMI2 if make is lag2 else FMI3).replace(old, new)
    with pytest.raises(ModelError) as error:
        read_fmu(make(path, text))
    assert "found a modelDescription.xml that contradicts itself" in str(error.value)
    assert words in str(error.value)


@pytest.mark.parametrize(("make", "text"), [(lag2, FMI2), (lag3, FMI3)])
def test_changed_letters_never_raise_anything_else(path, make, text):
    """Whatever letter of the description is changed, it is read, or refused with our own message."""
    generator, refused = random.Random(11), 0
    places = generator.sample(range(len(text)), 400)
    for place in places:
        changed = text[:place] + generator.choice("0a<>\"' -&\x00") + text[place + 1 :]
        try:
            str(read_fmu(make(path, changed)))
        except GantryTauError:
            refused += 1
    assert 0 < refused <= len(places)


@pytest.mark.parametrize("identifier", ["../lag", "lag;ls", "la g", "1ag", ""])
def test_an_identifier_that_is_no_name_in_c_is_refused(path, identifier):
    said = FMI3.replace(
        '<CoSimulation modelIdentifier="lag"', f'<CoSimulation modelIdentifier="{identifier}"'
    )
    with pytest.raises(
        ModelError, match=re.escape(f"found the modelIdentifier {identifier!r} of co-simulation")
    ):
        read_fmu(lag3(path, said))


def test_a_variable_that_is_there_twice_is_refused(path):
    with pytest.raises(ModelError, match="found the variable 'u' 2 times, expected each name once"):
        read_fmu(lag2(path, FMI2.replace('name="y"', 'name="u"')))
