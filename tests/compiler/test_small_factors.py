"""Aliases whose factors are small or large, and sums of which something cancels but for its rounding."""

import math

import pytest

from gantrytau import Input, Model, Parameter, Real, StructureError, der, simulate, translate

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
