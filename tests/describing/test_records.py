"""What records and results print of themselves, in a line and in notebooks: short, escaped, and no raw arrays."""

import dataclasses
import importlib
import re
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    GantryTauError,
    LinearSystem,
    Model,
    Parameter,
    Real,
    Result,
    StateSpace,
    der,
    describe,
    extract_mechanism,
    linearize,
    simulate,
    study,
    translate,
)
from gantrytau.describing.record import Record
from gantrytau.describing.short_values import array_words, cut, short
from gantrytau.kinematics import Kinematics, accuracy
from gantrytau_models import GantryTau, Pendulum, prototypes

LONGEST = 420  # letters of a record in a line
PACKAGES = ("gantrytau", "gantrytau.kinematics", "gantrytau_models", "gantrytau_optimica", "gantrytau_fmu")


@dataclass(frozen=True, eq=False)
class Found(Record):
    """What was found in a search. More of it.

    place: where, (3,) in m; errors: of all, (N,) in m; names, words: what they are called, and more.
    """

    place: np.ndarray
    errors: np.ndarray
    names: tuple[str, ...] = ()
    words: Any = None


@dataclass(frozen=True)
class Small(Record):
    """A pair."""

    a: float
    b: str = "x"


def test_a_small_record_reads_as_it_always_did():
    @dataclass(frozen=True)
    class Plain:
        a: float
        b: str = "x"

    assert repr(Small(0.1)) == repr(Plain(0.1)).rpartition("<locals>.")[2].replace("Plain", "Small")


def test_arrays_are_told_by_shape_and_range():
    errors = np.linspace(-1.0, 2.0, 30)
    errors[4] = np.nan
    found = Found(np.array([1.0, 2.0, 3.5]), errors)
    errors = "(30,) array, -1 to 2, 1 not finite"
    assert repr(found) == f"Found(place=[1.0, 2.0, 3.5], errors={errors}, names=(), words=None)"


def test_large_records_stay_in_a_line():
    names, words = tuple(f"name {k}" for k in range(5000)), {f"key {k}": np.zeros(1000) for k in range(300)}
    found = Found(np.zeros((50, 50)), np.full(9, np.inf), names, words)
    assert len(repr(found)) < LONGEST
    assert "of 5000" in repr(found)
    assert "\n" not in repr(found)
    assert len(found._repr_html_()) < 3000


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.zeros((0, 3)), "(0, 3) array"),
        (np.array([True] * 9), "(9,) array, 9 true"),
        (np.array(["a"] * 9), "(9,) array"),
        (np.array([1j] * 9), "(9,) array of complex numbers"),
        (np.full((9,), np.nan), "(9,) array, 9 not finite"),
        (np.float64(0.1) + np.float64(0.2), "0.3"),
        (np.array(2.5), "2.5"),
        (float("nan"), "nan"),
        (float("inf"), "inf"),
        (True, "True"),
        ([], "[]"),
        ((1,), "(1,)"),
        ({}, "{}"),
        ("", "''"),
        (ca.SX.sym("x", 3, 3), "SX(3, 3)"),
        (ca.DM([1.0, 2.0]), "[[1.0], [2.0]]"),
        (object(), "<object>"),
        (Small, "Small"),
        (len, "len"),
    ],
)
def test_values_in_a_few_words(value, words):
    assert short(value) == words


def test_words_are_cut_in_one_line():
    assert cut("a\n  b" * 40, 12) == "a ba ba b..."
    assert len(short("x" * 1000)) <= 60
    assert array_words(np.eye(3)).startswith("[[1.0, 0.0, 0.0]")


def test_fields_of_a_record_have_the_words_of_its_documentation():
    said = describe(Found(np.zeros(3), np.zeros(30)))
    told = {row["name"]: row["description"] for row in said.as_mapping()["Fields"]}
    assert told["place"] == "where, (3,) in m"
    assert told["names"] == told["words"] == "what they are called, and more"
    assert said.summary == "What was found in a search."
    assert "Found" in str(describe(Found))
    with pytest.raises(GantryTauError, match="has no 'plac'; did you mean 'place'"):
        describe(Found(np.zeros(3), np.zeros(30)), "plac")
    assert describe(Found(np.zeros(3), np.zeros(30)), "place").text == "[0.0, 0.0, 0.0]"


def test_words_of_others_are_escaped():
    page = Found(np.zeros(3), np.zeros(3), ("<script>alert(1)</script>",))._repr_html_()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def _public_records() -> list[type]:
    found = {
        value
        for name in PACKAGES
        for value in vars(importlib.import_module(name)).values()
        if isinstance(value, type) and dataclasses.is_dataclass(value)
    }
    return sorted(found, key=lambda cls: cls.__qualname__)


@pytest.mark.parametrize("cls", _public_records(), ids=lambda cls: cls.__name__)
def test_public_records_with_more_than_numbers_and_names_are_shown_in_short(cls):
    simple = re.compile(r"^(<class ')?(str|int|float|bool|None|\s|\||'>)+$")
    if all(simple.match(str(field.type)) for field in dataclasses.fields(cls)):
        return
    own = not hasattr(cls.__repr__, "__wrapped__")  # what `dataclass` writes prints whole arrays
    assert own, f"{cls.__name__} has the repr of a dataclass; let it inherit from Record"
    assert hasattr(cls, "_repr_html_") or cls.__module__.startswith(("gantrytau.inputs", "gantrytau.border"))


@pytest.fixture(scope="module")
def robot():
    return translate(GantryTau(prototypes.L1))


@pytest.fixture(scope="module")
def swing():
    return simulate(Pendulum(), stop=1.0)


