"""One more value for a model: where it goes, what stays as it was, and what cannot be set."""

import re

import numpy as np
import pytest

from gantrytau import Array, Bounds, Model, ModelError, Parameter, Real, Start, der, flatten, with_setting
from gantrytau_models import GantryTau, Pendulum, prototypes


class Bucket(Model):
    """Drains with a rate of its own."""

    order = 2
    rate = Parameter(1.0, unit="1/s", description="rate")
    gain = Parameter([1.0, 2.0], unit="1", description="gains")
    x = Real(unit="1", start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == -self.rate * self.x


class Fast(Bucket):
    """The same with a parameter more."""

    extra = Parameter(5.0, unit="1")


class Row(Model):
    """Buckets in several positions."""

    base = Parameter(3.0, unit="1/s")
    first = Bucket(rate=2 * base)
    second = Fast(rate=4.0)
    line = Array(Bucket, [dict(rate=1.0), dict(rate=2.0)])

    def equations(self):
        yield from ()


def values(model):
    """Scalar parameter -> its text."""
    return {n: str(v) for p in flatten(model).parameters for n, v in zip(p.elements, p.value, strict=True)}


def starts(model, name):
    found = flatten(model).find(name)
    assert found is not None
    assert found.start is not None
    return [float(x) for x in found.start], found.fixed


def change(model, name, value):
    """What setting a name changes among the parameters."""
    before, after = values(model), values(with_setting(model, name, value))
    assert before.keys() == after.keys()
    return {key: float(text) for key, text in after.items() if text != before[key]}


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("base", ["base"]),
        ("first.rate", ["first.rate"]),
        ("second.extra", ["second.extra"]),
        ("line[1].rate", ["line[1].rate"]),
        ("line.rate", ["line[0].rate", "line[1].rate"]),
    ],
)
def test_a_value_goes_where_its_name_says_and_nowhere_else(name, changed):
    assert change(Row(), name, 7.0) == dict.fromkeys(changed, 7.0)


def test_what_was_modified_or_redeclared_before_stays():
    row = Row(second=Fast(rate=6.0), line=[dict(rate=8.0), Fast(rate=9.0)], first=dict(rate=5.0))
    assert change(row, "second.extra", 7.0) == {"second.extra": 7.0}
    assert change(row, "line[1].extra", 7.0) == {"line[1].extra": 7.0}
    assert change(row, "line[0].rate", 7.0) == {"line[0].rate": 7.0}
    assert change(Row(line=Array(Fast, 2, rate=3.0)), "line[1].extra", 7.0) == {"line[1].extra": 7.0}
    redeclared = Row(line=Array(Fast, 2, rate=3.0))
    assert change(redeclared, "line.extra", 7.0) == {"line[0].extra": 7.0, "line[1].extra": 7.0}


def test_a_component_redeclared_in_a_class_body_stays():
    class Outside(Model):
        inside = Row(second=Fast(rate=6.0), line=[Fast(), Fast()])

    assert change(Outside(), "inside.second.extra", 7.0) == {"inside.second.extra": 7.0}
    assert change(Outside(), "inside.line[0].extra", 7.0) == {"inside.line[0].extra": 7.0}


def test_the_model_given_is_left_alone():
    model = Row(first=dict(rate=5.0))
    before = values(model)
    with_setting(model, "first.rate", 7.0)
    with_setting(model, "line.rate", 7.0)
    assert values(model) == before


def test_the_friction_law_of_a_cart_keeps_its_other_numbers():
    robot = GantryTau(prototypes.L1)
    assert change(robot, "carts[0].law.f_c", 321.0) == {"carts[0].law.f_c": 321.0}
    assert change(robot, "carts[2].m", 12.0) == {"carts[2].m": 12.0}


def test_vectors_starts_and_settings():
    robot = with_setting(GantryTau(prototypes.L1), "tool.r.start", [0.5, 3.0, -0.6])
    assert starts(robot, "tool.r") == ([0.5, 3.0, -0.6], False)
    assert change(Row(), "first.gain", [3.0, 4.0]) == {"first.gain[0]": 3.0, "first.gain[1]": 4.0}
    pendulum = with_setting(with_setting(Pendulum(), "x.start", 0.6), "x.fixed", True)
    assert starts(pendulum, "x") == ([0.6], True)
    assert with_setting(Bucket(), "order", 3).modifications["order"] == 3


def test_other_attributes_stay():
    model = with_setting(Row(first=dict(x=Start(4.0))), "first.x.max", 9.0)
    assert starts(model, "first.x")[0] == [4.0]
    limited = flatten(with_setting(Row(first=dict(x=Bounds(-1.0, 1.0))), "first.x.max", 9.0)).find("first.x")
    assert limited is not None
    assert limited.min is not None
    assert limited.max is not None
    assert np.array_equal([float(limited.min[0]), float(limited.max[0])], [-1.0, 9.0])


REFUSED = {
    "rat": "Row has no 'rat'",
    "bass": "Row has no 'bass'; did you mean 'base' (1/s)?",
    "first.rat": "Row.first has no 'rat'; did you mean 'rate' (rate, 1/s)?",
    "first": "Row.first is a Bucket; expected one of its members",
    "first[0].rate": "Row.first is a Bucket; found [0] behind it",
    "line[2].rate": "Row.line has [0] to [1], found [2]",
    "line[0]": "Row.line[0] is a Bucket; expected one of its members",
    "first.gain[0]": "Row.first.gain is set as a whole: give the vector",
    "first.x": "Row.first.x is a variable (1), expected a parameter; its start value is first.x.start",
    "first.x.begin": "Row.first.x has no 'begin'; what can be set is start, fixed, min, max, nominal",
    "a b": "expected a name as the model prints it, such as carts[0].m",
    "first..rate": "expected a name as the model prints it",
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_name_that_cannot_be_set(name):
    with pytest.raises(ModelError, match=re.escape(REFUSED[name])):
        with_setting(Row(), name, 1.0)


def test_what_stands_further_out_is_set_there():
    with pytest.raises(ModelError, match=r"GantryTau.tool.body.world refers to a component further out"):
        with_setting(GantryTau(prototypes.L1), "tool.body.world.g", 1.6)
    assert change(GantryTau(prototypes.L1), "world.g", 1.6) == {"world.g": 1.6}
