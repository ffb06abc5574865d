"""The XML files of FMUs against the official schemas, FMPy's rules, and the record they are written from."""

import re
from dataclasses import replace
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.describing.description_checks import initial_of
from gantrytau_fmu.describing.model_description import LOG_CATEGORIES, build_description, model_description
from gantrytau_fmu.describing.xml_text import plain
from gantrytau_fmu.description import DefaultExperiment, FmuDescription, FmuTerminal, FmuVariable, Unknown
from tests.fmu.interfaces import DESCRIPTIONS, VERSIONS, description, fmu, gain, oscillator, read, relay, said

ROOT = Path(__file__).parents[3]
SCHEMAS = Path(fmpy.__file__).parent / "schema"


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", DESCRIPTIONS)
@pytest.mark.parametrize("sources", [(), ("fmu.c", "core.h", "model/tables.c")])
def test_schemas_and_rules_of_the_standard_hold(name, fmi, sources):
    assert validate_fmu(fmu(DESCRIPTIONS[name](), fmi, sources)) == []  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_variables_read_back_as_they_were(name, fmi):
    told = DESCRIPTIONS[name]()
    found = read(told, fmi).modelVariables
    assert len(found) == len(told.variables)
    for ours, theirs in zip(told.variables, found, strict=True):
        number = float if ours.real else int
        kinds = ("Real", "Integer") if fmi == "2.0" else ("Float64", "Int32")
        assert theirs.type == kinds[ours.integer]
        assert (theirs.name, theirs.valueReference) == (ours.name, ours.reference)
        assert (theirs.causality, theirs.variability) == (ours.causality, ours.variability)
        assert theirs.initial == initial_of(ours)
        assert (theirs.description or "") == ours.description
        assert (theirs.unit or "") == ours.unit.replace("1", "" if ours.unit == "1" else "1")
        assert (theirs.derivative and theirs.derivative.name) == ours.derivative
        for attribute in ("start", "min", "max", "nominal"):
            value = getattr(theirs, attribute)
            assert (value if value is None else number(value)) == getattr(ours, attribute), (
                ours.name,
                attribute,
            )


@pytest.mark.parametrize("fmi", VERSIONS)
def test_head_and_default_experiment(fmi):
    told = oscillator()
    found = read(told, fmi)
    assert (found.fmiVersion, found.modelName, found.guid) == (fmi, told.name, told.token)
    for attribute in ("description", "author", "version", "copyright", "license"):
        assert getattr(found, attribute) == getattr(told, attribute)
    assert (found.generationTool, found.generationDateAndTime) == (told.tool, told.generated)
    assert found.variableNamingConvention == "structured"
    experiment = found.defaultExperiment
    read_back = (experiment.startTime, experiment.stopTime, experiment.tolerance, experiment.stepSize)
    assert [float(value or "nan") for value in read_back] == [0.5, 4.0, 1e-7, 0.002]


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize(
    "number", [5e-324, -1.7976931348623157e308, -0.0, 1 / 3, 2.0**53 + 2, 0.1 + 0.2, np.float64(0.7), 3]
)
def test_numbers_read_back_bit_for_bit(number, fmi):
    p = FmuVariable(
        "p", 0, "parameter", "tunable", start=number, min=number, max=number, nominal=abs(number) or None
    )
    found = read(description(p), fmi).modelVariables[1]
    for text in (found.start, found.min, found.max):
        assert float(text or "nan").hex() == float(number).hex()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_infinite_limits_are_left_out(fmi):
    p = FmuVariable("p", 0, "parameter", "fixed", start=1.0, min=-np.inf, max=np.inf, nominal=np.nan)
    found = read(description(p), fmi).modelVariables[1]
    assert (found.min, found.max, found.nominal) == (None, None, None)


def structure(told: FmuDescription, fmi, which: str):
    """Lists of the structure by names: unknown -> (dependencies, kinds)."""
    found = getattr(read(told, fmi), which)
    return {
        u.variable.name: (u.dependencies and [v.name for v in u.dependencies], u.dependenciesKind)
        for u in found
    }


@pytest.mark.parametrize("fmi", VERSIONS)
def test_dependencies_are_listed_in_ascending_order_of_what_is_known(fmi):
    told = oscillator()
    share = (["f", "s"], None) if fmi == "2.0" else (["m", "f", "s"], ["tunable", "dependent", "dependent"])
    assert structure(told, fmi, "outputs") == {"s": (["s"], ["constant"]), "share": share}
    assert structure(told, fmi, "derivatives") == {
        "v": (["v"], ["constant"]),
        "der(v)": (["f", "s"], ["tunable", "tunable"]),
    }
    # at the start a factor is constant or nothing is said of it
    assert structure(told, fmi, "initialUnknowns") == {
        "der(v)": (["m", "spring.c", "f", "s"], ["dependent", "dependent", "constant", "dependent"]),
        "share": (["spring.c", "f", "s"], None),
    }