def test_answers_about_a_robot_are_short(robot):
    places = [[0.5, 3.0, -0.6], [0.6, 3.0, -0.6]]
    kinematics = Kinematics(robot)
    forces = [f"carts[{k}].f" for k in range(3)]
    joints = [f"carts[{k}].s" for k in range(3)]
    answers = [
        robot,
        robot.diagnosis,
        linearize(robot),
        linearize(robot).discrete(0.004),
        StateSpace(np.zeros((2, 2)), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros((1, 1))),
        extract_mechanism(GantryTau(prototypes.L1), tool="tool.r", joints=joints, forces=forces),
        kinematics,
        kinematics.home,
        accuracy(kinematics, places, semi_axes=np.full((3, 3), 1e-5)),
    ]
    for answer in answers:
        assert len(repr(answer)) < LONGEST, type(answer)
        assert "array(" not in repr(answer)
        page: Any = answer
        assert 100 < len(page._repr_html_()) < 20_000, type(answer)
        assert str(describe(answer))


def test_linear_systems_say_their_sizes(robot):
    found = linearize(robot)
    assert isinstance(found, LinearSystem)
    assert f"{len(found.states)} states, {len(found.inputs)} inputs" in repr(found)
    assert "each 0.004 s" in repr(found.discrete(0.004))


def test_a_translated_model_is_told_by_name_value_and_unit(robot):
    said = describe(robot)
    assert dict(said.facts)["inputs"] == "carts[0].f, carts[1].f, carts[2].f"
    parameters = {row["name"]: row for row in said.as_mapping()["Parameters"]}
    assert parameters["plate_mass"]["value"] == f"{robot.parameter_values['plate_mass']:.6g}"
    assert parameters["plate_mass"]["unit"] == "kg"
    variables = {row["name"]: row for row in said.as_mapping()["Variables"]}
    point = robot.evaluate()
    told = np.array(eval(variables["tool.r[3]"]["start"]))
    assert told == pytest.approx(point["tool.r"], abs=1e-5)  # six digits of places of a few metres
    assert float(variables["carts[1].s"]["start"]) == pytest.approx(point["carts[1].s"], abs=1e-5)
    one = describe(robot, "carts[1].s")
    assert dict(one.facts)["unit"] == "m"
    assert dict(describe(robot, "der(carts[1].s)").facts)["derivative of"] == "carts[1].s"
    with pytest.raises(GantryTauError, match="carts"):
        describe(robot, "carts[1].x")


def test_a_result_is_told_by_its_ends(swing):
    said = describe(swing)
    rows = {row["name"]: row for row in said.as_mapping()["Variables"]}
    assert float(rows["x"]["at the start"]) == pytest.approx(0.8)
    assert float(rows["x"]["at the end"]) == pytest.approx(swing.final("x"), abs=1e-8)
    assert rows["tension"]["unit"] == "N/m"
    assert not any(name.startswith("der(") for name in rows)
    facts = dict(describe(swing, "y").facts)
    assert facts["unit"] == "m"
    assert float(facts["least"].split()[0]) == pytest.approx(swing["y"].min(), rel=1e-5)
    assert "<table>" in swing._repr_html_()
    with pytest.raises(GantryTauError, match="has no variable 'z'"):
        describe(swing, "z")


def test_results_with_gaps_modes_and_one_time_are_told():
    lost = Result([0.0, 1.0], {"x": [np.nan, np.nan], "y": [1.0, np.nan], "<b>": [0, 1]}, title="<i>")
    assert dict(describe(lost, "x").facts)["not finite"] == "at 2 of 2 times"
    assert dict(describe(lost, "y").facts)["least"] == "1 at 0.0 s"
    assert "<b>" not in lost._repr_html_()
    assert "<i>" not in lost._repr_html_()
    once = Result([0.0], {"mode": [1.0]}, modes={"mode": ("free", "contact")})
    (row,) = describe(once).as_mapping()["Variables"]
    assert row["at the end"] == "contact"
    assert "nothing" not in str(describe(Result([0.0], {})))


class Turning(Model):
    """A shaft that turns on."""

    w = Parameter(np.pi, unit="rad/s", display="rpm", description="speed")
    phi = Real(unit="rad", display="deg", start=np.pi / 2, fixed=True, description="angle")

    def equations(self):
        yield der(self.phi) == self.w


def test_translated_models_and_results_are_told_in_units_of_their_declarations():
    dae = translate(Turning())
    for said, column in ((describe(dae), "start"), (describe(simulate(dae, stop=1.0)), "at the start")):
        (row,) = (row for row in said.as_mapping()["Variables"] if row["name"] == "phi")
        assert (float(row[column]), row["unit"]) == (pytest.approx(90.0), "deg")
    (speed,) = describe(dae).as_mapping()["Parameters"]
    assert (float(speed["value"]), speed["unit"]) == (pytest.approx(30.0), "rpm")
    assert dict(describe(dae, "phi").facts)["start"] == "90.0"
    assert dict(describe(simulate(dae, stop=1.0), "phi").facts)["greatest"] == "270 deg at 1.0 s"


class Growth(Model):
    """x' = x."""

    k = Parameter(1.0, unit="1/s", description="rate")
    x = Real(start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.k * self.x


def test_a_study_and_its_cases_are_short():
    found = study(Growth(), over={"k": [1.0, 2.0]}, stop=0.1)
    assert len(repr(found)) < LONGEST
    assert "2 cases" in found._repr_html_()
    assert len(repr(found.cases[0])) < LONGEST


def test_prototypes_have_units_and_descriptions():
    rows = {row["name"]: list(row.values()) for row in describe(prototypes.L1).as_mapping()["Fields"]}
    assert rows["plate_mass"] == [
        "plate_mass",
        str(prototypes.L1.plate_mass),
        "kg",
        "mass of the plate and tool",
    ]
    assert len(repr(prototypes.L1)) < LONGEST
