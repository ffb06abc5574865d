"""`describe` and `repr` of models, classes, declarations: what newcomers see first, and what must not break it."""

import pydoc
from typing import Any

import numpy as np
import pytest

from gantrytau import (
    Array,
    Bounds,
    Connector,
    Discrete,
    Fixed,
    Flow,
    Mode,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    describe,
    outer,
    translate,
)
from gantrytau.mechanics.multibody import Body, Frame, Revolute, World
from gantrytau_models import GantryTau, prototypes


class Cart(Model):
    """Ein Wägelchen: x < y & "z". A further sentence that stays away."""

    order = 2
    m = Parameter(1.5, unit="kg", description="mass of cart, <b>bold</b>", min=0.0)
    J = Parameter(np.diag([1.0, 2.0, 3.0]), unit="kg.m2", description="inertia")
    twice = Parameter(2 * m, unit="kg", description="twice the mass")
    squared = Parameter(lambda self: self.m**2, unit="kg2", description="its square")
    unknown = Parameter(float("nan"), unit="K", description="temperature that nobody measured")
    given = Parameter(unit="m", description="length that whoever uses it says")
    longer = Parameter(1 + given, unit="m", description="longer by one")
    s = Real(unit="m", start=twice, description="place", max=squared)
    k = Discrete(3, description="count")
    mode = Mode("free", "contact", start="contact")

    def equations(self):
        yield self.s == self.m


class Heavy(Cart):
    """A cart of lead."""

    m = Parameter(10.0, unit="kg", description="mass of lead")


class Plant(Model):
    """Two hundred carts."""

    m = Parameter(3.0, unit="kg", description="mass of each")
    carts = Array(Cart, 200, m=m + 1)
    heavy = Heavy(s=Start(0.25))
    world = outer(World)


class Weight(Model):
    """Numbers that follow from others."""

    m = Parameter(1.5, unit="kg", description="mass")
    twice = Parameter(2 * m, unit="kg", description="twice the mass")
    squared = Parameter(lambda self: self.m**2, unit="kg2", description="its square")


class Row(Model):
    """Weights whose masses follow from one number."""

    m = Parameter(3.0, unit="kg", description="mass less one")
    weights = Array(Weight, 3, m=m + 1)


class Needy(Model):
    """Made of something."""

    x = Real((2, 2), unit="m", start=np.eye(2), description="corners")

    def __init__(self, something: float):
        super().__init__(x=Start(something * np.eye(2)))


def rows(description: Any, heading: str) -> dict[str, dict[str, str]]:
    return {row["name"]: row for row in description.as_mapping()[heading]}


def test_a_joint_is_told_by_its_declarations():
    said = describe(Revolute)
    assert said.summary.startswith("A joint that turns about an axis fixed in both frames")
    assert rows(said, "Parameters")["n[3]"]["value"] == "[0.0, 0.0, 1.0]"
    assert list(rows(said, "Variables")["phi"].values()) == [
        "phi",
        "deg",
        "angle from frame_a to frame_b about n",
    ]
    connectors = {name: row["class"] for name, row in rows(said, "Connectors").items()}
    assert connectors == dict(frame_a="Frame", frame_b="Frame", axis="Flange", support="Flange")
    assert dict(said.facts)["inherits"] == "TwoFrames (frame_a, frame_b)"
    assert set(rows(describe(Frame), "Passed along")) == {"R[3, 3]", "w[3]"}


def test_values_of_an_instance_are_those_that_the_compiler_finds():
    row = Row(m=5.0)
    told = rows(describe(row, "weights[2]"), "Parameters")
    flat = translate(row).parameter_values
    for name in ("m", "twice", "squared"):
        assert float(told[name]["value"]) == flat[f"weights[2].{name}"]
    assert flat["weights[2].squared"] == 36.0


