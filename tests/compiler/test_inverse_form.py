"""Equations of motion solved for forces against the same solved for accelerations."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Model, ModelError, Real, der, translate
from gantrytau_models import (
    DeltaRobot,
    F1GantryTau,
    FourBar,
    GantryTau,
    SixLinkGantryTau,
    StewartPlatform,
    prototypes,
)
from tests.families import first_of

ROBOTS = {
    "six links": lambda: SixLinkGantryTau(prototypes.D1),
    "turntables": lambda: F1GantryTau(prototypes.F1),
    "four-bar": FourBar,
    "three links": lambda: GantryTau(prototypes.L1),
    "delta": DeltaRobot,
    "platform": StewartPlatform,
}


def rates(dae, causality, forces):
    """Rates of the states at the start under forces, by a system whose algebraics are found by Newton's method."""
    system = dae.system("lifted", causality)
    x = np.array([dae.start[s.name()] for s in system.x.elements()])
    p = np.array([dae.parameter_values[n] for n in system.parameters])
    near = np.array([dae.start.get(s.name(), 1.0) for s in system.z.elements()])
    arguments = ca.vertcat(system.x, system.u, system.p)
    equations = {"x": system.z, "p": arguments, "g": system.residuals}
    at = np.concatenate([x, forces, p])
    z = ca.rootfinder("z", "newton", equations, {"abstol": 1e-11})(near, at)
    return np.array(ca.Function("ode", [system.z, arguments], [system.ode])(z, at)).ravel()


@pytest.mark.parametrize("name", first_of(ROBOTS, 3))
def test_both_ways_give_the_same_accelerations(name):
    dae = translate(ROBOTS[name]())
    inverse = dae.system("lifted", "inverse").inverse
    assert sorted(n for one in inverse for n in one.inputs) == sorted(dae.inputs)
    forces = np.random.default_rng(3).uniform(-50.0, 50.0, len(dae.inputs))
    forwards, backwards = (rates(dae, way, forces) for way in ("forward", "inverse"))
    assert np.linalg.norm(forwards) > 1.0
    np.testing.assert_allclose(backwards, forwards, atol=1e-8 * float(np.linalg.norm(forwards)))


def test_what_is_found_together_decides():
    six, three = translate(ROBOTS["six links"]()), translate(ROBOTS["three links"]())
    (inverse,) = six.system("lifted").inverse
    assert inverse.tears < inverse.forward / 2
    assert not three.system("lifted").inverse  # the forward form is closed
    assert not six.system("lifted", "forward").inverse


class FreeArm(Model):
    """A delta robot of which one arm turns freely."""

    robot = DeltaRobot()

    def equations(self):
        yield self.robot.arms[2].tau == 0


def test_a_free_arm_is_named():
    dae = translate(FreeArm())
    assert not dae.system("lifted").inverse
    with pytest.raises(ModelError, match="3 accelerations of states and 2 inputs that drive them"):
        dae.system("lifted", "inverse")


class Measured(Model):
    """A robot whose work is a state as well: no acceleration, though forces decide its rate."""

    robot = SixLinkGantryTau(prototypes.D1)
    work = Real(unit="J", start=0.0)

    def equations(self):
        yield der(self.work) == self.robot.carts[0].f * self.robot.carts[0].v


def test_rates_that_are_no_accelerations_stay():
    (inverse,) = translate(Measured()).system("lifted").inverse
    assert "der(work)" not in inverse.rates


def test_models_without_mechanism_refuse_inverse_causality():
    class Level(Model):
        h = Real(start=1.0)

        def equations(self):
            yield der(self.h) == -self.h

    with pytest.raises(ModelError, match="causality='inverse', but nothing has an inverse form here"):
        translate(Level()).system("lifted", "inverse")
