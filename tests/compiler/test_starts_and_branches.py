"""What is given, fixed or started is what comes out, on the branch of the start, or is told that it cannot be."""

from typing import Any, cast

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Bounds,
    Fixed,
    InitializationError,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    connect,
    cos,
    der,
    if_else,
    simulate,
    sin,
    time,
    translate,
    with_setting,
)
from gantrytau.compiler.start.consistency import _solve
from gantrytau.compiler.start.level import Level
from gantrytau.mechanics import multibody
from gantrytau.mechanics.translational import Mass
from gantrytau_models import FourBar


class Slide(Model):
    """A mass on a rail that is tilted by a parameter, on which the folded parameter of a rotation depends."""

    tilt = Parameter(0.0, unit="rad", description="tilt of the rail")
    world = multibody.World()
    turn = multibody.FixedRotation(n=[0.0, 1.0, 0.0], phi=tilt)
    rail = multibody.Prismatic(n=[1.0, 0.0, 0.0])
    mass = multibody.PointMass(m=2.0)

    def equations(self):
        yield connect(self.world.frame_b, self.turn.frame_a)
        yield connect(self.turn.frame_b, self.rail.frame_a)
        yield connect(self.rail.frame_b, self.mass.frame_a)


class Swing(Model):
    """A body on a hinge."""

    world = multibody.World()
    hinge = multibody.Revolute(n=[0.0, 1.0, 0.0], phi=Start(0.5))
    body = multibody.Body(m=2.0, r_cm=[0.0, 0.0, -0.7])

    def equations(self):
        yield connect(self.world.frame_b, self.hinge.frame_a)
        yield connect(self.hinge.frame_b, self.body.frame_a)


class Decay(Model):
    """y follows from the state by a nonlinear equation, z is its alias up to factor and offset."""

    x = Real(unit="m", start=1.0)
    y = Real(unit="1")
    z = Real(unit="m", start=-1.0)

    def equations(self):
        yield der(self.x) == -self.x
        yield self.y == self.x**2 + self.x
        yield self.z == -2 * self.x + 3


def test_given_parameters_act_through_those_that_are_folded():
    dae = translate(Slide())
    for tilt in (0.5, -0.2):
        expected = 9.81 * np.sin(tilt)
        assert float(dae.function(["tilt"], ["der(rail.v)"])(tilt)) == pytest.approx(expected, rel=1e-14)
        assert dae.evaluate({"tilt": tilt})["der(rail.v)"] == pytest.approx(expected, rel=1e-14)


def test_functions_and_evaluate_keep_to_their_branch_over_a_turn():
    dae = translate(FourBar())
    function = dae.function(["crank.phi"], ["rocker.phi"])
    start = dae.evaluate()
    for turn in (-2 * np.pi, 2 * np.pi):
        angle = start["crank.phi"] + turn
        for found in (float(function(angle)), dae.evaluate({"crank.phi": angle})["rocker.phi"]):
            # a whole turn of the crank brings the rocker back
            assert np.remainder(found - start["rocker.phi"] + 1, 2 * np.pi) == pytest.approx(1, abs=1e-9)


def test_what_no_pose_satisfies_is_nan():
    dae = translate(FourBar())
    assert np.isnan(float(dae.function(["rocker.phi"], ["crank.phi"])(0.0)))
    opened = dae.function(["crank.phi", "base.r"], ["rocker.phi"])
    assert np.isfinite(float(opened(1.3, [1.0, 0.0, 0.0])))
    assert np.isnan(float(opened(1.3, [1.0, 0.0, 0.2])))  # the second pivot lies beside the plane


def test_a_fixed_start_of_what_follows_from_a_state_moves_the_state():
    at = translate(Decay(y=Fixed(6.0)), units=False).evaluate()
    assert at["x"] == pytest.approx(2.0, abs=1e-12)


def test_a_fixed_start_of_a_constant_is_refused():
    with pytest.raises(InitializationError, match=r"body\.r\[2\]: found the fixed start 1, but it is const"):
        translate(Swing(body=dict(r=Fixed([0.0, 0.0, 1.0]))))


def test_a_start_that_loses_against_an_alias_is_told():
    moved = {m.name: (m.asked, m.found) for m in translate(Decay(), units=False).diagnosis.moved}
    assert moved == {"z": (-1.0, 1.0)}


def test_bounds_do_not_erase_a_start():
    assert translate(Swing(hinge=dict(phi=Bounds(0.1, 2.0)))).evaluate()["hinge.phi"] == 0.5


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: translate(Mass(m=Start(5.0))), "m: found a start value, but it is a parameter"),
        (lambda: Mass(cast(Any, 2.0)), r"Mass: found 2\.0 without a name, expected keywords, as Mass\(m="),
        (lambda: translate(FourBar()).evaluate({"crank.phi": "a"}), "crank.phi: found 'a', expected a"),
        (lambda: type("Bare", (Model,), dict(mass=Mass)), r"Bare\.mass is the class Mass"),
    ],
)
def test_what_would_be_lost_is_refused(build, words):
    with pytest.raises(ModelError, match=words):
        build()


def test_a_start_that_is_given_is_kept_before_those_of_the_model():
    """The bars have starts of their own, to which the crank does not fit; it comes from outside and stays."""
    for phi, model in (
        (0.5, FourBar(crank=dict(phi=Start(0.5)))),
        (1.3, FourBar().modified(dict(crank=dict(phi=Start(1.3))))),
        (2.0, with_setting(FourBar(), "crank.phi.start", 2.0)),
    ):
        dae = translate(model)
        assert dae.start["crank.phi"] == phi
        assert "crank.phi" not in {m.name for m in dae.diagnosis.moved}


