"""What the description of an exported FMU says of its model: the declarations of the model, and which slopes are zero."""

from dataclasses import asdict, fields, replace
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import read_model_description
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from gantrytau import Input, Model, Output, Parameter, Real, cos, der, sin, time, translate
from gantrytau.border.refusal import ModelError
from gantrytau_fmu import Build, export_fmu
from gantrytau_fmu.describing.model_description import model_description
from gantrytau_fmu.describing.model_structure import written_structure
from gantrytau_fmu.description import DefaultExperiment, FmuDescription
from gantrytau_fmu.reading.read_fmu import read_fmu
from gantrytau_models import Pendulum
from tests.fmu.exported import MODELS, Exported, Numbers
from tests.fmu.runtime.test_derivatives import at_random, columns, knowns_of, some_outputs, unknowns_of


class Motor(Model):
    """A component with an input and an output: a terminal."""

    slope = Parameter(25.0, unit="rad/(s.V)", description="speed per voltage")
    u = Input(unit="V", description="voltage", start=12.0, min=-48.0, max=48.0)
    w = Output(unit="rad/s", description="speed", nominal=300.0)

    def equations(self):
        yield self.w == self.slope * self.u


class Described(Model):
    """Declarations of every kind."""

    motor = Motor()
    T = Parameter(0.2, unit="s", description="time constant", min=0.01, max=10.0)
    twice = Parameter(lambda self: 2 * self.T, unit="s", description="twice the time constant")
    pace = Parameter(5.0, unit="1/s", description="of what is explicit in time")
    phi = Real(unit="rad", description="angle", start=0.3, fixed=True, nominal=6.0, min=-100.0)
    energy = Real(unit="J", description="energy", start=2.0, fixed=True, nominal=1e4)
    clock = Output(unit="1", description="explicit in time")
    both = Output(unit="rad.V", description="explicit in time, a state and an input")

    def equations(self):
        yield der(self.phi) == self.motor.w - self.phi / self.twice
        yield self.T * der(self.energy) == -self.energy
        yield self.clock == sin(self.pace * time)
        yield self.both == cos(self.pace * time) * self.phi * self.motor.u


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request, tmp_path_factory) -> Exported:
    build = Build(
        description="A <test> & more",
        author="A. Author",
        copyright="(c) A. Author",
        license="MIT",
        version="1.2",
        experiment=DefaultExperiment(start=0.5, stop=4.0, tolerance=1e-7, step=0.002),
    )
    path = tmp_path_factory.mktemp("described") / "described.fmu"
    dae = translate(Described())
    find = ["motor.w", "phi", "energy", "clock", "both"]
    export_fmu(dae, path, fmi="2.0" if request.param == 2 else "3.0", find=find, build=build)
    return Exported(path, dae, request.param)


def test_declarations_stand_in_the_description(fmu):
    wanted = {
        # name: causality, variability, initial, start, unit, min, max, nominal, description
        "time": ("independent", "continuous", None, None, "s", None, None, None, "time"),
        "T": ("parameter", "tunable", "exact", 0.2, "s", 0.01, 10.0, None, "time constant"),
        "twice": ("local", "tunable", "calculated", None, "s", None, None, None, "twice the time constant"),
        "motor.u": ("input", "continuous", "exact", 12.0, "V", -48.0, 48.0, None, "voltage"),
        "motor.w": ("output", "continuous", "calculated", None, "rad/s", None, None, 300.0, "speed"),
        "phi": ("output", "continuous", "exact", 0.3, "rad", -100.0, None, 6.0, "angle"),
        "energy": ("output", "continuous", "exact", 2.0, "J", None, None, 1e4, "energy"),
        "der(phi)": (
            *("local", "continuous", "calculated", None, "rad/s", None, None, None),
            "time derivative of phi",
        ),
        "clock": ("output", "continuous", "calculated", None, "1", None, None, None, "explicit in time"),
    }
    found = {v.name: v for v in fmu.described.modelVariables}
    for name, (causality, variability, initial, start, unit, low, high, nominal, words) in wanted.items():
        v = found[name]
        assert (v.causality, v.variability, v.initial) == (causality, variability, initial), name
        assert (v.unit or "1", v.description) == (unit, words), name
        numbers = [None if n is None else float(n) for n in (v.start, v.min, v.max, v.nominal)]
        assert numbers == [start, low, high, nominal], name


