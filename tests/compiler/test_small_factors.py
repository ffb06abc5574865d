"""Aliases whose factors are small or large, and sums of which something cancels but for its rounding."""

import math

import numpy as np
import pytest

from gantrytau import (
    InitializationError,
    Input,
    Model,
    Parameter,
    Real,
    Start,
    StructureError,
    cos,
    der,
    simulate,
    translate,
)

DECADES = (1e-30, 1.38e-23, 2e-13, 1e-9, 1.0, 1e9, 1e23)


@pytest.mark.parametrize("k", DECADES)
def test_an_alias_keeps_its_factor(k):
    class Energy(Model):
        T = Real(start=300.0, fixed=True)
        E = Real()
        half = Real()

        def equations(self):
            yield der(self.T) == 10.0
            yield self.E == k * self.T
            yield 2.0 * self.half == self.E

    result = simulate(Energy(), stop=1.0, points=2)
    assert result.final("E") == pytest.approx(310.0 * k, rel=1e-7)  # ten times the tolerance
    assert result.final("half") == pytest.approx(155.0 * k, rel=1e-7)
    dae = translate(Energy())
    assert float(dae.function(["T"], ["E"])(2.0)) == pytest.approx(2.0 * k, rel=1e-14)
    assert dae.evaluate({"E": 5.0 * k})["T"] == pytest.approx(5.0, rel=1e-14)


@pytest.mark.parametrize("k", DECADES)
def test_a_variable_behind_a_small_factor_is_determined(k):
    class Behind(Model):
        p = Parameter(k, evaluate=True)
        u = Input(start=1.0)
        x = Real()
        y = Real()

        def equations(self):
            yield self.p * self.y == self.u
            yield self.x == 1e-9 * (1e-4 * self.u)

    found = translate(Behind()).evaluate({"u": 3.0})
    assert found["y"] == pytest.approx(3.0 / k, rel=1e-14)
    assert found["x"] == pytest.approx(3e-13, rel=1e-14)


def test_the_state_of_two_scales_is_the_one_with_a_start():
    class Large(Model):
        E = Real()
        T = Real(start=300.0, fixed=True)

        def equations(self):
            yield der(self.T) == 10.0 - 0.1 * self.T
            yield self.E == 1.38e-23 * self.T

    assert translate(Large()).states == ("T",)
    expected = 100 + 200 * math.exp(-0.1)
    assert simulate(Large(), stop=1.0).final("T") == pytest.approx(expected, rel=1e-6)


class Shares(Model):
    x = Real()
    a = Real()
    b = Real()
    c = Real()

    def equations(self):
        yield self.a == 0.1 * self.x
        yield self.b == 0.2 * self.x
        yield self.c == 0.3 * self.x
        yield self.a + self.b == self.c


def test_the_rounding_of_what_cancels_determines_nothing():
    """0.1 + 0.2 - 0.3 is 5.6e-17."""
    with pytest.raises(StructureError, match=r"4 unknowns, 3 equations\. Undetermined: x"):
        translate(Shares())


def test_the_rounding_of_lengths_that_cancel_contradicts_nothing():
    class Rail(Model):
        s = Input(3, start=0.0)
        r = Real(4)

        def equations(self):
            yield self.r[1] == self.r[0] + 0.1
            yield self.r[2] == self.r[1] + 0.2
            yield self.r[2] == self.r[0] + 0.3
            yield self.r[3] == self.r[2] + self.s[0] - self.s[1] + self.s[2]
            yield self.r[0] == 0

    assert translate(Rail()).evaluate({"s": [1.0, 2.0, 4.0]})["r"][3] == pytest.approx(3.3, rel=1e-14)


def test_small_differences_of_large_terms_are_kept():
    class Difference(Model):
        v = Input(start=1.0)
        a = Real()
        b = Real()

        def equations(self):
            yield self.a == 1e15 * self.v
            yield self.a - 1e15 * self.v + self.b == 3.0 * self.v

    assert translate(Difference()).evaluate({"v": 2.0})["b"] == 6.0


class Small(Model):
    x = Input(start=1.0)
    y = Real()
    zero = Real(3)

    def equations(self):
        yield self.y == self.x
        yield self.zero == 0 * np.ones(3)


def test_small_values_that_contradict_each_other_are_refused():
    dae = translate(Small())
    assert dae.evaluate({"x": 3e-10, "y": 3e-10})["y"] == 3e-10
    for given, words in (
        ({"x": 1e-10, "y": 2e-10}, r"y: found 2e-10, which contradicts another given value"),
        ({"zero[1]": 2e-10}, r"zero\[1\]: found 2e-10, but it is constant and equal to 0"),
        ({"zero": [0.0, 2e-10, 0.0]}, r"zero\[1\]: found 2e-10, but it is constant and equal to 0"),
    ):
        with pytest.raises(InitializationError, match=words):
            dae.evaluate(given)


def test_small_fixed_starts_that_contradict_each_other_are_refused():
    class Twice(Model):
        x = Real(start=1e-10, fixed=True)
        y = Real(start=2e-10, fixed=True)

        def equations(self):
            yield der(self.x) == -self.x
            yield self.y == self.x

    with pytest.raises(InitializationError, match=r"y: fixed start 2e-10 contradicts the fixed start of x"):
        translate(Twice())
    assert translate(Twice(y=Start(2e-10))).start["x"] == 1e-10


def test_the_rounding_of_an_element_is_judged_by_its_vector():
    class Level(Model):
        r = Real(2)
        phi = Input(start=0.0)

        def equations(self):
            yield self.r[0] == 0.5 * cos(self.phi)
            yield self.r[1] == 0

    assert translate(Level()).evaluate({"r": [0.5 * math.cos(0.3), 1e-17], "phi": 0.3})["r"][1] == 0.0
