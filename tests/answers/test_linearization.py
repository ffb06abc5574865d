"""Linear systems against analytic ones, and against finite differences of the nonlinear model."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import (
    GantryTauError,
    InitializationError,
    Input,
    Model,
    Output,
    Parameter,
    Real,
    StructureError,
    connect,
    der,
    linearize,
    simulate,
    sin,
    sqrt,
    translate,
)
from gantrytau.mechanics.translational import Damper, Fixed, Force, Mass, Position, Spring
from gantrytau_models import GantryTau, Pendulum, prototypes

FORCES = [f"carts[{i}].f" for i in range(3)]
POSES = [[0.5, 3.0, -0.6], [0.85, 2.98, -0.63], [1.2, 2.7, -0.3]]


class Oscillator(Model):
    """A mass between a wall and a force, on a spring and a damper."""

    m = Parameter(2.0, unit="kg", description="mass")
    wall = Fixed()
    mass = Mass(m=m)
    spring = Spring(c=50.0, s_rel0=0.3)
    damper = Damper(d=3.0)
    force = Force()
    pull = Output(unit="N", description="force of the spring")

    def equations(self):
        for part in (self.spring, self.damper):
            yield connect(self.wall.flange, part.flange_a)
            yield connect(part.flange_b, self.mass.flange)
        yield connect(self.force.flange, self.mass.flange)
        yield self.pull == self.spring.f


class Torricelli(Model):
    """A tank that empties through a hole; the outflow is a root of the level."""

    h = Real(unit="m", description="level", start=0.3)
    q = Real(unit="m/s", description="outflow per area")
    inflow = Input(unit="m/s", description="inflow per area", start=0.2)
    c = Parameter(0.5, unit="m/s", description="outflow per area at the level h_0")
    h_0 = Parameter(1.0, unit="m", description="level")

    def equations(self):
        yield der(self.h) == self.inflow - self.q
        yield self.q == self.c * sqrt(self.h / self.h_0)


class Kepler(Model):
    """M = E - e sin E has no closed form: E is an algebraic unknown."""

    E = Real(unit="rad", description="eccentric anomaly", start=0.5)
    M = Real(unit="rad", description="mean anomaly")
    e = Parameter(0.3, unit="1", description="eccentricity")
    w = Input(unit="rad/s", description="rate of the mean anomaly", start=1.0)

    def equations(self):
        yield der(self.M) == self.w
        yield self.M == self.E - self.e * sin(self.E)


class Guided(Model):
    """A mass on a damper behind a point whose position is given."""

    guide = Position()
    spring = Spring(c=10.0)
    damper = Damper(d=2.0)
    mass = Mass(m=1.0)

    def equations(self):
        for part in (self.spring, self.damper):
            yield connect(self.guide.flange, part.flange_a)
            yield connect(part.flange_b, self.mass.flange)


@pytest.fixture(scope="module")
def robot():
    return translate(GantryTau(dataclasses.replace(prototypes.L1, link_masses=(1.0, 2.0, 3.0))))


def test_oscillator_has_the_matrices_of_the_textbook():
    linear = linearize(translate(Oscillator(), states=["mass.s", "mass.v"]))
    assert linear.states == ("mass.s", "mass.v")
    assert linear.inputs == ("force.f",)
    assert linear.outputs == ("pull",)
    np.testing.assert_allclose(linear.A, [[0, 1], [-50 / 2, -3 / 2]], atol=1e-14)
    np.testing.assert_allclose(linear.B, [[0], [1 / 2]], atol=1e-14)
    np.testing.assert_allclose(linear.C, [[50, 0]], atol=1e-14)
    np.testing.assert_allclose(linear.D, [[0]], atol=1e-14)
    poles = linear.poles
    np.testing.assert_allclose(poles, np.roots([2, 3, 50])[::-1], rtol=1e-14)


def test_parameters_and_outputs_are_chosen_by_name():
    linear = linearize(Oscillator(), parameters={"m": 4.0}, outputs=["der(mass.v)", "spring.f"], inputs=[])
    np.testing.assert_allclose(linear.C, [[-12.5, -0.75], [50, 0]], atol=1e-13)
    assert linear.outputs == ("der(mass.v)", "spring.f")
    assert linear.B.shape == (2, 0)
    assert linear.D.shape == (2, 0)


def test_steady_state_of_the_oscillator_balances_the_given_force():
    linear = linearize(Oscillator(), at={"force.f": 10.0}, steady=True)
    assert linear.point["mass.s"] == pytest.approx(0.3 + 10.0 / 50.0, rel=1e-12)
    assert linear.point["mass.v"] == 0.0
    held = linearize(Oscillator(), at={"mass.s": 0.4}, steady=True)
    assert held.point["force.f"] == pytest.approx(5.0, rel=1e-12)


def test_pendulum_at_rest_has_its_eigenfrequency():
    linear = linearize(Pendulum(L=0.7), steady=True)
    assert linear.point["y"] == pytest.approx(-0.7, rel=1e-12)
    # at its lowest the height is no coordinate, whatever it was at the start
    assert linear.states == ("x", "v_x")
    poles = linear.poles
    np.testing.assert_allclose(np.imag(poles), [-np.sqrt(9.81 / 0.7), np.sqrt(9.81 / 0.7)], rtol=1e-12)
    np.testing.assert_allclose(np.real(poles), 0.0, atol=1e-12)
    upright = linearize(Pendulum(), at={"x": 0.0, "y": 1.0}, steady=True)
    np.testing.assert_allclose(upright.poles, [-np.sqrt(9.81), np.sqrt(9.81)], rtol=1e-12)


def test_pendulum_in_motion_follows_the_equation_of_the_angle():
    # y'' = -g - (v^2 - g y) y / L^2 from the tension, with v^2 = v_y^2 L^2 / (L^2 - y^2)
    y, v, g = -0.6, 0.9, 9.81
    linear = linearize(translate(Pendulum(), states=["y", "v_y"]), at={"x": 0.8, "y": y, "v_y": v})
    by_y = 2 * g * y - v**2 * (1 + y**2) / (1 - y**2) ** 2
    by_v = -2 * v * y / (1 - y**2)
    np.testing.assert_allclose(linear.A, [[0, 1], [by_y, by_v]], rtol=1e-12, atol=1e-14)


def test_tank_and_anomaly_have_their_derivatives():
    tank = linearize(Torricelli(), steady=True, outputs=["q"])
    assert tank.point["h"] == pytest.approx(0.16, rel=1e-12)
    np.testing.assert_allclose(tank.A, [[-0.5 / 2 / 0.4]], rtol=1e-12)
    anomaly = linearize(Kepler(), outputs=["E"], at={"M": 1.1 - 0.3 * np.sin(1.1)})
    assert anomaly.states == ("M",)
    np.testing.assert_allclose(anomaly.C, [[1 / (1 - 0.3 * np.cos(1.1))]], rtol=1e-12)
    np.testing.assert_array_equal(anomaly.B, [[1.0]])


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("steady", [True, False])
def test_robot_against_finite_differences(robot, pose, steady):
    at = {"tool.r": pose} if steady else {"tool.r": pose, "tool.v": [0.3, -0.2, 0.1], "carts[1].f": 200.0}
    outputs = ["carts[2].s", "der(carts[0].v)", "arms[1].link.tension"]
    linear = linearize(robot, at=at, steady=steady, outputs=outputs)
    assert linear.states == (*(f"tool.r[{i}]" for i in range(3)), *(f"tool.v[{i}]" for i in range(3)))
    point = linear.point
    function = robot.function(["tool.r", "tool.v", *FORCES], ["tool.v", "der(tool.v)", *outputs])

    def value(x):
        results = function(x[:3], x[3:6], *x[6:])
        return np.concatenate([np.array(r).ravel() for r in results])

    centre = np.concatenate([point["tool.r"], point["tool.v"], [point[n] for n in FORCES]])
    found = np.block([[linear.A, linear.B], [linear.C, linear.D]])
    for j, width in enumerate([1e-5] * 3 + [1e-4] * 3 + [1e-2] * 3):
        step = np.zeros(9)
        step[j] = width
        # the fourth-order difference leaves rounding, 1e-16 of the value over the width
        near, far = (value(centre + k * step) - value(centre - k * step) for k in (1, 2))
        slope = (8 * near - far) / (12 * width)
        assert np.abs(found[:, j] - slope).max() < 1e-6 * max(1.0, np.abs(slope).max())
    if steady:
        np.testing.assert_array_equal(point["tool.v"], 0.0)
        assert np.abs(value(centre)[:6]).max() < 1e-10
        np.testing.assert_allclose(point["tool.r"], pose, rtol=0, atol=0)


def test_robot_falls_as_its_linear_system_says(robot):
    pose, push, stop = POSES[0], 1e-3, 0.05
    linear = linearize(robot, at={"tool.r": pose}, steady=True, outputs=["carts[0].s"])
    forces = {n: linear.point[n] for n in FORCES}
    inputs = {**forces, FORCES[0]: forces[FORCES[0]] + push}
    found = simulate(robot.with_starts({"tool.r": pose}), stop=stop, inputs=inputs, tolerance=1e-12)
    # x' = A x + B u from rest with constant u: the exponential of [[A, B u], [0, 0]]
    big = np.zeros((7, 7))
    big[:6, :6], big[:6, 6] = linear.A, linear.B[:, 0] * push
    expected = expm(big * stop)[:6, 6]
    moved = found.final("tool.r") - np.array(pose)
    # 1e-3 N move the tool by some 1e-9 m: what is left is the tolerance of the integrator
    assert np.abs(moved - expected[:3]).max() < 1e-3 * np.abs(expected[:3]).max()


def test_linear_system_prints_itself_with_names():
    text = str(linearize(Oscillator()))
    for part in (
        "der(mass.v)",
        "force.f",
        "poles, 1/s: -0.75-4.943j (0.7958 Hz, damping 0.15), -0.75+4.943j",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(inputs=["force.g"]), "has no variable or parameter 'force.g'; did you mean 'force.f'"),
        (dict(inputs=["mass.s"]), "inputs: mass.s is not an input of Oscillator; there is force.f"),
        (dict(outputs=["mass.t"]), "has no variable or parameter 'mass.t'"),
        (dict(outputs="mass.s"), "found the text 'mass.s', expected a list of names"),
        (dict(at={"m": 3.0}), "at: m is a parameter of Oscillator; give it in parameters="),
        (dict(at={"m": 3.0}, steady=True), "at: m is a parameter of Oscillator; give it in parameters="),
        (dict(parameters={"mass.s": 3.0}), "parameters: mass.s is a variable of Oscillator; give it in at="),
        (dict(at={"mass.v": 1.0}, steady=True), "at: mass.v is 1, but at rest it is 0; leave it out"),
        (dict(at={"mass.s": 0.1, "spring.f": 3.0}), "no consistent start|contradicts|cannot"),
    ],
)
def test_wrong_requests_are_refused(options, words):
    with pytest.raises(GantryTauError, match=words):
        linearize(Oscillator(), **options)


class Faint(Model):
    """An output of 1e-12 times the rate of an input."""

    u = Input(start=0.0)
    x = Real(start=0.0, fixed=True)
    y = Real()

    def equations(self):
        yield der(self.x) == self.u - self.x
        yield self.y == 1e-12 * (self.x + der(self.u))


@pytest.mark.parametrize(
    ("model", "options", "words"),
    [
        (Kepler, dict(at={"w": 1.0}, steady=True), r"steady state of Kepler: .*equation 1 is off by .* w"),
        (Torricelli, dict(at={"h": 0.0}), "derivatives of its equations are not finite at the operating"),
        # dM/dE = 1 - e cos E vanishes
        (Kepler, dict(at={"E": 0.0, "w": 0.0}, parameters={"e": 1.0}), "singular at the operating point:"),
        (Guided, dict(), "der.mass.v. depends on der.guide.s., the derivative of an input, which A, B, C, D"),
        (Faint, dict(outputs=["y"]), r"y depends on der\(u\)"),  # however small the factor
    ],
)
def test_points_at_which_there_is_no_linear_system(model, options, words):
    with pytest.raises((InitializationError, StructureError), match=words):
        linearize(model(), **options)
