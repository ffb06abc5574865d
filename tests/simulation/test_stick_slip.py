"""Friction that sticks exactly: what its record says, and who refuses it."""

import re

import casadi
import numpy as np
import pytest

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    check,
    connect,
    der,
    linearize,
    stick_slip,
    translate,
)
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.translational import StickSlipFriction
from gantrytau_models import GantryTau, prototypes


class Block(Model):
    """A block on a floor, pushed by a force."""

    mass = translational.Mass(m=2.0)
    push = translational.Force()
    floor = StickSlipFriction(f_c=6.0, f_v=4.0, f_s=9.0)

    def equations(self):
        yield connect(self.mass.flange, self.push.flange)
        yield connect(self.mass.flange, self.floor.flange)


class Shaft(Model):
    """A shaft in its bearing, turned by a torque."""

    rotor = rotational.Inertia(J=0.5)
    motor = rotational.Torque()
    bearing = rotational.StickSlipFriction(tau_c=3.0, tau_v=0.2)

    def equations(self):
        yield connect(self.rotor.flange_a, self.motor.flange)
        yield connect(self.rotor.flange_b, self.bearing.flange)


def laws(dae, at):
    """Coulomb, smooth and breakaway force, and the acceleration, as numbers for given states and inputs."""
    system = dae.system()
    (friction,) = dae.flat.frictions
    wanted = [friction.coulomb, friction.smooth, friction.breakaway]
    found = [*system.to_system([dae.to_reduced(e) for e in wanted]), *system.ode.elements()]
    numbers = [dae.table.values[n] for n in system.parameters]
    function = casadi.Function("laws", [system.x, system.u, system.p], [casadi.vertcat(*found)])
    return np.array(function(at[0], at[1], numbers)).ravel()


def test_the_record_gives_the_laws_of_sliding_and_sticking():
    dae = translate(Block(), events=True)
    assert dae.inputs == ("push.f",)
    assert dae.known == ("push.f", "floor.f")
    (friction,) = dae.flat.frictions
    assert (friction.force, friction.speed) == ("floor.f", "floor.v")
    assert (friction.path, friction.model) == ("floor", "StickSlipFriction")
    assert dae.states == ("mass.s", "mass.v")
    coulomb, smooth, breakaway, speed, acceleration = laws(dae, ([0.0, 0.5], [20.0, 6.0 + 4.0 * 0.5]))
    assert (coulomb, smooth, breakaway, speed) == (6.0, 2.0, 9.0, 0.5)
    assert acceleration == (20.0 - 8.0) / 2.0  # Newton's law, the friction against the speed
    assert laws(dae, ([0.0, 0.0], [7.5, 7.5]))[-1] == 0.0  # a push below the breakaway force is held


def test_breakaway_is_the_coulomb_friction_unless_given_and_may_depend_on_it():
    shaft = translate(Shaft(), events=True)
    coulomb, smooth, breakaway, _, acceleration = laws(shaft, ([0.0, -2.0], [1.0, -3.4]))
    assert (coulomb, smooth, breakaway) == pytest.approx((3.0, -0.4, 3.0))
    assert acceleration == pytest.approx((1.0 + 3.4) / 0.5)
    assert shaft.table.values["bearing.tau_s"] == 3.0


def test_the_robot_takes_it_for_its_carts():
    robot = GantryTau(prototypes.L1, friction=StickSlipFriction)
    dae = translate(robot, events=True)
    carts = range(3)
    assert dae.inputs == tuple(f"carts[{k}].f" for k in carts)
    assert dae.known == (*dae.inputs, *(f"carts[{k}].law.f" for k in carts))
    assert [f.speed for f in dae.flat.frictions] == [f"carts[{k}].law.v" for k in carts]
    assert dae.algebraics == ()
    names = ["tool.r", "tool.v", *dae.known]
    rate = dae.function(names, ["der(tool.v)"])
    plain = translate(GantryTau(prototypes.L1, friction=None)).function(names[:5], ["der(tool.v)"])
    pose, speed = [0.5, 2.8, -0.8], [0.1, -0.2, 0.3]
    slowed = np.array(rate(pose, speed, 50, 60, 70, 5, 6, 7))
    free = np.array(plain(pose, speed, 45, 54, 63))  # friction takes from the force of the motor
    assert np.allclose(slowed, free, rtol=1e-10)
    inverse = translate(robot, given=["tool.r"], events=True)
    assert inverse.known == ("tool.r[0]", "tool.r[1]", "tool.r[2]", *dae.known[3:])
    assert check(robot).mobility == 3


