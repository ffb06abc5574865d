"""What checks find in FMUs made by hand with one fault each, and in libraries that misbehave."""

import re

import pytest

from gantrytau_fmu.building.platforms import native
from gantrytau_fmu.reading.safety import DESCRIPTION
from gantrytau_fmu.systems.checking.check_fmu import check_fmu
from tests.fmu.tiny_fmus import FMI2, FMI3, TERMINALS, lag2, lag3, pack, running3

HERE = native()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "lag.fmu"


def told(path, **options):
    """The findings as lines, without the file that each names first."""
    lines = [str(finding) for finding in check_fmu(path, **options)]
    assert all(line.startswith(f"{path}: ") for line in lines)
    return [line.removeprefix(f"{path}: ") for line in lines]


@pytest.mark.parametrize("make", [lag2, lag3])
def test_an_fmu_of_sources_is_good_elsewhere(path, make):
    remedy = "it can be compiled from its sources"
    assert told(make(path)) == [f"warning: it has no binary for this machine ({HERE.name}); {remedy}"]


def test_an_fmu_with_a_binary_is_good(path):
    assert told(running3(path)) == []


def test_an_unsafe_archive_is_an_error_and_no_more(path):
    assert told(pack(path, {"../x": b"", DESCRIPTION: FMI2})) == [
        "error: member '../x' leads out of the archive, expected a path without '..'; do not trust this file"
    ]
    assert told(path.with_name("none.fmu")) == [
        "error: found no such file, expected an archive; did you mean 'lag.fmu'?"
    ]


def test_each_breach_of_the_schema_is_an_error(path):
    found = told(lag2(path, FMI2.replace('variability="', 'variability="un')))
    assert len(found) == 3
    assert all(line.startswith("error: modelDescription.xml, line ") for line in found)


@pytest.mark.parametrize(
    ("make", "old", "new", "message"),
    [
        (lag2, 'min="-10"', 'min="20"', "error: u: min 20 is above max 10"),
        (lag2, 'nominal="2"', 'nominal="0"', "error: u: nominal 0, expected a positive number"),
        (lag2, '"Length" start="0.25"', '"Length" start="25"', "error: u: start 25 is outside of its"),
        (lag2, '<Integer start="3"', '<Integer start="0"', "error: k: start 0 is outside of its limits [1,"),
        (lag2, '"Length" start="0.25"', '"Length" start="INF"', "error: u: start inf, expected a finite"),
        (lag3, 'start="1 2 3 4 5 6"', 'start="1 2 3"', "error: p: found 3 start values, expected 6 or one"),
        (lag2, 'unit="m" start', 'unit="yd" start', "error: x: its unit 'yd' is not among the"),
        (lag3, 'unit="m/s" derivative', 'unit="m" derivative', "warning: der(x) in m is the rate of x,"),
        (
            lag2,
            '<Unknown index="5" dependencies',
            '<Unknown index="3" dependencies',
            "error: y: this output is not listed",
        ),
        (
            lag2,
            '<Unknown index="5" dependencies',
            '<Unknown index="3" dependencies',
            "error: x: the ModelStructure lists it as output, but its causality is another",
        ),
        (
            lag3,
            '<Output valueReference="5" dependencies="3"/>',
            2 * '<Output valueReference="5"/>',
            "error: y: the ModelStructure lists this output more than once",
        ),
        (
            lag2,
            '<Derivatives><Unknown index="4"',
            '<Derivatives><Unknown index="4" dependencies="0"',
            "error: ModelStructure: found the index 0, expected 1 to 7",
        ),
        (
            lag3,
            'name="z" valueReference="6"',
            'name="z" valueReference="6" variability="discrete"',
            "error: z: this event indicator is discrete Float64, expected a continuous number",
        ),
        (
            lag3,
            '<EventIndicator valueReference="6"',
            '<EventIndicator valueReference="1"',
            "error: u: this event indicator is input, expected local",
        ),
        (lag2, 'guid="{lag-2}"', 'guid=""', "error: the GUID or instantiation token is empty"),
        (
            lag2,
            '<ModelExchange modelIdentifier="lag"',
            '<ModelExchange modelIdentifier="la g"',
            "error: found the modelIdentifier 'la g' of model-exchange, expected a name in C",
        ),
        (
            lag2,
            '<ModelExchange modelIdentifier="lag"',
            '<ModelExchange modelIdentifier="lag" needsExecutionTool="true"',
            "note: model-exchange needs the tool by hand on this machine",
        ),
        (lag2, 'stopTime="2"', 'stopTime="-2"', "warning: default experiment: stop -2 s is not after start"),
        (lag2, 'tolerance="1e-4"', 'tolerance="0"', "error: default experiment: tolerance 0, expected a"),
        (lag3, 'stepSize="0.1"', 'stepSize="-1"', "error: default experiment: step -1, expected a positive"),
        (lag2, 'name="lag.c"', 'name="lead.c"', "error: sources/lead.c: this source file is named but not"),
        (
            lag3,
            '<InitialUnknown valueReference="4"/>',
            '<InitialUnknown valueReference="4"/><InitialUnknown valueReference="1"/>',
            "error: u: the ModelStructure lists it as initial unknown, but it is none",
        ),
        (lag2, 'name="y"', 'name="u"', "error: found the variable 'u' 2 times"),
        (lag2, 'name="y"', 'name="a b"', 'error: "a b" (line'),  # by FMPy
        (
            lag2,
            '<Unknown index="4"/><Unknown index="5"/>',
            '<Unknown index="4"/>',
            "error: y: the ModelStructure does not list it as initial unknown",
        ),
    ],
)
def test_a_fault_is_found(path, make, old, new, message):
    text = FMI2 if make is lag2 else FMI3
    assert old in text
    found = told(make(path, text.replace(old, new)))
    assert any(line.startswith(message) for line in found), found


