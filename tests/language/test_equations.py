"""What may stand in equations(self), and what is said about the rest."""

import math
import re

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Model,
    ModelError,
    Parameter,
    Real,
    StructureError,
    between,
    connect,
    der,
    flatten,
    fmax,
    fmin,
    if_else,
    sign,
    translate,
)
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import PointMass


class Plant(Model):
    x = Real(unit="m")
    y = Real(unit="m")
    r = Real(3, unit="m")
    q = Real(2, unit="m")
    velocity = Real(unit="m/s")
    length = Parameter(2.0, unit="m")


def plant(statement):
    """Plant with one equation."""

    class Bench(Plant):
        def equations(self):
            yield self.y == 0
            yield statement(self)

    return Bench()


NO_EQUATIONS = [  # statements, and what is said of them
    (lambda p: [p.x] == [p.y], "Python's if, and, or, max, chained comparisons and lists cannot work"),
    (lambda p: p.r == [p.x, 0, 0], "Join symbols with casadi.vertcat(...) instead"),
    (lambda p: True, "found True, expected an equation"),
    (lambda p: p.r == p.q, "x is 3x1, while y is 2x1; the two operands have different shapes"),
    (lambda p: p.r == p.x, "found shapes (3,) and () in 'r[0] == x' and the rows below"),
    (lambda p: p.x == p.r, "found shapes (3,) and ()"),
    (lambda p: p.r == 2 * p.x, "found shapes (3,) and ()"),
    (lambda p: p.x == p.x, "both sides are the same, so it says nothing"),
    (lambda p: ca.SX(1) == 2, "both sides are constants that differ, so it can never hold"),
    (lambda p: 3.0, "found float, expected an equation `a == b` or connect"),
    (lambda p: None, "found NoneType, expected an equation"),
    (lambda p: p.x + 1, "found '(x+1)', expected an equation; write `a == b`"),
    (lambda p: p.x < 1, "found '(x<1)', expected an equation"),
    (lambda p: between(0, p.x, 1), "found Between, expected an equation"),
    (lambda p: (p.x if p.x > 0 else p.y) == 0, "use if_else, between"),
    (lambda p: (p.x > 0 and p.y > 0) == 0, "use if_else, between"),
    (lambda p: 0 < p.x < 1, "use if_else, between"),
    (lambda p: p.x == p.y == p.length, "use if_else, between"),
    (lambda p: p.x == max(p.y, 0), "casadi.fmax"),
    (lambda p: p.x == math.sin(p.y), "found nan in `x == nan`"),
    (lambda p: p.x == p.velocty, "Bench has no 'velocty'; did you mean 'velocity'?"),
    (lambda p: p.x == p.y.squared, "SX has no 'squared'"),
    (lambda p: p.x == ca.sinus(p.y), "casadi has no 'sinus'; did you mean"),
    (lambda p: ca.sin([p.x, p.y]) == 0, "no number or expression among symbols; join lists"),
    (lambda p: ca.cross(p.q, p.r) == 0, "Dimension of a (2x1 ) must equal that of b (3x1)"),
    (lambda p: p.r[3] == 0, "out of bounds with supplied length of 3"),
]


@pytest.mark.parametrize(("statement", "words"), NO_EQUATIONS)
def test_what_is_no_equation_is_refused_with_its_place(statement, words):
    with pytest.raises(ModelError, match=rf"^the model \(Bench\), equation 2: .*{re.escape(words)}"):
        flatten(plant(statement))


def test_the_path_of_a_nested_component_is_named():
    class Outside(Model):
        inside = plant(lambda p: p.x == p.r)

    with pytest.raises(ModelError, match=r"^inside \(Bench\), equation 2: found shapes"):
        flatten(Outside())


@pytest.mark.parametrize("result", [None, "equation"])
def test_equations_must_be_generated(result):
    class NotAGenerator(Plant):
        def equations(self):  # pyright: ignore[reportIncompatibleMethodOverride]
            return None if result is None else self.x == self.y

    with pytest.raises(ModelError, match="yields its equations one by one: `yield a == b`"):
        flatten(NotAGenerator())


