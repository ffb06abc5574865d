"""Units of what is no equation: formulas of parameters, modifications, starts, limits, requirements; the time in a sine."""

import math

import pytest

from gantrytau import (
    Bounds,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    cos,
    der,
    exp,
    require,
    simulate,
    sin,
    time,
    translate,
)  # fmt: skip


class Plate(Model):
    L = Parameter(2.0, unit="m")
    k = Parameter(3.0)
    A = Parameter(3 * L * L, unit="m2")
    x = Real(unit="m", start=2 * L + 1, fixed=True)

    def equations(self):
        yield der(self.x) == 0


class Around(Model):
    length = Parameter(1.5, unit="m")
    plate = Plate(L=2 * length, A=length**2, x=dict(start=length / 3, min=-length, max=length))

    def equations(self):
        yield require(self.length > 1, "expected more than 1 m")


def test_sound_formulas_are_taken():
    class Bare(Model):
        k = Parameter(3.0)
        plate = Plate(A=12.0, L=k)  # what has no unit fits anywhere

    assert simulate(Plate(), stop=1.0).final("x") == 5.0
    assert simulate(Bare(), stop=1.0).final("plate.x") == 7.0
    assert simulate(Around(), stop=1.0).final("plate.x") == 0.5


L = Around.length


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(A=3 * L), "A: value: .* left side is in 'm2', the right side in 'm'"),
        (dict(A=lambda m: m.length + m.length**2), r"A: value: .*`length` is in 'm', `length\^2` in 'm2'"),
        (dict(x=Start(L**2)), "x: start: .* left side is in 'm', the right side in 'm2'"),
        (dict(x=Bounds(0.0, L**2)), "x: max: .* left side is in 'm', the right side in 'm2'"),
        (dict(x=Bounds(-1 / L)), "x: min: .* left side is in 'm', the right side in '1/m'"),
        (dict(x=dict(nominal=2 / L)), "x: nominal: .* left side is in 'm', the right side in '1/m'"),
    ],
)
def test_formulas_of_another_unit_are_refused(change, words):
    class Changed(Around):
        plate = Plate(**change)

    with pytest.raises(ModelError, match=r"^plate\." + words):
        translate(Changed())
    assert translate(Changed(), units=False).states == ("plate.x",)


def test_a_formula_around_which_there_is_no_model_is_refused():
    for value in (3 * Plate.L, lambda self: 3 * self.L):
        with pytest.raises(ModelError, match=r"^A: value.*a formula in a modification of the outermost"):
            translate(Plate(A=value))


def test_modifications_and_requirements_of_another_unit_are_refused():
    class Mass(Around):
        mass = Parameter(1.0, unit="kg")
        plate = Plate(L=mass)

    class Compared(Plate):
        mass = Parameter(1.0, unit="kg")

        def equations(self):
            yield der(self.x) == 0
            yield require(self.mass > self.L, "expected more")

    with pytest.raises(ModelError, match=r"^plate\.L: value: .* left side is in 'm', the right side in 'kg'"):
        translate(Mass())
    with pytest.raises(ModelError, match=r"^the model: require: .*is in '(kg|m)'.* in '(m|kg)'; both"):
        translate(Compared())


class Driven(Model):
    """x follows a course of time."""

    omega = Parameter(3.0, unit="rad/s")
    u = Input(unit="m", start=1.0)
    x = Real()

    def course(self):
        return sin(time)

    def equations(self):
        yield self.x == self.course()


@pytest.mark.parametrize(
    ("course", "value"),
    [
        (lambda m: sin(3 * time), math.sin(6.0)),
        (lambda m: cos(2 * time / 4 + 0.5), math.cos(1.5)),
        (lambda m: exp(-(time - 1)), math.exp(-1.0)),
        (lambda m: sin(2 * time + time), math.sin(6.0)),
        (lambda m: sin(m.omega * time), math.sin(6.0)),
        (lambda m: 2.0 ** sin(3 * time), 2.0 ** math.sin(6.0)),
    ],
)
def test_the_time_times_a_number_is_an_angle(course, value):
    model = type("Course", (Driven,), {"course": course})()
    assert simulate(model, stop=2.0, points=3).final("x") == pytest.approx(value, rel=1e-12)


def test_a_course_of_numbers_and_time_fits_anywhere():
    class Shaken(Model):
        omega = Parameter(3.0, unit="rad/s")
        x = Real(unit="m")
        y = Real(unit="m")

        def equations(self):
            yield self.x == 0.5 * sin(3 * time)
            yield self.y == 0.5 * sin(self.omega * time)

    with pytest.raises(ModelError, match=r"equation 2: .* left side is in 'm', the right side in '1'"):
        translate(Shaken())


@pytest.mark.parametrize(
    ("course", "argument", "unit"),
    [
        (lambda m: sin(3 * m.u), r"\(3\*u\)", "1/m"),
        (lambda m: sin(time**2), r"time\^2", "1/s2"),
        (lambda m: sin(time * m.u), r"\(time\*u\)", r"1/\(m\.s\)"),
    ],
)
def test_another_argument_with_a_unit_is_refused_with_what_to_write(course, argument, unit):
    words = rf"the argument of sin, `{argument}`.* a number has no unit, so make its factor a Parameter\(.*unit='{unit}'\)"
    with pytest.raises(ModelError, match=words):
        translate(type("Course", (Driven,), {"course": course})())
