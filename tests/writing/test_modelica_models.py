"""The flat Modelica text of every complete model, and of the components that they leave out.

Robots are compared at one random point: their equations are smooth, so equations that differ differ there.
"""

import casadi as ca
import numpy as np
import pytest
from pymoca import ast

from gantrytau import Model, Parameter, connect, translate
from gantrytau.language.declarations import Array
from gantrytau.mechanics import multibody, rotational, translational
from gantrytau.mechanics.filters import LowPass
from gantrytau.mechanics.gears import BallScrew, ElasticGear, IdealGear, RackAndPinion
from gantrytau.writing.base_modelica import independent_equations
from gantrytau_models import (
    DeltaRobot,
    F1GantryTau,
    FourBar,
    GantryTau,
    Pendulum,
    SixLinkGantryTau,
    SixLinkWithWrist,
    StewartPlatform,
    prototypes,
)
from tests.families import first_of
from tests.writing.modelica_reader import read_by_lines, read_modelica
from tests.writing.residuals import assert_same_residuals


class Gears(Model):
    """A filtered torque, a gear that bends, and a rack and a screw on one shaft."""

    reference = LowPass(order=3, bandwidth=20.0)
    torque = rotational.Torque()
    motor = rotational.Inertia(J=0.1)
    elastic = ElasticGear(ratio=5.0)
    gear = IdealGear(ratio=-2.0)
    friction = rotational.BearingFriction()
    ground = rotational.Fixed()
    rack = RackAndPinion()
    table = translational.Mass(m=2.0)
    screw = BallScrew()
    nut = translational.Mass(m=3.0)
    felt = rotational.TorqueSensor()
    turned = rotational.RelativeSensor()

    def equations(self):
        yield connect(self.torque.flange, self.motor.flange_a)
        yield connect(self.motor.flange_b, self.elastic.flange_a)
        yield connect(self.elastic.flange_b, self.gear.flange_a)
        yield connect(self.elastic.flange_b, self.felt.flange_a)
        yield connect(self.elastic.flange_b, self.turned.flange_a)
        yield connect(self.gear.flange_b, self.rack.flange_a)
        yield connect(self.gear.flange_b, self.turned.flange_b)
        yield connect(self.rack.flange_b, self.table.flange)
        yield connect(self.felt.flange_b, self.screw.flange_a)
        yield connect(self.felt.flange_b, self.friction.flange_b)
        yield connect(self.ground.flange, self.friction.flange_a)
        yield connect(self.screw.flange_b, self.nut.flange)


class Hung(Model):
    """A body on a cardan joint and a rail, pulled by a spring in space and pushed in both axes; sensors everywhere."""

    world = multibody.World()
    rail = multibody.Prismatic(n=[1.0, 0.0, 0.0])
    cardan = multibody.Universal()
    cut = multibody.CutSensor()
    arm = multibody.FixedTranslation(r=[0.2, 0.0, -0.5])
    turn = multibody.FixedRotation(n=[0.0, 1.0, 1.0], phi=0.4)
    body = multibody.Body(m=2.0, r_cm=[0.1, 0.0, 0.0])
    line = multibody.LineForce()
    spring = translational.SpringDamper(c=50.0, d=2.0, s_rel0=0.3)
    pushes = Array(multibody.WorldForce, 1)
    thrusts = Array(multibody.FrameForce, 1)
    twist, screw = multibody.WorldTorque(), multibody.FrameTorque()
    pose, seen = multibody.PoseSensor(), multibody.RelativeSensor()

    def equations(self):
        yield connect(self.world.frame_b, self.rail.frame_a)
        yield connect(self.world.frame_b, self.line.frame_a)
        yield connect(self.world.frame_b, self.seen.frame_a)
        yield connect(self.rail.frame_b, self.cardan.frame_a)
        yield connect(self.cardan.frame_b, self.cut.frame_a)
        yield connect(self.cut.frame_b, self.arm.frame_a)
        yield connect(self.arm.frame_b, self.turn.frame_a)
        yield connect(self.turn.frame_b, self.body.frame_a)
        yield connect(self.turn.frame_b, self.line.frame_b)
        yield connect(self.turn.frame_b, self.seen.frame_b)
        yield connect(self.line.flange_a, self.spring.flange_a)
        yield connect(self.line.flange_b, self.spring.flange_b)
        for act in (*self.pushes, *self.thrusts, self.twist, self.screw):
            yield connect(self.body.frame_a, act.frame_b)
        yield connect(self.body.frame_a, self.pose.frame_a)


