"""Modifications, bindings, arrays, redeclarations and parameters: what they mean and how they fail."""

import math

import numpy as np
import pytest

from gantrytau import (
    Array,
    Bounds,
    Connector,
    Fixed,
    Flow,
    Input,
    Model,
    ModelError,
    Output,
    Parameter,
    Real,
    Start,
    connect,
    der,
    flatten,
    sqrt,
    translate,
)


class Plug(Connector):
    u = Real(unit="V")
    i = Flow(unit="A")


class Cell(Model):
    """A source with an inner resistance."""

    voltage = Parameter(1.5, unit="V", description="voltage without load")
    resistance = Parameter(0.1, unit="Ohm", description="inner resistance")
    charge = Real(unit="C", description="what was drawn", start=0.0)
    plug = Plug()

    def equations(self):
        yield self.plug.u == self.voltage + self.resistance * self.plug.i
        yield der(self.charge) == -self.plug.i


class Ideal(Cell):
    """A cell that also counts its energy."""

    energy = Real(unit="J")

    def equations(self):
        yield from super().equations()
        yield der(self.energy) == -self.plug.u * self.plug.i


class Pack(Model):
    total = Parameter(3.0, unit="V", description="voltage of all cells")
    main = Cell(voltage=total)
    cells = Array(Cell, 2, voltage=total / 2)
    shapes = Parameter([1.0, 2.0, 3.0], unit="m", description="three lengths")


class Rack(Model):
    pack = Pack()


def values(model, *names):
    at = translate(model).evaluate({})
    return [at[n] for n in names]


def quantity(model, name):
    found = flatten(model).find(name)
    assert found is not None
    return found


def test_values_of_declarations_modifications_and_bindings():
    assert values(Pack(), "main.voltage", "cells[1].voltage") == [3.0, 1.5]
    assert values(Pack(total=5.0), "main.voltage", "cells[0].voltage") == [5.0, 2.5]
    assert values(Pack(main=dict(voltage=1.0)), "main.voltage", "main.resistance") == [1.0, 0.1]
    rack = Rack(pack=dict(main=dict(resistance=2.0), total=9.0))
    assert values(rack, "pack.main.resistance", "pack.main.voltage") == [2.0, 9.0]


def test_nested_modifications_merge_from_outside_in():
    class Special(Rack):
        pack = Pack(main=dict(voltage=1.0, resistance=1.0), cells=dict(resistance=7.0))

    model = Special(pack=dict(main=dict(resistance=2.0)))
    wanted = ("main.voltage", "main.resistance", "cells[1].resistance", "cells[1].voltage")
    assert values(model, *(f"pack.{name}" for name in wanted)) == [1.0, 2.0, 7.0, 1.5]


def test_arrays_take_one_modification_for_all_or_one_each():
    both = ("cells[0].resistance", "cells[1].resistance")
    assert values(Pack(cells=dict(resistance=2.0)), *both) == [2.0, 2.0]
    each = Pack(cells=[dict(resistance=2.0), dict(resistance=3.0)])
    assert values(each, *both, "cells[1].voltage") == [2.0, 3.0, 1.5]

    class Uneven(Model):
        cells = Array(Cell, [dict(voltage=1.0), dict(voltage=2.0)], resistance=0.3)

    assert values(Uneven(), "cells[0].voltage", "cells[1].voltage", "cells[1].resistance") == [1.0, 2.0, 0.3]
    assert values(Uneven(cells=dict(resistance=0.4)), "cells[1].voltage", "cells[1].resistance") == [2.0, 0.4]


def test_redeclaration_replaces_a_component():
    flat = flatten(Pack(main=Ideal(voltage=4.0), cells=[Ideal(), dict(resistance=3.0)]))
    names = {v.name for v in flat.variables}
    assert {"main.energy", "cells[0].energy"} <= names
    assert "cells[1].energy" not in names
    assert values(Pack(main=Ideal(voltage=4.0)), "main.voltage") == [4.0]


def test_formulas_are_read_where_they_are_written():
    class Outer(Model):
        resistance = Parameter(5.0, unit="Ohm")
        length = Parameter(4.0, unit="m")
        root = Parameter(sqrt(length * length) / 2, unit="m")
        called = Parameter(lambda self: self.length**2, unit="m2")
        listed = Parameter([length, 2 * length, 0.0], shape=3, unit="m")
        half = Parameter(-length[0] * 0 + listed[1] / 2, unit="m")
        # the formula means the resistance of Outer, though Cell has one of that name too
        cell = Cell(resistance=2 * resistance)

    wanted = ("cell.resistance", "root", "called", "half")
    assert values(Outer(), *wanted) == [10.0, 2.0, 16.0, 4.0]
    assert values(Outer(resistance=1.0, length=2.0), *wanted) == [2.0, 1.0, 4.0, 2.0]
    np.testing.assert_array_equal(values(Outer(length=3.0), "listed")[0], [3.0, 6.0, 0.0])


def test_a_base_class_names_its_parameters():
    class Derived(Cell):
        double = Parameter(2 * Cell.voltage, unit="V")

    assert values(Derived(voltage=4.0), "double") == [8.0]