class Crane(Model):
    """A load on a rope, whose length and angle start at fixed values and speeds; the balances are those of the load."""

    m = Parameter(1.0, unit="kg")
    M = Parameter(5.0, unit="kg")
    g = Parameter(9.81, unit="m/s2")
    L = Real(unit="m", start=1.0)
    theta = Real(unit="rad", start=0.1)
    x = Real(unit="m", start=0.0)
    L_rate = Real(unit="m/s", start=0.2)
    omega = Real(unit="rad/s", start=0.0)
    v = Real(unit="m/s", start=0.0)
    px, pz = Real(unit="m"), Real(unit="m")
    T = Real(unit="N", start=9.0)

    def equations(self):
        yield self.px == self.x + self.L * sin(self.theta)
        yield self.pz == -self.L * cos(self.theta)
        yield self.m * der(der(self.px)) == -self.T * sin(self.theta)
        yield self.m * der(der(self.pz)) == self.T * cos(self.theta) - self.m * self.g
        yield self.M * der(self.v) == self.T * sin(self.theta)
        yield self.T == 9.0
        yield self.L_rate == der(self.L)
        yield self.omega == der(self.theta)
        yield self.v == der(self.x)


def test_what_starts_at_a_fixed_place_with_a_fixed_speed_is_a_state():
    """The equations differentiate the load's place twice, the rope's length once; the motion is that of other states."""
    names = {"L": 1.0, "theta": 0.1, "x": 0.0, "L_rate": 0.2, "omega": 0.0, "v": 0.0}
    fixed = translate(Crane(**{name: Fixed(value) for name, value in names.items()}))
    assert set(fixed.states) == set(names)
    assert all(block.solution is not None for block in fixed.blocks)
    other = translate(Crane(**{name: Fixed(value) for name, value in names.items()}), states=["px", "pz"])
    assert {"px", "pz"} < set(other.states)
    motions = [simulate(dae, stop=1.0, points=5, tolerance=1e-10) for dae in (fixed, other)]
    assert motions[0]["L"][0] == 1.0
    for name in (*names, "px", "pz"):
        np.testing.assert_allclose(motions[0][name], motions[1][name], rtol=0, atol=1e-7)  # sums of errors


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_start_that_moves_is_told_at_every_size(size):
    class Moved(Model):
        x = Real(unit="m", start=2 * size)
        y = Real(unit="m", start=size, fixed=True)

        def equations(self):
            yield self.x == self.y
            yield der(self.y) == 0

    (moved,) = translate(Moved(), units=False).diagnosis.moved
    assert (moved.name, moved.asked, moved.found) == ("x", 2 * size, size)


def test_equations_without_a_value_before_the_initial_ones_hold():
    class Measured(Model):
        """A filter whose input is divided by its output, which starts there."""

        u = Real(start=1.0)
        y = Real()

        def equations(self):
            yield self.u == 2 + sin(time)
            yield der(self.y) == self.u / self.y - 1

        def initial_equations(self):
            yield self.y == self.u

    assert translate(Measured()).start["y"] == pytest.approx(2)


def test_an_infinite_slope_at_the_solution_is_no_obstacle_to_the_start():
    u, y, w = (ca.SX.sym(name) for name in "uyw")
    rows = (u, y + 1.5 - ca.sqrt(u), w**3 + w - 0.5 - y)
    level, values = Level(rows, ("a", "b", "c"), ("u", "y", "w"), frozenset()), dict(u=0.0, y=0.0, w=0.0)
    _solve(level, ("u", "y", "w"), values, {"y"}, "title")
    assert [values["y"], values["w"] ** 3 + values["w"]] == pytest.approx([-1.5, -1.0], rel=1e-9)


def test_a_spring_whose_length_starts_at_zero_holds_a_beam_level():  # a second: others are tried first
    class Held(Model):
        """A uniform beam of 1 kg and 1 m on a hinge, at rest by a spring of unknown constant, 0.1 m elongated."""

        phi, w, z = (Real(start=0.0, fixed=True) for _ in range(3))
        r, direction, spring, hinge = (Real(2) for _ in range(4))
        length = Real(start=0.0)
        divisor, f = Real(), Real()
        c = Real(start=1.0)

        def equations(self):
            yield der(self.phi) == self.w
            yield der(self.w) == self.z
            yield der(self.c) == 0
            yield self.r == ca.vertcat(1 - cos(self.phi), 0.2 - sin(self.phi))
            yield self.length == ca.norm_2(self.r)
            yield self.divisor == if_else(self.length > 1e-10, self.length, 1e-10)
            yield self.direction == self.r / self.divisor
            e, across = self.direction, ca.vertcat(-sin(self.phi), cos(self.phi))
            yield self.spring[0] == self.f * (cos(self.phi) * e[0] + sin(self.phi) * e[1])
            yield self.spring[1] == self.f * (across[0] * e[0] + across[1] * e[1])
            yield self.f == self.c * (self.length - 0.1)
            yield -0.5 * self.w**2 == self.spring[0] - 9.81 * sin(self.phi) + self.hinge[0]
            yield 0.5 * self.z == self.spring[1] - 9.81 * cos(self.phi) + self.hinge[1]
            yield self.z / 12 == (self.spring[1] - self.hinge[1]) / 2

    assert translate(Held()).start["c"] == pytest.approx(9.81 / 2 / 0.1)