def test_starts_and_limits_are_computed_from_parameters():
    start = rows(describe(Cart(m=4.0)), "Variables")["s"]
    assert start["start"] == "8.0"
    assert start["description"] == "place; at most 16.0"
    assert rows(describe(Plant(), "heavy"), "Variables")["s"]["start"] == "0.25"
    assert rows(describe(Cart(s=Fixed(1.0))), "Variables")["s"]["start"] == "1.0 (fixed)"
    assert "at least -1" in rows(describe(Cart(s=Bounds(-1, 1))), "Variables")["s"]["description"]
    assert rows(describe(Cart(s=0.5)), "Variables")["s"]["start"] == "== 0.5"  # an equation


def test_what_has_no_number_says_so():
    told = rows(describe(Cart), "Parameters")
    assert told["unknown"]["value"] == "nan"
    assert told["given"]["value"] == "(to be given)"
    assert told["longer"]["value"] == "= 1 + given"
    assert rows(describe(Cart(given=2.0)), "Parameters")["longer"]["value"] == "3.0"


def test_modes_counts_settings_and_matrices():
    said = describe(Cart)
    assert rows(said, "Discrete variables")["mode"]["start"] == "contact"
    assert rows(said, "Discrete variables")["k"]["start"] == "3"
    assert rows(said, "Settings")["order"]["value"] == "2"
    assert rows(describe(Cart(order=3)), "Settings")["order"]["value"] == "3"
    assert rows(said, "Parameters")["J[3, 3]"]["value"].startswith("[[1.0, 0.0, 0.0], [0.0, 2.0")


def test_a_declaration_that_replaces_another_is_told():
    said = describe(Heavy)
    assert dict(said.facts)["replaces of Cart"] == "m"
    assert "(J, twice" in dict(said.facts)["inherits"]
    assert rows(said, "Parameters")["m"]["value"] == "10.0"
    assert rows(said, "Parameters")["twice"]["value"] == "20.0"
    assert describe(Heavy, "m").kind == "Parameter of Heavy"


def test_large_models_are_short():
    assert len(str(describe(Plant())).splitlines()) < 15
    listed = describe(Plant(), "carts")
    assert "... and 160 more" in str(listed)
    assert len(str(listed).splitlines()) < 50
    assert len(listed.as_mapping()["Components"]) == 200
    assert "... and 160 more" in listed.html()
    assert len(repr(GantryTau(prototypes.L1))) < 400


def test_a_class_that_needs_arguments_is_told_all_the_same():
    assert rows(describe(Needy), "Variables")["x[2, 2]"]["start"] == "[[1.0, 0.0], [0.0, 1.0]]"
    assert rows(describe(Needy(3.0)), "Variables")["x[2, 2]"]["start"] == "[[3.0, 0.0], [0.0, 3.0]]"


def test_parts_are_found_by_their_dotted_names():
    robot = GantryTau(prototypes.L1)
    assert describe(robot, "tool.r").summary == "position, resolved in the world"
    assert describe(robot, "carts[1]").title == "carts[1]"
    assert "value: 4.0" in _attributes(describe(Plant, "carts[3].m"))
    assert "the World around it" in describe(Plant, "world").kind
    assert describe(Cart, "equations").kind.startswith("function")


def _attributes(description: Any) -> str:
    return "; ".join(f"{row['name']}: {row['value']}" for row in description.as_mapping()["Attributes"])


NO_NAMES: dict[Any, str] = {
    "cart": "Plant has no 'cart'; did you mean 'carts'?",
    "carts[200]": "found carts[200], expected an index from 0 to 199, as carts[0]",
    "carts[-1]": "expected an index from 0 to 199",
    "carts[x]": "expected an index from 0 to 199",
    "carts[0].n": "carts[0] has no 'n'; there is m, J",
    "m.x": "m is a Parameter, which has no parts; ask for 'm'",
    ".": "Plant has no ''",
}