def test_attributes_of_variables():
    start = quantity(Pack(main=dict(charge=Start(0.5))), "main.charge")
    assert start.start is not None
    assert (float(start.start[0]), start.fixed) == (0.5, False)
    assert quantity(Pack(main=dict(charge=Fixed(0.5))), "main.charge").fixed
    bounded = quantity(Pack(main=dict(charge=Bounds(-1, 2))), "main.charge")
    assert bounded.min is not None
    assert bounded.max is not None
    assert (float(bounded.min[0]), float(bounded.max[0])) == (-1.0, 2.0)
    assert bounded.start is not None  # kept from the declaration
    merged = quantity(Pack(main=dict(charge=dict(start=3.0, min=-7.0))), "main.charge")
    assert merged.min is not None
    assert float(merged.min[0]) == -7.0
    assert quantity(Rack(), "pack.main.plug.u").start is None


def test_a_number_or_formula_binds_a_variable():
    class Wire(Model):
        u, i = Real(unit="V"), Real(unit="A")

        def equations(self):
            yield self.u == 3.0 * self.i

    class House(Model):
        current = Parameter(4.0, unit="A")
        wire = Wire(i=2 * current)

    assert translate(Wire(i=2.0), units=False).evaluate({})["u"] == 6.0
    assert translate(House(), units=False).evaluate({})["wire.u"] == 24.0


class Amplifier(Model):
    gain = Parameter(2.0, unit="1")
    u = Input(unit="V")
    y = Output(unit="V")

    def equations(self):
        yield self.y == self.gain * self.u


def test_an_input_that_is_set_from_around_is_no_input():
    class Bound(Model):
        amplifier = Amplifier(u=3.0)

    class Equated(Model):
        amplifier = Amplifier()

        def equations(self):
            yield self.amplifier.u == 3.0

    class Chain(Model):
        first, second = Amplifier(gain=5.0), Amplifier()

        def equations(self):
            yield connect(self.first.y, self.second.u)

    class Through(Model):
        u = Input(unit="V")
        amplifier = Amplifier()

        def equations(self):
            yield connect(self.u, self.amplifier.u)

    for model in (Bound(), Equated()):
        dae = translate(model)
        assert dae.inputs == ()
        assert dae.evaluate({})["amplifier.y"] == 6.0
    chain = translate(Chain())
    assert chain.inputs == ("first.u",)
    assert chain.evaluate({"first.u": 1.0})["second.y"] == 10.0
    through = translate(Through())
    assert through.inputs == ("u",)
    assert through.evaluate({"u": 1.0})["amplifier.y"] == 2.0


def test_initial_equations_choose_the_start():
    class Tank(Model):
        level = Real(unit="m", start=1.0)
        rate = Real(unit="m/s")
        inflow = Parameter(0.5, unit="m/s")

        def equations(self):
            yield self.rate == der(self.level)
            yield der(self.level) == self.inflow - 0.1 * self.level**2

        def initial_equations(self):
            yield self.rate == 0

    at = translate(Tank(), units=False).start
    assert at["level"] == pytest.approx(math.sqrt(5.0), rel=1e-12)


def test_settings_shape_a_model():
    class Line(Model):
        count = 2
        s = Real(lambda self: self.count, unit="m")

        def equations(self):
            for k in range(self.count):
                yield self.s[k] == k

    np.testing.assert_array_equal(values(Line(count=4), "s")[0], [0, 1, 2, 3])
    assert len(flatten(Line()).variables[0].elements) == 2


def test_instances_share_nothing():
    first, second = Pack(total=1.0), Pack()
    assert values(first, "main.voltage") == [1.0]
    assert values(second, "main.voltage") == [3.0]
    assert values(first, "main.voltage") == [1.0]


class Gain(Model):
    k = Parameter(1.0, unit="1", description="gain")
    limit = Parameter(9.0, unit="1", description="limit")


class OtherGain(Gain):
    k = Parameter(2.0, unit="1", description="gain")


class Stage(Model):
    gain = Gain()


class Station(Model):
    amplifier = Stage(gain=OtherGain(limit=5.0))
    amplifiers = Array(Stage, 2, gain=OtherGain())


class Doubled(Stage):
    def __init__(self, **modifications):
        super().__init__(dict(gain=OtherGain(limit=5.0)), **modifications)


def test_a_modification_of_a_component_that_replaces_another_is_laid_over_it():
    station = Station(amplifier=dict(gain=dict(k=3.0)), amplifiers=[dict(gain=dict(limit=7.0)), dict()])
    table = translate(station).table.values
    assert (table["amplifier.gain.k"], table["amplifier.gain.limit"]) == (3.0, 5.0)
    assert [table[f"amplifiers[{k}].gain.limit"] for k in range(2)] == [7.0, 9.0]
    assert [table[f"amplifiers[{k}].gain.k"] for k in range(2)] == [2.0, 2.0]
    table = translate(Doubled(gain=dict(k=3.0))).table.values
    assert (table["gain.k"], table["gain.limit"]) == (3.0, 5.0)
    with pytest.raises(ModelError, match="OtherGain has no 'kk'; did you mean 'k'"):
        Doubled(gain=dict(kk=3.0))
