"""Modifications that cannot be: refused with place, finding and remedy."""

import math
from typing import Any, cast

import pytest

from gantrytau import (
    InitializationError,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    der,
    flatten,
    translate,
)
from tests.language.test_modifications import Cell, Pack, Rack, values


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Cell(voltag=1.0),
            r"^Cell has no 'voltag'; did you mean 'voltage' \(voltage without load, V\)\?",
        ),
        (
            lambda: Rack(pack=dict(main=dict(resistence=1.0))),
            r"^pack\.main \(Cell\) has no 'resistence'; did you mean",
        ),
        (
            lambda: Pack(cells=[dict(), dict(charg=1)]),
            r"^cells\[1\] \(Cell\) has no 'charg'; did you mean 'charge'",
        ),
        (lambda: Pack(cells=dict(charg=1)), r"^cells\[0\] \(Cell\) has no 'charg'"),
        (
            lambda: Pack(cells=[dict(resistance=1.0)] * 3),
            r"^cells: found 3 modifications, expected one for each of 2",
        ),
        (
            lambda: Pack(cells=[dict(resistance=1.0)]),
            r"^cells: found 1 modifications, expected one for each of 2",
        ),
        (
            lambda: Pack(main=3.0),
            r"^main: found 3.0 as modification, expected a component that replaces Cell, or dict",
        ),
        (
            lambda: Pack(main=dict(charge=dict(strat=1))),
            r"^main\.charge has no attribute 'strat'; there is start, fixed",
        ),
        (
            lambda: Pack(total=Cell()),
            r"^total: found a component as modification of a quantity, expected a value",
        ),
        (lambda: Pack(total=math.nan), r"^total: value is nan, expected a finite number"),
        (lambda: Pack(total=-math.inf), r"^total: value is -inf, expected a finite number"),
        (lambda: Pack(shapes=[1.0, math.nan, 2.0]), r"^shapes: value is nan, expected a finite number"),
        (lambda: Pack(shapes=[1.0, 2.0]), r"^shapes: value has shape \(2,\), expected \(3,\)"),
        (lambda: Pack(shapes=1.0), r"^shapes: value has shape \(\), expected \(3,\)"),
        (lambda: Pack(total="3 volts"), r"^total: value: unit 'volts': there is no unit 'volts'"),
        (
            lambda: Pack(total="three"),
            r"^total: value: found 'three', expected a number and its unit, as '2.5 ",
        ),
        (
            lambda: Pack(main=dict(charge=Start(math.nan))),
            r"^main\.charge: start is nan, expected a finite number",
        ),
    ],
)
def test_modifications_that_cannot_be(make, message):
    with pytest.raises(ModelError, match=message):
        flatten(make())


def test_a_class_that_needs_arguments_is_told():
    class Sized(Model):
        def __init__(self, size):
            super().__init__(size=size)

        size = Parameter(unit="m", description="size")

    with pytest.raises(
        ModelError, match=r"^Sized: found the class, which needs arguments .*'size'.*write Sized"
    ):
        flatten(cast(Any, Sized))


def test_components_that_would_be_lost():
    with pytest.raises(ModelError, match=r"Lost\.cells is a list of declarations.*Array\(Component, count\)"):

        class Lost(Model):
            cells = [Cell(), Cell()]

    class Late(Model):
        def __init__(self):
            super().__init__()
            self.cell = Cell()

    with pytest.raises(
        ModelError, match=r"Late\.cell is assigned in __init__, where it would be lost; declare it"
    ):
        flatten(Late())


def test_a_parameter_without_value_is_named_with_its_description():
    class Bare(Model):
        m = Parameter(unit="kg", description="mass of the cart")

    class Holder(Model):
        bare = Bare()

    with pytest.raises(
        ModelError, match=r"bare\.m \(mass of the cart, kg\) has no value, expected one; .* `m=\.\.\.`"
    ):
        translate(Holder())
    assert values(Holder(bare=dict(m=2.0)), "bare.m") == [2.0]


def test_parameters_that_are_defined_by_each_other():
    class Circle(Model):
        a = Parameter(lambda self: 2 * self.b, unit="1")
        b = Parameter(lambda self: self.a + 1, unit="1")

    with pytest.raises(ModelError, match="parameters a, b are defined by each other in a circle"):
        translate(Circle())


def test_parameters_that_come_out_infinite_or_hang_on_a_variable():
    class Inverse(Model):
        a = Parameter(1.0, unit="1")
        b = Parameter(1 / (a - 1), unit="1")

    with pytest.raises(ModelError, match=r"b = .*: found inf, expected a finite number"):
        translate(Inverse())

    class Moving(Model):
        x = Real(unit="1")
        b = Parameter(lambda self: 2 * self.x, unit="1")

        def equations(self):
            yield self.x == 1

    with pytest.raises(ModelError, match="b: found the variable x in its value, expected parameters only"):
        translate(Moving())


def test_fixed_starts_that_contradict_each_other():
    class Twins(Model):
        x = Real(unit="m", start=1.0, fixed=True)
        y = Real(unit="m", start=2.0, fixed=True)

        def equations(self):
            yield self.x == self.y
            yield der(self.x) == 0

    with pytest.raises(
        InitializationError,
        match="y: fixed start 2 contradicts the fixed start of x, of which it is an alias",
    ):
        translate(Twins())

    class Circle(Model):
        x = Real(unit="1", start=1.0, fixed=True)
        y = Real(unit="1", start=1.0, fixed=True)

        def equations(self):
            yield self.x**2 + self.y**2 == 1
            yield der(self.x) == -self.y

    with pytest.raises(InitializationError, match=r"Circle: .*the model \(Circle\), equation 1 is off by 1"):
        translate(Circle(), units=False)
