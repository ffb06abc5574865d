"""The flat Modelica text says what the flat model says, as an independent parser reads it."""

import re

import casadi as ca
import pytest

from gantrytau import Input, Model, Output, Parameter, Real, StateSelect, der, translate
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import GantryTau, Pendulum, prototypes
from tests.answers.test_linearization import Oscillator
from tests.writing.modelica_reader import Evaluator, read_modelica
from tests.writing.residuals import assert_same_residuals


class Started(Model):
    """Attributes of every kind, an initial equation, an output, a third derivative."""

    a = Parameter(2.0, unit="1/s", description='the "rate"')
    b = Parameter(lambda self: ca.sqrt(18 * self.a**2) / 2, unit="1/s", min=0.0)
    x = Real(2, unit="m", start=[0.5, -1.5], fixed=True, description="place \\ way")
    w = Real(unit="m", start=1e-5, min=-10.0, prefer=StateSelect.AVOID)
    u = Input(unit="m/s3", start=1.0)
    y = Output(unit="m")

    def equations(self):
        yield der(self.x) == -self.a * self.x + ca.vertcat(0, self.b * self.x[0])
        yield der(der(der(self.w))) == self.u - self.b**3 * self.w
        yield self.y == self.w + self.x[0]

    def initial_equations(self):
        yield self.w == 3 * self.y


MODELS = [
    pytest.param(GantryTau(prototypes.L1, friction=LinearFriction), id="robot with linear friction"),
    pytest.param(Oscillator(), id="oscillator"),
    pytest.param(Started(), id="started"),
]


@pytest.mark.parametrize("model", MODELS)
def test_an_independent_parser_reads_the_same_residuals(model):
    assert_same_residuals(model)


def test_attributes_of_declarations():
    read = assert_same_residuals(translate(Started(), units=False))
    assert [read.symbols[n].comment for n in ("a", "x[1]")] == [r"the \"rate\"", r"place \\ way"]
    assert [read.attribute(f"x[{k}]", "fixed").value for k in (0, 1)] == [True, True]
    found = Evaluator(read, {}, {})(read.attribute("w", "start"))
    assert found == pytest.approx(-0.75, rel=1e-9)  # w = 3 (w + 0.5), from where it is not moved again
    assert str(read.attribute("w", "stateSelect")) == "StateSelect.avoid"
    assert read.attribute("u", "unit").value == "m/s3"
    assert read.attribute("y", "start") is None
    assert read.named("output") == ["y"]


def test_given_variables_become_inputs_and_free_inputs_unknowns():
    dae = translate(Oscillator(), given=["mass.s"])
    read = assert_same_residuals(dae)
    assert read.named("input") == ["mass.s"]
    assert "force.f" in read.unknowns


def test_derivatives_that_are_asked_for_become_outputs():
    read = assert_same_residuals(translate(Pendulum(), find=["der(v_x)", "der(der(v_y))"]))
    assert set(read.named("output")) == {"wanted der(der(v_y))"}  # the model has der(v_x) itself


def test_no_derivative_of_a_derivative_and_no_dotted_name_outside_of_quotes():
    text = translate(GantryTau(prototypes.L1)).equations("base-modelica")
    bare = re.sub(r"//.*|\"[^\"]*\"", "", text)
    assert "der(der(" not in re.sub(r"'[^']*'", "", bare)
    assert not re.search(r"[A-Za-z_\]]\.[A-Za-z]", re.sub(r"'[^']*'", "", bare).replace("StateSelect.", ""))
    assert not re.search(r"noEvent|smooth", bare)


class TwiceTheSame(Model):
    """The last equation repeats the first two."""

    x, y, z = Real(unit="1", start=1.0), Real(unit="1"), Real(unit="1")

    def equations(self):
        yield self.x == self.y
        yield self.y == self.z
        yield der(self.x) == -self.x
        yield self.z == self.x


def test_equations_that_follow_from_others_are_left_out_and_named():
    dae = translate(TwiceTheSame(), units=False)
    assert_same_residuals(dae)
    words = "// left out, it follows from the others: the model (TwiceTheSame), equation 4"
    assert words in dae.equations("base-modelica")


def test_a_model_without_equations_is_written():
    class Plain(Model):
        a = Parameter(3.0, unit="m")
        b = Parameter(2 * a, unit="m")

    read = assert_same_residuals(translate(Plain()))
    assert read.named("parameter") == ["a", "b"]


def test_names_that_modelica_cannot_spell_are_spelled_out():
    class model(Model):
        α = Real(unit="1", start=1.0)

        def equations(self):
            yield der(self.α) == -self.α

    text = translate(model(), units=False).equations("base-modelica")
    assert text.startswith("//! base 3.6.0\npackage 'model'\nmodel 'model' ")
    assert "der('U+03B1') = -'U+03B1'" in text
    read_modelica(text)