def test_texts_say_what_it_does():
    dae = translate(Block(), events=True)
    law = "floor.f = sign(floor.v)*floor.f_c + floor.f_v*floor.v"
    assert f"friction: {law}; at rest as floor.v = 0 needs, up to floor.f_s" in dae.equations()
    assert "at rest as floor.v = 0 needs" in dae.equations("base-modelica")
    assert r"; at rest as $\mathit{floor}.v$ = 0 needs, up to" in dae.equations("latex")
    assert "; at rest as floor.v = 0 needs, up to" in re.sub("</?a.*?>", "", dae.equations("html"))


def test_what_needs_equations_that_stay_refuses_it():
    words = r"floor \(StickSlipFriction\), stick_slip\(floor.f\): found friction that sticks, .* simulate .* TanhFriction"
    for refuse in (translate, linearize):
        with pytest.raises(ModelError, match=words):
            refuse(Block())
    with pytest.raises(ModelError, match=r"given: floor.f is set at instants"):
        translate(Block(), given=["floor.f"], events=True)


def sliding(**changes):
    """A mass with a friction stated in the model itself."""
    law = {"coulomb": 2.0, "smooth": 0.0, "breakaway": 3.0, **changes}

    class Sliding(Model):
        """A mass on a floor."""

        x = Real(unit="m", description="position", start=0.0, fixed=True)
        v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
        r = Real(2, unit="N", description="two forces")
        f = Real(unit="N", description="friction")
        normal = Real(unit="N", description="load on the floor")
        push = Input(unit="N", description="push", start=0.0)
        m = Parameter(1.0, unit="kg", description="mass")
        grip = Parameter(1.0, unit="N", description="a force")

        def equations(self):
            said = {key: value(self) if callable(value) else value for key, value in law.items()}
            yield self.v == der(self.x)
            yield self.m * der(self.v) == self.push - self.f
            yield self.r[0] == self.f
            yield self.r[1] == self.f
            yield self.normal == 10 + self.push
            yield stick_slip(**{"force": self.f, "speed": self.v, **said})

    return Sliding()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"force": lambda m: m.push}, "the force: found push, declared as input, expected a variable"),
        ({"force": lambda m: m.r}, "found 2 elements in stick_slip, expected one"),
        ({"force": lambda m: 2 * m.f}, "the force: found '(2.*f)'"),
        ({"speed": lambda m: der(m.x)}, "the speed: found der(x), a derivative, expected"),
        ({"coulomb": -1.0}, "found -1.0 and 0.0, expected coulomb >= 0 in stick_slip"),
        ({"breakaway": 1.0}, "found 1.0 and 2.0, expected breakaway >= coulomb in stick_slip"),
        ({"coulomb": lambda m: -m.grip}, "found grip = 1; expected coulomb >= 0 in stick_slip"),
        ({"coulomb": "much"}, "found coulomb 'much', expected a number or an expression of symbols"),
        ({"smooth": lambda m: m.r}, "smooth has shape (2, 1), expected (1, 1)"),
        ({"smooth": lambda m: m.v}, "stick_slip(f): units disagree in `f == v`"),
        ({"breakaway": lambda m: 9 * m.m}, "stick_slip(f): units disagree in `f == (9*m)`"),
    ],
)
def test_what_cannot_stick_is_refused_with_place_and_remedy(changes, words):
    with pytest.raises(ModelError) as caught:
        translate(sliding(**changes), events=True)
    assert words in str(caught.value)


def test_laws_may_depend_on_the_motion():
    load = {"coulomb": lambda m: 0.2 * m.normal, "breakaway": lambda m: 0.3 * m.normal}
    dae = translate(sliding(**load), events=True)
    coulomb, _, breakaway, _, acceleration = laws(dae, ([0.0, 1.0], [20.0, 3.0]))
    assert (coulomb, breakaway, acceleration) == pytest.approx((6.0, 9.0, 17.0))  # 10 N and the push of 20 N