def test_units_and_types_are_declared(fmu):
    types = {v.name: v.declaredType for v in fmu.described.modelVariables}
    for name, quantity, unit, shown in (
        ("phi", "Angle", "rad", "deg"),
        ("energy", "Energy", "J", None),
        ("T", "Time", "s", None),
    ):
        found = types[name]
        assert (found.quantity, found.unit) == (quantity, unit), name
        assert shown is None or found.displayUnit == shown
    units = {u.name: u.baseUnit for u in fmu.described.unitDefinitions}
    assert (units["J"].kg, units["J"].m, units["J"].s) == (1, 2, -2)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_declared_display_units_come_with_the_model(fmi, tmp_path):
    class Turn(Model):
        """A shaft that is shown in turns."""

        k = Parameter("2 rpm", unit="rad/s", display="rpm", description="speed")
        phi = Real(unit="rad", display="rev", description="angle", start="90 deg", fixed=True)
        r = Real(2, unit="m", display="mm", description="place")

        def equations(self):
            yield der(self.phi) == self.k
            yield self.r[0] == 0
            yield self.r[1] == 0

    found = read_fmu(export_fmu(Turn(), tmp_path / "turn.fmu", fmi=fmi)).by_name
    assert {n: found[n].display for n in ("k", "phi", "der(phi)", "r[0]", "r[1]", "time")} == {
        "k": "rpm", "phi": "rev", "der(phi)": "rev/s", "r[0]": "mm", "r[1]": "mm", "time": "",
    }  # fmt: skip
    assert found["phi"].start == np.pi / 2  # in SI


def test_head_experiment_and_words_of_the_caller(fmu):
    told = fmu.described
    assert (told.description, told.author, told.copyright) == (
        "A <test> & more",
        "A. Author",
        "(c) A. Author",
    )
    assert (told.license, told.version, told.modelName) == ("MIT", "1.2", "Described")
    e = told.defaultExperiment
    found = [float(text) for text in (e.startTime, e.stopTime, e.tolerance, e.stepSize)]
    assert found == list(asdict(DefaultExperiment(0.5, 4.0, 1e-7, 0.002)).values())
    told = [category.name for category in told.logCategories]
    assert told == ["logEvents", "logCalls", "logStatusWarning", "logStatusError"]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(
    "name", ["described", "compiled", "four-bar", "pendulum", "filter", "sampled", "stick-slip"]
)
def test_what_is_written_is_read_back_as_the_same_record(name, fmi, tmp_path, monkeypatch):
    written: list[FmuDescription] = []

    def spy(fmu):
        written.append(fmu)
        return model_description(fmu)

    monkeypatch.setattr("gantrytau_fmu.export.model_description", spy)
    model = MODELS.get(name, Described)()
    platforms = ("native",) if name == "compiled" else ()
    found: Any = read_fmu(
        export_fmu(
            model, tmp_path / "model.fmu", fmi=fmi, build=Build(platforms=platforms, author="A. Author")
        )
    )
    (told,) = written
    # no file tells a variable without dimension from one without unit
    told = replace(
        told, variables=tuple(replace(v, unit="" if v.unit == "1" else v.unit) for v in told.variables)
    )
    told = replace(told, structure=written_structure(told))  # parameters are no knowns of FMI 2
    for field in fields(FmuDescription):
        if field.name != "interfaces":
            assert getattr(found, field.name) == getattr(told, field.name), field.name
    for ours, theirs in zip(told.interfaces, found.interfaces, strict=True):
        assert replace(theirs, capabilities=ours.capabilities) == ours
        assert ours.capabilities.items() <= theirs.capabilities.items()
    assert (found.inputs, found.outputs, found.states) == (told.inputs, told.outputs, told.states)


def test_files_of_the_archive(fmu):
    with ZipFile(fmu.path) as archive:
        names = set(archive.namelist())
        page, entry = (archive.read(f"documentation/{n}") for n in ("index.html", "licenses/license.txt"))
    assert b"time constant" in page
    assert b"MIT" in entry
    assert {
        "documentation/licenses/gantrytau.txt",
        "sources/fmu.c",
        "sources/core.h",
        "sources/model.c",
    } <= names
    terminals = {f"terminalsAndIcons/{n}" for n in ("terminalsAndIcons.xml", "icon.png", "icon.svg")}
    own = {"model.png"} if fmu.version == 2 else {*terminals, "sources/buildDescription.xml"}
    assert own <= names
    assert sum(n.startswith("binaries/") for n in names) == 1


def test_components_with_inputs_are_terminals(fmu):
    if fmu.version == 2:
        pytest.skip("terminals are of FMI 3")
    root = etree.parse(fmu.folder / "terminalsAndIcons" / "terminalsAndIcons.xml")
    found = {
        t.get("name"): {m.get("memberName"): m.get("variableName") for m in t}
        for t in root.iterfind(".//Terminal")
    }
    assert found == {"motor": {"u": "motor.u", "w": "motor.w"}}


def dependencies(fmu: Exported, which: str) -> dict[str, set[str]]:
    return {u.variable.name: {v.name for v in u.dependencies} for u in getattr(fmu.described, which)}


def test_dependencies_of_a_small_model_one_by_one(fmu):
    parameters = {"T", "motor.slope", "pace"} if fmu.version == 3 else set()  # known to FMI 3 only
    assert dependencies(fmu, "outputs") == {
        "motor.w": {"motor.u"} | parameters & {"motor.slope"},
        "phi": {"phi"},
        "energy": {"energy"},
        "clock": {"time"} | parameters & {"pace"},
        "both": {"time", "phi", "motor.u"} | parameters & {"pace"},
    }
    assert dependencies(fmu, "derivatives") == {
        "der(phi)": {"phi", "motor.u"} | parameters & {"T", "motor.slope"},
        "der(energy)": {"energy"} | parameters & {"T"},
    }
    initial = {k: v for k, v in dependencies(fmu, "initialUnknowns").items() if k.startswith(("der", "both"))}
    assert initial == {
        "both": {"time", "pace", "phi", "motor.u"},
        "der(phi)": {"phi", "motor.slope", "motor.u", "T"},
        "der(energy)": {"energy", "T"},
    }