@pytest.mark.parametrize("fmi", VERSIONS)
def test_initial_unknowns_are_found_where_none_are_listed(fmi):
    told = oscillator(initial_unknowns=())
    known = None if fmi == "2.0" else ["time", "m", "spring.c", "f", "s", "v"]  # none listed means all
    assert structure(told, fmi, "initialUnknowns") == {"der(v)": (known, None), "share": (known, None)}
    # what depends on a state that is itself found depends on all that is known
    known = None if fmi == "2.0" else ["time", "steps", "controller.held"]
    assert structure(relay(), fmi, "initialUnknowns") == {
        "friction.mode": (known, None),
        "v": (known, None),
        "der(v)": (known, None),
    }


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", ["oscillator", "relay"])
def test_casadi_reads_the_same_structure(name, fmi, tmp_path):
    told = DESCRIPTIONS[name]()
    (tmp_path / "modelDescription.xml").write_bytes(model_description(said(told, fmi)))
    found = ca.DaeBuilder("read", str(tmp_path))
    rates = [u.name for u in told.structure.derivatives]
    states = list(told.states)
    assert (found.x(), found.der(found.x())) == (states, rates)
    assert found.u() == [v.name for v in told.variables if v.causality == "input"]
    assert found.y() == list(told.outputs)
    assert [found.unit(state) for state in states] == [v.unit for v in told.variables if v.name in states]


@pytest.mark.parametrize("fmi", VERSIONS)
def test_held_values_are_known_in_fmi_3_only_and_integers_have_no_factors(fmi):
    held = ([], None) if fmi == "2.0" else (["controller.held"], None)
    assert structure(relay(), fmi, "outputs") == {"friction.mode": held}


@pytest.mark.parametrize("fmi", VERSIONS)
def test_event_indicators_and_states_that_events_may_set(fmi):
    root = etree.fromstring(model_description(said(relay(), fmi)))
    assert [e.get("name") or e.getparent().get("name") for e in root.iterfind(".//*[@reinit='true']")] == [
        "v"
    ]
    assert read(relay(), fmi).numberOfEventIndicators == 2
    if fmi == "3.0":
        assert [e.get("valueReference") for e in root.iterfind(".//EventIndicator")] == ["6", "4"]
    assert etree.fromstring(model_description(said(oscillator(), fmi))).find(".//*[@reinit]") is None


def flags(told: FmuDescription, fmi, tag: str) -> set[str]:
    found = etree.fromstring(model_description(said(told, fmi))).find(tag)
    return set() if found is None else {name for name, value in found.attrib.items() if value == "true"}


def test_capabilities():
    common = {"canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"}
    common |= {"canNotUseMemoryManagementFunctions"}
    steps = {"canHandleVariableCommunicationStepSize"}
    assert flags(oscillator(), "2.0", "CoSimulation") == common | steps
    assert flags(oscillator(), "2.0", "ModelExchange") == common | {"completedIntegratorStepNotNeeded"}
    common = {"canGetAndSetFMUState", "canSerializeFMUState"}
    common |= {"providesDirectionalDerivatives", "providesAdjointDerivatives"}
    assert flags(oscillator(), "3.0", "CoSimulation") == common | steps
    assert flags(oscillator(), "3.0", "ModelExchange") == common


@pytest.mark.parametrize("fmi", VERSIONS)
def test_only_the_interfaces_there_are(fmi):
    assert read(gain(), fmi).modelExchange is None
    assert read(relay(), fmi).coSimulation is None
    both = read(oscillator(), fmi)
    assert both.modelExchange.modelIdentifier == both.coSimulation.modelIdentifier == "Mechanics_Box"


def test_log_categories_are_those_of_the_runtime():
    header = (ROOT / "fmu/gantrytau_fmu/runtime/core.h").read_text()
    line = next(line for line in header.splitlines() if "#define GT_CATEGORY_NAMES" in line)
    assert re.findall(r'"(\w+)"', line) == list(LOG_CATEGORIES)
    assert [category.name for category in read(gain(), "3.0").logCategories] == list(LOG_CATEGORIES)


@given(st.text())
def test_any_description_makes_well_formed_xml(text):
    told = replace(oscillator(), description=text, author=text + "<&\"'>\x00\ud800\ufffe\nend")
    for fmi in VERSIONS:
        root = etree.fromstring(model_description(said(told, fmi)))
        assert (root.get("description") or "") == plain(text)
        assert root.get("author").endswith("<&\"'> end")


def test_build_description_names_the_one_unit_and_its_folders():
    text = build_description(oscillator(), ["fmu.c", "core.h", "model/tables.c"])
    assert etree.XMLSchema(file=str(SCHEMAS / "fmi3" / "fmi3BuildDescription.xsd")).validate(
        etree.fromstring(text)
    )
    built = read_build_description(fmu(oscillator(), "3.0", ["fmu.c", "model/tables.c"]))
    for configuration in built:
        (files,) = configuration.sourceFileSets
        assert configuration.modelIdentifier == "Mechanics_Box"
        assert (files.sourceFiles, files.includeDirectories) == (["fmu.c"], [".", "model"])
        assert files.language == "C99"
    libraries = {
        c.get("platform"): [e.get("name") for e in c.iterfind("Library")] for c in etree.fromstring(text)
    }
    assert libraries == {None: ["m"], "x86_64-windows": [], "aarch64-windows": []}