def test_numbers_and_arrays_may_stand_on_one_side():
    flat = flatten(plant(lambda p: p.r == [1, 2, 3]))
    assert [e.text for e in flat.equations[1:]] == ["r[0] == 1", "r[1] == 2", "r[2] == 3"]
    flat = flatten(plant(lambda p: p.r == np.array([1.0, 0.0, 3.0])))
    assert len(flat.equations) == 4
    assert len(flatten(plant(lambda p: p.r == 0)).equations) == 4
    assert flat.equations[1].name == "the model (Bench), equation 2, row 0"


def test_derivatives_of_expressions_follow_the_chain_rule():
    flat = flatten(plant(lambda p: der(p.x * p.y + p.length) == 0))
    assert set(flat.derivatives) == {"der(x)", "der(y)"}
    expected = flat.derivatives["der(x)"] * ca.SX.sym("y")
    assert str(expected) in flat.equations[1].text or "der(x)" in flat.equations[1].text


def test_der_outside_of_equations_is_refused():
    with pytest.raises(ModelError, match=r"der\(\) was called outside of equations\(self\)"):
        der(ca.SX.sym("x"))


def test_relations_of_declarations_belong_into_equations():
    with pytest.raises(ModelError, match="'==' between declarations in a class body"):
        _ = Plant.x == Plant.y
    with pytest.raises(ModelError, match="'<=' between declarations in a class body"):
        _ = Plant.x <= Plant.y


def test_super_keeps_the_equations_of_the_base():
    class Base(Plant):
        def equations(self):
            yield self.x == self.length

    class Derived(Base):
        def equations(self):
            yield from super().equations()
            yield self.y == 2 * self.x

    assert [e.text for e in flatten(Derived()).equations] == ["x == length", "y == (2.*x)"]


def test_conditions():
    class Ramp(Model):
        x = Real(unit="1")
        low, high, within = Real(unit="1"), Real(unit="1"), Real(unit="1")

        def equations(self):
            yield self.low == if_else(self.x < 0, 0, self.x)
            yield self.high == if_else(self.x > 1, 1, self.low)
            yield self.within == if_else(between(0, self.x, 1), 1, 0)

    function = translate(Ramp(), given=["x"]).function(["x"], ["high", "within"])
    assert [tuple(float(y) for y in function(x)) for x in (-0.5, 0.25, 1.5)] == [(0, 0), (0.25, 1), (1, 0)]


class Springs(Model):
    mass = translational.Mass()
    shaft = rotational.Inertia()


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        (lambda s: (s.mass.flange, s.shaft.flange_a), "different connectors: 'f' is in one of them only"),
        (lambda s: (s.mass.flange, translational.Mass().flange), "a Flange that is not part of this model"),
        (lambda s: (s.mass.flange, s.mass), r"connect\(Flange, Mass\): expected two connectors; name those"),
        (lambda s: (s.mass, s.mass), r"connect\(Mass, Mass\): expected two connectors"),
        (lambda s: (s.mass.flang, s.mass.flange), r"equation 1: Mass has no 'flang'; did you mean 'flange'"),
    ],
)
def test_connections_that_cannot_be(ends, message):
    class Wrong(Springs):
        def equations(self):
            yield connect(*ends(self))

    with pytest.raises(ModelError, match=message):
        flatten(Wrong())


def test_a_missing_world_is_named_with_the_remedy():
    class Ball(Model):
        body = PointMass()

    with pytest.raises(ModelError, match=r"body \(PointMass\): found no World .* `world = World\(\)` .*Ball"):
        flatten(Ball())


def test_too_few_equations():
    class Pump(Model):
        pressure = Real(unit="Pa")
        flow = Real(unit="m3/s", undetermined="no valve holds it")

        def equations(self):
            yield self.pressure == 1e5

    class Station(Model):
        pump = Pump()

    words = r"^Station: 2 unknowns, 1 equation\. Undetermined: pump\.flow \(no valve holds it\)\. Add 1 .* in pump,"
    with pytest.raises(StructureError, match=words):
        translate(Station())
    with pytest.raises(StructureError, match=r"Undetermined: pump\.flow \(the valve is stuck\)"):
        translate(Station(pump=dict(flow=dict(undetermined="the valve is stuck"))))