@pytest.mark.parametrize("name", ["three-link", "six-link", "pendulum", "filter"])
def test_dependencies_are_exactly_the_slopes_that_are_not_zero(name, exported):
    fmu = exported(name)
    outputs = some_outputs(fmu)
    unknown, truth = unknowns_of(fmu, outputs), Numbers(fmu.dae)
    known = knowns_of(fmu)
    random, slopes = np.random.default_rng(3), 0.0
    with fmu.new("ModelExchange") as run:
        run.begin()
        run.settle()
        for _ in range(3):
            at_random(run, truth, random)
            slopes = slopes + np.abs(columns(run, unknown, known))
    sizes = np.max(slopes, axis=1, keepdims=True)
    rows = slopes > 1e-12 * sizes  # what rounding leaves of a slope that is zero
    listed = {
        u.variable.valueReference: {v.valueReference for v in u.dependencies}
        for u in (*fmu.described.outputs, *fmu.described.derivatives)
    }
    found = [{k for k, there in zip(known, row, strict=True) if there} for row in rows]
    parameters = set(known[1 + truth.x.size + truth.u.size :])
    assert [row - parameters for row in found] == [listed[u] - parameters for u in unknown]
    assert all(
        row <= listed[u] for row, u in zip(found, unknown, strict=True)
    )  # a mass may cancel in numbers only


def test_a_filter_at_rest_follows_its_input_from_the_first_instant(exported):
    """What initial equations determine depends on all that they hold; states that they determine are no knowns."""
    found = dependencies(exported("filter"), "initialUnknowns")
    assert set(found) == {"y", "der(y)", "der(y,1)", "der(y,2)", "der(y,02)", "der(y,3)"}
    for known in found.values():
        assert "u" in known
        assert not known & set(found)


def test_friction_that_sticks_shows_its_mode_and_an_event_indicator(exported):
    fmu = exported("stick-slip")
    variables = {v.name: v for v in fmu.described.modelVariables}
    assert fmu.described.numberOfEventIndicators == 3
    assert variables["carts[1].law.mode"].type == "Int32"
    assert "0 sticks" in variables["carts[1].law.mode"].description
    root = etree.parse(fmu.folder / "modelDescription.xml")
    indicators = [int(e.get("valueReference")) for e in root.iterfind(".//EventIndicator")]
    assert indicators == [variables[f"carts[{k}].law.indicator"].valueReference for k in range(3)]


def test_choices_of_the_caller(tmp_path):
    """interfaces, solver, sources, find, states: each shows in the file."""
    path = tmp_path / "chosen.fmu"
    options: dict[str, Any] = dict(
        solver="rodas4", build=Build(sources=False), find=["v_x", "tension"], states=["x", "v_x"]
    )
    export_fmu(Pendulum(), path, interfaces="model-exchange", **options)
    told: Any = read_model_description(path)
    assert (told.coSimulation, told.modelExchange.modelIdentifier) == (None, "Pendulum")
    assert [u.variable.derivative.name for u in told.derivatives] == ["x", "v_x"]
    assert [v.name for v in told.modelVariables if v.causality == "output"] == ["v_x", "tension"]
    with ZipFile(path) as archive:
        assert not [n for n in archive.namelist() if n.startswith("sources/")]
    export_fmu(Pendulum(), path, interfaces=["co-simulation"], solver="rodas4")
    assert read_model_description(path).modelExchange is None
    with ZipFile(path) as archive:
        names = archive.namelist()
        assert b"Rodas4" in archive.read("documentation/index.html")
    assert "sources/rodas4.c" in names
    assert "sources/dopri5.c" not in names


def test_declared_outputs_are_the_outputs_and_all_else_is_local(tmp_path):
    told: Any = read_model_description(export_fmu(Described(), tmp_path / "default.fmu"))
    kinds = {v.name: v.causality for v in told.modelVariables}
    assert [n for n, kind in kinds.items() if kind == "output"] == ["clock", "both"]
    assert [kinds[n] for n in ("motor.w", "phi", "energy", "der(phi)")] == ["local"] * 4
    assert told.description == "Declarations of every kind"


@pytest.mark.parametrize(("name", "kind"), [("motor.u", "an input"), ("T", "a parameter")])
def test_what_is_known_is_no_output(tmp_path, name, kind):
    with pytest.raises(
        ModelError, match=f"export_fmu: find: {name} is {kind} of this FMU, expected variables"
    ):
        export_fmu(Described(), tmp_path / "wrong.fmu", find=[name])
    assert not list(tmp_path.iterdir())
