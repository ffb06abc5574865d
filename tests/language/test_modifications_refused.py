"""Modifications that cannot be: refused with place, finding and remedy."""

import math
import re
from typing import Any, cast

import pytest

from gantrytau import InitializationError, Model, ModelError, Parameter, Real, Start, der, flatten, translate
from tests.language.test_modifications import Cell, Pack, Rack


def model(name, **members):
    return type(name, (Model,), members)()


def of_a_variable():
    class Moving(Model):
        x = Real(unit="1")
        b = Parameter(lambda self: 2 * self.x, unit="1")

        def equations(self):
            yield self.x == 1

    return Moving()


def assigned_late():
    class Late(Model):
        def __init__(self):
            super().__init__()
            self.cell = Cell()

    return Late()


BARE = dict(m=Parameter(unit="kg", description="mass of the cart"))
CIRCLE = dict(a=Parameter(lambda self: 2 * self.b, unit="1"), b=Parameter(lambda self: self.a + 1, unit="1"))
INVERSE = dict(a=Parameter(1.0, unit="1"), b=Parameter(lambda self: 1 / (self.a - 1), unit="1"))

REFUSED = {  # what is said of models, and the models
    "Cell has no 'voltag'; did you mean 'voltage' (voltage without load, V)?": lambda: Cell(voltag=1.0),
    "pack.main (Cell) has no 'resistence'; did you mean": lambda: Rack(pack=dict(main=dict(resistence=1.0))),
    "cells[1] (Cell) has no 'charg'; did you mean 'charge'": lambda: Pack(cells=[dict(), dict(charg=1)]),
    "cells[0] (Cell) has no 'charg'": lambda: Pack(cells=dict(charg=1)),
    "cells: found 3 modifications, expected one for": lambda: Pack(cells=[dict(resistance=1.0)] * 3),
    "cells: found 1 modifications, expected one for": lambda: Pack(cells=[dict(resistance=1.0)]),
    "main: found 3.0 as modification, expected a component": lambda: Pack(main=3.0),
    "main.charge has no attribute 'strat'; there is start": lambda: Pack(main=dict(charge=dict(strat=1))),
    "total: found a component as modification of a quantity": lambda: Pack(total=Cell()),
    "total: value is nan, expected a finite number": lambda: Pack(total=math.nan),
    "shapes: value is nan, expected a finite number": lambda: Pack(shapes=[1.0, math.nan, 2.0]),
    "shapes: value has shape (2,), expected (3,)": lambda: Pack(shapes=[1.0, 2.0]),
    "shapes: value has shape (), expected (3,)": lambda: Pack(shapes=1.0),
    "total: value: unit 'volts': there is no unit 'volts'": lambda: Pack(total="3 volts"),
    "total: value: found 'three', expected a number and its unit": lambda: Pack(total="three"),
    "main.charge: start is nan, expected a": lambda: Pack(main=dict(charge=Start(math.nan))),
    "Lost.cells is a list of declarations": lambda: model("Lost", cells=[Cell(), Cell()]),
    "Late.cell is assigned in __init__, where it would be lost; declare it": assigned_late,
    "bare.m (mass of the cart, kg) has no value, expected one": lambda: model(
        "Holder", bare=model("Bare", **BARE)
    ),
    "parameters a, b are defined by each other in a circle": lambda: model("Circle", **CIRCLE),
    "found inf, expected a finite number": lambda: model("Inverse", **INVERSE),
    "b: found the variable x in its value, expected parameters only": of_a_variable,
}


@pytest.mark.parametrize("words", REFUSED)
def test_modifications_that_cannot_be(words):
    with pytest.raises(ModelError, match=re.escape(words)):
        translate(REFUSED[words]())


def test_a_class_that_needs_arguments_is_told():
    class Sized(Model):
        def __init__(self, size):
            super().__init__(size=size)

        size = Parameter(unit="m", description="size")

    with pytest.raises(ModelError, match=r"^Sized: found the class, which needs .*'size'.*write Sized"):
        flatten(cast(Any, Sized))


def test_fixed_starts_that_contradict_each_other():
    class Twins(Model):
        x = Real(unit="m", start=1.0, fixed=True)
        y = Real(unit="m", start=2.0, fixed=True)

        def equations(self):
            yield self.x == self.y
            yield der(self.x) == 0

    with pytest.raises(InitializationError, match="y: fixed start 2 contradicts the fixed start of x"):
        translate(Twins())

    class Circle(Model):
        x = Real(unit="1", start=1.0, fixed=True)
        y = Real(unit="1", start=1.0, fixed=True)

        def equations(self):
            yield self.x**2 + self.y**2 == 1
            yield der(self.x) == -self.y

    with pytest.raises(InitializationError, match=r"Circle: .*the model \(Circle\), equation 1 is off by 1"):
        translate(Circle(), units=False)