def test_too_many_equations():
    twice = plant(lambda p: p.y == 2)
    with pytest.raises(StructureError, match=r"Overdetermined by 1: .*equation 2 `y == 2`"):
        translate(twice)


def test_an_equation_that_repeats_others_is_dropped_and_named():
    class Repeated(Model):
        x, y = Real(unit="1"), Real(unit="1")

        def equations(self):
            yield self.x == 1
            yield self.y == self.x
            yield self.x == self.y

    dae = translate(Repeated())
    assert dae.diagnosis.redundant == ("the model (Repeated), equation 3",)
    assert dae.evaluate({})["y"] == 1.0


def test_structurally_singular():
    class Singular(Model):
        x, y, z = Real(unit="1"), Real(unit="1"), Real(unit="1")

        def equations(self):
            yield self.x**2 + self.y == 0
            yield self.x * self.y == 1
            yield self.x - self.y**2 == 1

    message = r"3 unknowns, 3 equations\. Undetermined: z\. .*Overdetermined by 1: .*equation 1 .*equation 3"
    with pytest.raises(StructureError, match=message):
        translate(Singular())


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        (lambda p: p.x == p.velocity, r"the left side is in 'm', the right side in 'm/s'"),
        (lambda p: p.x + p.velocity == 0, r"`x` is in 'm', `velocity` in 'm/s'; both must be the same"),
        (lambda p: p.velocity == ca.sin(p.x), r"the argument of sin, `x`, is in 'm', expected 1 or rad"),
        (lambda p: p.velocity == der(p.velocity), r"left side is in 'm/s', the right side in 'm/s2'"),
        (lambda p: p.x == ca.sqrt(p.x * p.velocity), r"the left side is in 'm', the right side in 'm/s1/2'"),
        (lambda p: p.x * if_else(p.x > p.velocity, 1, 2) == 0, r"`velocity` in 'm/s'|`velocity` is in 'm/s'"),
    ],
)
def test_units_that_disagree(statement, message):
    with pytest.raises(ModelError, match=r"the model \(Bench\), equation 2: .*" + message):
        translate(plant(statement))


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("mm", r"x: unit 'mm': 'mm' is not a coherent SI unit; quantities are in SI"),
        ("kg*m", r"cannot read 'kg\*m'; write units as in 'kg\.m2/s2'"),
        ("m/s/s", r"has 2 '/'; write one"),
    ],
)
def test_units_that_are_none(unit, message):
    class Wrong(Model):
        x = Real(unit=unit)

        def equations(self):
            yield self.x == 1

    with pytest.raises(ModelError, match=message):
        translate(Wrong())
    assert translate(Wrong(), units=False).evaluate({})["x"] == 1.0


def test_functions_and_derivatives_of_any_order():
    class Ringing(Model):
        x = Real(start=1.0, fixed=True)
        v = Real(start=0.0, fixed=True)
        low = Parameter(-0.5)
        high = Parameter(fmax(low, 0.25) * 2)
        r = Real(3)

        def equations(self):
            yield der(self.x, 2) == -4 * self.x
            yield self.v == der(self.x)
            yield self.r[0] == fmin(self.high, fmax(self.low, self.x))
            yield self.r[1] == sign(self.x)
            yield self.r[2] == der(self.x**2, 2)

    at = translate(Ringing()).evaluate({"x": 0.3, "v": 2.0})
    assert at["der(der(x))"] == pytest.approx(-1.2, rel=1e-14)
    np.testing.assert_allclose(at["r"], [0.3, 1.0, 2 * 4.0 - 2 * 0.3 * 1.2], rtol=1e-14)
    np.testing.assert_allclose(translate(Ringing()).evaluate({"x": -2.0, "v": 0.0})["r"][:2], [-0.5, -1.0])
