"""The flat Modelica text says what the flat model says, as an independent parser reads it."""

import re

import casadi as ca
import pytest

from gantrytau import Input, Model, Output, Parameter, Real, connect, der, translate
from gantrytau.language.declarations import Array, StateSelect
from gantrytau.mechanics import multibody, rotational, translational
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import GantryTau, Pendulum, prototypes
from tests.writing.modelica_reader import read_modelica
from tests.writing.residuals import assert_same_residuals


class Oscillator(Model):
    """A mass between a spring and a damper, pushed by a force."""

    wall = translational.Fixed()
    mass = translational.Mass(m=2.0)
    spring = translational.Spring(c=30.0)
    damper = translational.Damper(d=0.4)
    push = translational.Force()

    def equations(self):
        yield connect(self.wall.flange, self.spring.flange_a)
        yield connect(self.wall.flange, self.damper.flange_a)
        yield connect(self.spring.flange_b, self.mass.flange)
        yield connect(self.damper.flange_b, self.mass.flange)
        yield connect(self.push.flange, self.mass.flange)


class Shaft(Model):
    """Two inertias, a spring between them, and a torque."""

    torque = rotational.Torque()
    inertias = Array(rotational.Inertia, [dict(J=1.0), dict(J=0.2)])
    spring = rotational.Spring(c=100.0)

    def equations(self):
        yield connect(self.torque.flange, self.inertias[0].flange_a)
        yield connect(self.inertias[0].flange_b, self.spring.flange_a)
        yield connect(self.spring.flange_b, self.inertias[1].flange_a)


class Slide(Model):
    """A point mass on a slide in space."""

    world = multibody.World()
    bar = multibody.FixedTranslation(r=[0.1, 0.2, 0.3])
    slide = multibody.Prismatic(n=[1.0, 2.0, 2.0])
    mass = multibody.PointMass(m=3.0)

    def equations(self):
        yield connect(self.world.frame_b, self.bar.frame_a)
        yield connect(self.bar.frame_b, self.slide.frame_a)
        yield connect(self.slide.frame_b, self.mass.frame_a)


class Swing(Model):
    """A body on a turning bar and a ball joint: orientations and angular velocities are passed on."""

    world = multibody.World()
    joint = multibody.Revolute(n=[0.0, 1.0, 0.0])
    bar = multibody.FixedTranslation(r=[1.0, 0.0, 0.2])
    ball = multibody.Spherical()
    body = multibody.Body(m=2.0, r_cm=[0.2, 0.1, 0.0])

    def equations(self):
        yield connect(self.world.frame_b, self.joint.frame_a)
        yield connect(self.joint.frame_b, self.bar.frame_a)
        yield connect(self.bar.frame_b, self.ball.frame_a)
        yield connect(self.ball.frame_b, self.body.frame_a)


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
    pytest.param(Shaft(), id="shaft"),
    pytest.param(Slide(), id="slide"),
    pytest.param(Swing(), id="swing"),
    pytest.param(Started(), id="started"),
]


@pytest.mark.parametrize("model", MODELS)
def test_an_independent_parser_reads_the_same_residuals(model):
    assert_same_residuals(model)


def test_attributes_of_declarations():
    read = assert_same_residuals(translate(Started(), units=False))
    assert {n: read.symbols[n].comment for n in ("a", "x[1]")} == {
        "a": r"the \"rate\"",
        "x[1]": r"place \\ way",
    }
    assert [read.attribute(f"x[{k}]", "fixed").value for k in (0, 1)] == [True, True]
    assert read.attribute("w", "start").value == 1e-5
    assert str(read.attribute("w", "stateSelect")) == "StateSelect.avoid"
    assert read.attribute("u", "unit").value == "m/s3"
    assert read.attribute("y", "start") is None
    assert read.named("output") == ["y"]


def test_given_variables_become_inputs_and_free_inputs_unknowns():
    dae = translate(Oscillator(), given=["mass.s"])
    read = assert_same_residuals(dae)
    assert read.named("input") == ["mass.s"]
    assert "push.f" in read.unknowns


def test_derivatives_that_are_asked_for_become_outputs():
    read = assert_same_residuals(translate(Pendulum(), find=["der(v_x)", "der(der(v_y))"]))
    assert set(read.named("output")) == {"wanted der(der(v_y))"}  # the model has der(v_x) itself


def test_no_derivative_of_a_derivative_and_no_dotted_name_outside_of_quotes():
    text = translate(GantryTau(prototypes.L1)).equations("modelica")
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
    assert "// left out, it follows from the others: the model (TwiceTheSame), equation 4" in dae.equations(
        "modelica"
    )


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

    text = translate(model(), units=False).equations("modelica")
    assert text.startswith("model 'model' ")
    assert "der('U+03B1') = -'U+03B1'" in text
    read_modelica(text)