def test_fmi_2_lists_the_source_file_for_both_interfaces():
    text = model_description(said(oscillator(), "2.0", ["fmu.c", "core.h"]))
    files = [
        (e.getparent().getparent().tag, e.get("name")) for e in etree.fromstring(text).iterfind(".//File")
    ]
    assert files == [("ModelExchange", "fmu.c"), ("CoSimulation", "fmu.c")]
    assert b"SourceFiles" not in model_description(said(oscillator(), "2.0")) + model_description(
        said(oscillator(), "3.0", ["fmu.c"])
    )


def with_variable(place: int, **changes):
    def change(told: FmuDescription) -> FmuDescription:
        variables = list(told.variables)
        variables[place] = replace(variables[place], **changes)
        return replace(told, variables=tuple(variables))

    return change


def with_(**changes):
    return lambda told: replace(told, **changes)


def with_kind(**changes):
    return lambda told: replace(told, interfaces=(replace(told.interfaces[0], **changes),))


def with_lists(**changes):
    return lambda told: replace(told, structure=replace(told.structure, **changes))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_variable(3, name="m"), "'m' is there twice, as references 1 and 3"),
        (with_variable(3, name="φ"), "'φ' is no structured name"),
        (with_variable(3, name="der(der(s))"), "no structured name"),
        (with_variable(3, name=""), "'' is no structured name"),
        (with_variable(3, reference=9), "variable 'f': its value reference is 9, expected its place, 3"),
        (with_variable(3, start=None), "variable 'f': start is None"),
        (with_variable(3, start=np.nan), "variable 'f': start is nan"),
        (with_variable(3, start=61.0), "start 61.0 is outside min -60.0 and max 60.0"),
        (with_variable(3, min=70.0, start=100.0, max=60.0), "outside min 70.0"),
        (with_variable(7, min=2.0, max=1.0), "'share': min 2.0 is above max 1.0"),
        (with_variable(3, unit="lbf"), "variable 'f': unit 'lbf'"),
        (with_variable(4, nominal=0.0), "nominal is 0.0, expected a size above zero"),
        (with_variable(1, variability="continuous"), "a continuous parameter does not exist"),
        (with_variable(1, initial="calculated"), "initial is 'calculated'"),
        (with_variable(1, type="Int32"), "start is 2.5, expected a whole number of 32 bits"),
        (with_variable(1, type="Int32", start=2**31), "start is 2147483648"),
        (with_variable(7, type="Int32"), "'share': an integer cannot be continuous"),
        (with_variable(7, causality="local"), "'share': expected each output once"),
        (with_variable(7, derivative="m"), "'share' is the derivative of 'm', expected a continuous"),
        (with_variable(6, derivative=None), r"'der\(v\)' is listed as a derivative, but of no state"),
        (with_variable(6, derivative="s"), "state 's' has two derivatives"),
        (with_variable(7, causality="independent", initial=None, start=None), "found 2 independent"),
        (with_lists(outputs=()), "'s', 'share': expected each output once"),
        (with_lists(derivatives=(Unknown("v", ()),) * 2), "'v' stands twice in the list of derivatives"),
        (with_lists(derivatives=(Unknown("v", ("w",)),)), "unknown 'v': 'w': expected names of variables"),
        (with_lists(derivatives=(Unknown("v", ("s",), ()),)), "1 dependencies .* and 0 kinds"),
        (with_lists(derivatives=(Unknown("v", ("s", "s")),)), "each once"),
        (with_lists(derivatives=(Unknown("v", ("der(v)",)),)), r"'v' depends on 'der\(v\)', which is no"),
        (with_kind(identifier="a b"), "'a b' is no C name"),
        (with_(interfaces=()), "expected 'model-exchange', 'co-simulation' or both"),
        (with_kind(kind="scheduled-execution"), "expected 'model-exchange'"),
        (with_(experiment=DefaultExperiment(stop=np.inf)), "expected finite numbers"),
        (with_(experiment=DefaultExperiment(step=0.0)), "tolerance and step above zero"),
    ],
)
def test_what_no_fmu_can_say_is_refused(change, message):
    for fmi in VERSIONS:
        with pytest.raises(ModelError, match=message):
            model_description(said(change(oscillator()), fmi))


def test_indicators_and_terminals_are_variables():
    with pytest.raises(ModelError, match="event indicator 'm' is no continuous real variable"):
        model_description(with_lists(indicators=("m",))(oscillator()))
    with pytest.raises(ModelError, match=r"\['flange.s'\] refer to no variable"):
        model_description(with_(terminals=(FmuTerminal("flange", {"s": "nothing"}),))(oscillator()))


def test_the_version_and_time_are_asked_for():
    with pytest.raises(ModelError, match=r"found '2', expected '2\.0' or '3\.0'"):
        model_description(replace(oscillator(), fmi="2"))
    with pytest.raises(ModelError, match="found 0 independent variables"):
        model_description(replace(description(), variables=()))