@pytest.mark.parametrize("name", NO_NAMES)
def test_names_that_are_not_there_are_refused(name):
    for plant in (Plant, Plant()):
        with pytest.raises(ModelError) as error:
            describe(plant, name)
        assert NO_NAMES[name] in str(error.value)
        assert error.value.argument == "name"


def test_a_text_is_no_model():
    with pytest.raises(ModelError, match=r"the text 'Revolute', expected a model.*describe\(Revolute\)"):
        describe("Revolute")


def test_html_is_escaped():
    page = describe(Cart)._repr_html_()
    assert "&lt;b&gt;bold&lt;/b&gt;" in page
    assert "<b>" not in page
    assert "Wägelchen: x &lt; y &amp;" in page
    assert "further sentence" not in page
    assert Cart()._repr_html_().count("<table>") == page.count("<table>")


def test_declarations_read_as_they_are_written():
    class Port(Connector):
        e = Real(unit="V", start=0.0, description="potential")
        i = Flow(unit="A", description="current")

    members: Any = Port.members()
    assert repr(members["e"]) == "Real(unit='V', start=0.0, description='potential')"
    assert repr(members["i"]) == "Flow(unit='A', description='current')"
    assert repr(Real(3, unit="m", min=-1.0)) == "Real(3, unit='m', min=-1.0)"
    assert repr(Real(lambda self: self.n)) == "Real()"
    assert repr(Parameter([0.0, 1.0], unit="m")) == "Parameter([0.0, 1.0], unit='m')"
    assert repr(Parameter(np.zeros((20, 20)))) == "Parameter((20, 20) array, all 0)"
    assert repr(Cart.twice) == "Parameter(mul(2, m), unit='kg', description='twice the mass')"
    assert repr(Cart.mode).startswith("Mode('free', 'contact', start='contact'")
    assert repr(Discrete(2)) == "Discrete(2)"
    assert repr(Plant.carts) == "Array(Cart, 200)"


def test_help_reads():
    text = pydoc.plain(pydoc.render_doc(Revolute))
    assert "phi = Real(unit='rad', description='angle from frame_a" in text
    assert "n = Parameter([0.0, 0.0, 1.0], unit='1'" in text
    assert "object>" not in text


def test_instances_read_as_they_are_made():
    assert repr(Cart(m=2.0, s=Start(0.5))) == "Cart(m=2.0, s=Start(0.5))"
    assert repr(Cart()) == "Cart()"
    assert repr(Body(J=np.ones((3, 3)) * 2.5)).startswith("Body(J=[[2.5,")
    assert repr(Cart(s=Bounds(-1, 1))) == "Cart(s=Bounds(-1, 1))"
    assert repr(Cart.open()) == "Cart()"
    assert repr(Cart.__new__(Cart)) == "Cart()"  # while it is made


def test_values_with_units_are_brought_to_those_in_which_they_are_shown():
    class Arm(Model):
        L = Parameter("700 mm", unit="m", display="mm", description="length", min="1 cm")
        twice = Parameter(2 * L, unit="m", description="twice the length")
        phi = Real(unit="rad", display="deg", start=np.pi / 2, description="angle")
        place = Parameter(["1 m", "20 cm"], unit="m", shape=2, description="place")
        wrong = Parameter("2 kg", unit="m", description="what the compiler refuses")

    said = rows(describe(Arm), "Parameters")
    assert (said["L"]["value"], said["L"]["unit"]) == ("700.0", "mm")
    assert said["L"]["description"] == "length; at least 10.0"
    assert (said["twice"]["value"], said["twice"]["unit"]) == ("1.4", "m")
    assert said["place[2]"]["value"] == "[1.0, 0.2]"
    assert said["wrong"]["value"] == "'2 kg'"
    assert list(rows(describe(Arm), "Variables")["phi"].values()) == ["phi", "90.0", "deg", "angle"]
    assert rows(describe(Arm(L="2 m")), "Parameters")["L"]["value"] == "2000.0"
    assert "value: 2000.0" in _attributes(describe(Arm(L="2 m"), "L"))