def test_faults_come_first(path):
    text = FMI2.replace('min="-10"', 'min="20"').replace('stopTime="2"', 'stopTime="-2"')
    severities = [finding.severity for finding in check_fmu(lag2(path, text))]
    assert severities == sorted(severities)  # error, note, warning would be another order
    assert severities[0] == "error"


def test_an_undefined_unit_is_told_once(path):
    found = told(lag2(path, FMI2.replace('<Real unit="m" start', '<Real unit="yd" displayUnit="ft" start')))
    assert [line for line in found if "yd" in line] == [
        "error: x: its unit 'yd' is not among the UnitDefinitions"
    ]


def test_a_display_unit_without_unit(path):
    found = told(lag3(path, FMI3.replace('name="z"', 'name="z" displayUnit="mm"')))
    assert found[0] == "error: z: it has the display unit 'mm' and no unit"
    assert not any("KeyError" in line for line in found)


def test_a_terminal_without_its_variable(path):
    found = told(lag3(path, terminals=TERMINALS.replace('variableName="u"', 'variableName="w"')))
    assert "error: terminal port.in: there is no variable 'w' in this FMU" in found


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("x86_64-linux/lag.so", b"text", "this is no ELF file, expected a shared library for x86_64-linux"),
        ("x86_64-windows/lag.dll", b"\x7fELF", "this is no PE file, expected a shared library for"),
        ("aarch64-darwin/lag.dylib", b"MZ", "this is no Mach-O file, expected a shared library for"),
        ("aarch64-linux/lag.so", b"\x7fELF".ljust(18) + b"\x3e\0", "this library is for another processor"),
        ("linux64/lag.so", b"\x7fELF".ljust(18) + b"\x3e\0", "FMI 3 calls this folder x86_64-linux"),
    ],
)
def test_a_binary_that_is_none(path, name, content, message):
    found = told(pack(path, {DESCRIPTION: FMI3, f"binaries/{name}": content}))
    assert any(line.startswith(f"error: binaries/{name}: {message}") for line in found)


def test_nothing_to_run(path):
    assert "error: it has neither binaries for all its interfaces nor sources" in told(
        pack(path, {DESCRIPTION: FMI3})
    )


def test_a_trial_run_of_what_is_good(path):
    assert told(running3(path), run=True) == []


def test_a_trial_run_needs_a_binary_for_this_machine(path):
    assert f"warning: not run: it has no binary for this machine ({HERE.name})" in told(lag3(path), run=True)


@pytest.mark.parametrize(
    ("fault", "messages"),
    [
        ("CRASH", ["error: Co-Simulation, fmi3DoStep: the process ended (SIGABRT)"]),
        ("LEAVE", ["error: Co-Simulation, fmi3DoStep: the process ended (exit code 0)"]),
        (
            "FAIL",
            [
                "error: Co-Simulation, fmi3DoStep: fmi3DoStep failed with status 3",
                "; it says: the spring broke",
            ],
        ),
        ("NO_STEPS", ["error: Co-Simulation, loading the binary: it does not export fmi3DoStep"]),
        ("OTHER", ["error: Model Exchange, fmi3GetVersion: found version 2.0, expected 3.0"]),
        ("REFUSE", ["error: Co-Simulation, fmi3InstantiateCoSimulation: Failed to instantiate FMU"]),
        (
            "UNREADABLE",
            ["the event indicator z cannot be read (fmi3GetFloat64 failed", "it says: no variable 6"],
        ),
        ("UNCOUNTED", ["it tells of 1 states and 5 event indicators, expected 1 and 1"]),
        ("ENDLESS", ["found changes after 100 iterations of one event, expected an end"]),
        (
            "NOT_FINITE",
            [
                "error: Model Exchange, fmi3GetContinuousStateDerivatives: number 1 of the derivatives is inf",
                "warning: Co-Simulation, y is nan, expected a finite number",
            ],
        ),
        ("FORGETFUL", ["warning: Co-Simulation, y is 0.", " after the same step from the saved state"]),
    ],
)
def test_a_fault_that_only_running_shows(path, fault, messages):
    assert [line for line in told(running3(path, fault)) if "fmi3" in line] == []
    found = "\n".join(told(path, run=True))
    for message in messages:
        assert message in found


def test_a_library_that_hangs_is_stopped(path):
    (line,) = told(running3(path, "HANG"), run=True, timeout=2.0)
    assert re.fullmatch(r"error: .*: no answer after 2 s", line)


def test_a_binary_that_cannot_be_loaded(path):
    processor = {"x86_64": 62, "aarch64": 183}.get(HERE.name.partition("-")[0], 0)
    content = b"\x7fELF".ljust(18) + processor.to_bytes(2, "little") + bytes(100)
    pack(path, {DESCRIPTION: FMI3, f"binaries/{HERE.folder_3}/lag{HERE.suffix}": content})
    found = told(path, run=True)
    assert any(line.startswith("error: Co-Simulation, loading the binary: ") for line in found)