class BallLoop(Model):
    """A loop that is opened in its ball joint: crank, ball, rod with a cardan joint, slide."""

    r = Parameter(0.2, unit="m", description="radius of the crank")
    world = multibody.World()
    crank = multibody.Revolute(n=[0.0, 0.0, 1.0], phi=dict(start=0.4))
    web = multibody.FixedTranslation(r=[0.2, 0.0, 0.0])
    ball = multibody.Spherical()
    rod = multibody.FixedTranslation(r=[0.6, 0.0, 0.0])
    body = multibody.Body(m=1.0, r_cm=[0.3, 0.0, 0.0], J=[[0.01, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    cardan = multibody.Universal(n_a=[0.0, 0.0, 1.0], n_b=[0.0, 1.0, 0.0])
    slide = multibody.Prismatic(n=[1.0, 0.0, 0.0], s=dict(start=0.75))

    def equations(self):
        yield connect(self.world.frame_b, self.crank.frame_a)
        yield connect(self.world.frame_b, self.slide.frame_a)
        yield connect(self.crank.frame_b, self.web.frame_a)
        yield connect(self.web.frame_b, self.ball.frame_a)
        yield connect(self.slide.frame_b, self.cardan.frame_a)
        yield connect(self.cardan.frame_b, self.rod.frame_b)
        yield connect(self.rod.frame_a, self.ball.frame_b)
        yield connect(self.rod.frame_a, self.body.frame_a)


SMOOTH = {
    "GantryTau, L1": lambda: GantryTau(prototypes.L1),
    "SixLinkGantryTau, D1": lambda: SixLinkGantryTau(prototypes.D1),
    "F1GantryTau": lambda: F1GantryTau(prototypes.F1),
    "SixLinkWithWrist": lambda: SixLinkWithWrist(prototypes.L1),
    "hung": Hung,
    "ball loop": BallLoop,
    "SixLinkGantryTau, L1": lambda: SixLinkGantryTau(prototypes.L1),
    "DeltaRobot": DeltaRobot,
    "StewartPlatform": StewartPlatform,
}


@pytest.fixture(scope="module")
def four_bar():
    return translate(FourBar())


@pytest.mark.parametrize("name", first_of(SMOOTH, 6))
def test_an_independent_parser_reads_the_same_residuals(name):
    assert_same_residuals(translate(SMOOTH[name]()), points=1)


@pytest.mark.parametrize("model", [Pendulum, Gears])
def test_an_independent_parser_reads_the_same_residuals_on_all_branches(model):
    assert_same_residuals(model())


def test_redundant_constraints_are_replaced_by_forces_that_are_zero(four_bar):
    read = assert_same_residuals(four_bar, points=1)
    written = {
        e.comment: f"{e.left} = {e.right.value}" for e in read.tree.equations if hasattr(e.right, "value")
    }
    assert len(four_bar.redundant) == 3  # a planar loop in space
    for equation in four_bar.redundant:
        assert equation.name not in {e.comment for e in read.tree.equations}
        assert written[f"no force for {equation.name}"] == f"'{equation.dual}' = 0"


def rank(dae, equations):
    """Rank of the Jacobian of equations by all variables and their derivatives, at the consistent start."""
    values = {**dae.evaluate({}), **dae.table.values}
    residuals = dae.reduced.definitions.to_reduced(ca.vertcat(*(e.residual for e in equations)))
    symbols = ca.vertcat(*ca.symvar(residuals))
    unknown = ca.vertcat(*(s for s in symbols.elements() if s.name() not in dae.parameters))
    jacobian = ca.Function("jacobian", [symbols], [ca.densify(ca.jacobian(residuals, unknown))])
    at = jacobian(ca.DM([values[s.name()] for s in symbols.elements()]))
    # the start closes the loop to 1e-10, and what does not repeat others differs by lengths of 0.1 m
    return np.linalg.matrix_rank(np.array(at), tol=1e-7)


def test_the_text_is_regular_where_the_model_repeats_itself(four_bar):
    written = independent_equations(four_bar)
    assert rank(four_bar, written) == len(written)
    assert rank(four_bar, four_bar.flat.equations) == len(written) - 3


def test_ball_joints_where_loops_are_opened_have_no_coordinates():
    assert "ball.q[0]" in translate(BallLoop()).flat.absent


@pytest.mark.parametrize("model", [Pendulum(), Gears()], ids=["pendulum", "gears"])
def test_reading_lines_that_are_alike_once_is_reading_all(model):
    text = translate(model).equations("base-modelica")
    quick, whole = (contents(read(text).tree) for read in (read_by_lines, read_modelica))
    assert quick == whole


def contents(node):
    """A syntax tree as plain lists."""
    if isinstance(node, ast.Node):
        return [contents(v) for k, v in vars(node).items() if k not in ("parent", "scope", "id", "order")]
    if isinstance(node, dict):
        return [contents(item) for pair in node.items() for item in pair]
    return [contents(x) for x in node] if isinstance(node, list) else node
