"""Gains, sums and products; what units signals have."""

from typing import Any

import pytest

from gantrytau import Array, Input, Model, ModelError, connect, translate
from gantrytau.blocks import Gain, LowPass, Product, Step, Sum
from gantrytau.mechanics import filters, translational
from tests.mechanisms.rows import row


class Difference(Model):
    """3 (first - 2 second) times their product."""

    first, second = Input(start=5.0), Input(start=-0.5)
    sum, gain, product = Sum(k=[1.0, -2.0]), Gain(k=3.0), Product(size=3)

    def equations(self):
        for k, one in enumerate((self.first, self.second)):
            yield connect(one, self.sum.u[k])
            yield connect(one, self.product.u[k])
        yield from row(self.sum, self.gain, self.product.u[2])


def test_a_sum_a_gain_and_a_product():
    found = translate(Difference()).evaluate({"first": 7.0, "second": -2.0})
    assert (found["sum.y"], found["gain.y"], found["product.y"]) == (11.0, 33.0, -14.0 * 33.0)


def test_sums_of_one_and_of_five():
    for k in ([4.0], [1.0, 2.0, 3.0, 4.0, 5.0]):
        found = translate(Sum(k=k)).evaluate({"u": [1.0] * len(k)})
        assert found["y"] == sum(k)


def test_gains_of_a_vector_are_an_array_of_them():
    class Three(Model):
        u = Input(3)
        gains = Array(Gain, [dict(k=1.0), dict(k=-1.0), dict(k=1e9)])

        def equations(self):
            for k, gain in enumerate(self.gains):
                yield connect(self.u[k], gain.u)

    found = translate(Three()).evaluate({"u": [2.0, 3.0, 4.0]})
    assert [found[f"gains[{k}].y"] for k in range(3)] == [2.0, -3.0, 4e9]


class Pressed(Model):
    """A force is measured, and speaks to a speed through a gain."""

    force, sensor, wall = translational.Force(), translational.ForceSensor(), translational.Fixed()
    gain, slide, mass = Gain(k=1e-3), translational.Speed(), translational.Mass()

    def equations(self):
        yield from row(self.force, self.sensor, self.wall)
        yield from row(self.sensor.f, self.gain, self.slide.v)
        yield connect(self.slide.flange, self.mass.flange)


def test_an_open_gain_joins_what_is_connected_to_it():
    found = translate(Pressed()).evaluate({"force.f": 500.0})
    assert found["mass.v"] == pytest.approx(0.5, rel=1e-15)


def test_a_gain_with_units_says_when_it_is_connected_to_others():
    class Said(Pressed):
        gain = Gain(k=1e-3, unit=("N", "m/s"))

    assert translate(Said()).evaluate({"force.f": 500.0})["mass.v"] == pytest.approx(0.5, rel=1e-15)
    with pytest.raises(ModelError, match=r"units disagree in `.*gain\.u.*'m'"):
        translate(Said(gain=dict(u=dict(unit="m"))))
    for unit in ("V", ("N", "V")):
        with pytest.raises(ModelError, match="units disagree"):
            translate(type("Wrong", (Pressed,), {"gain": Gain(unit=unit)})())


def test_the_unit_of_a_gain_itself_is_checked_where_it_is_said():
    class Said(Pressed):
        gain = Gain(k=dict(value=1e-3, unit="s/kg"), unit=("N", "m/s"))

    assert translate(Said()).evaluate({"force.f": 500.0})["mass.v"] == pytest.approx(0.5, rel=1e-15)
    with pytest.raises(ModelError, match=r"units disagree in `.*gain"):
        translate(Said(gain=dict(k=dict(unit="kg/s"))))


def test_units_are_one_or_a_pair():
    for unit in (("N", "V", "m"), 3, ("N",)):
        wrong: Any = unit
        with pytest.raises(ModelError, match=r"Gain: unit: found .*, expected a text for both ports"):
            Gain(unit=wrong)


def test_the_low_pass_among_the_blocks_is_that_of_the_filters():
    assert LowPass is filters.LowPass


def test_a_source_has_one_unit():
    class Driven(Model):
        step, force, mass = Step(height=3.0, unit="N"), translational.Force(), translational.Mass(m=2.0)

        def equations(self):
            yield connect(self.step.y, self.force.f)
            yield connect(self.force.flange, self.mass.flange)

    dae = translate(Driven(), find=["der(mass.v)"])
    assert dae.evaluate()["der(mass.v)"] == 1.5
    with pytest.raises(ModelError, match="units disagree"):
        translate(Driven(step=dict(y=dict(unit="m"))))
