"""Classics of optimal control: published or analytic values, smooth solutions to 1e-6."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from gantrytau import Input, Model, Parameter, Real, cos, der, exp, sin, sqrt
from gantrytau_optimica import Free, Optimization, final, optimize
from tests.optimica.known_answers.known_problems import zero


class Bead(Model):
    """A bead that slides on a wire without friction, y downwards."""

    g = Parameter(9.81, unit="m/s2", description="acceleration of gravity")
    x = Real(unit="m", start=0.0, fixed=True, description="across")
    y = Real(unit="m", start=0.0, fixed=True, description="down")
    v = Real(unit="m/s", start=0.0, fixed=True, description="speed")
    slope = Input(unit="rad", start=0.8, min=0.0, max=3.2, description="angle of the wire from the vertical")

    def equations(self):
        yield der(self.x) == self.v * sin(self.slope)
        yield der(self.y) == self.v * cos(self.slope)
        yield der(self.v) == self.g * cos(self.slope)


class Brachistochrone(Optimization):
    """Johann Bernoulli (1696): the fastest wire to a point 2 m across and 1 m down."""

    bead = Bead()
    final_time = Free(1.0, unit="s", min=0.1, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.bead.x) == 2
        yield final(self.bead.y) == 1


def test_the_brachistochrone_is_a_cycloid():
    turn = zero(lambda a: (a - np.sin(a)) - 2 * (1 - np.cos(a)), 1.0, 6.0)
    duration = turn * np.sqrt(1 / (1 - np.cos(turn)) / 9.81)
    optimum = optimize(Brachistochrone)
    assert optimum.final_time == pytest.approx(duration, abs=1e-6)
    # the angle of a cycloid grows linearly in time, to half of the turn
    t = np.linspace(0.1, 0.9, 9) * duration
    np.testing.assert_allclose(optimum.signal("bead.slope")(t), turn / 2 * t / duration, atol=1e-4)


class Lander(Model):
    """A vehicle over the moon, in units of lunar gravity 1.5."""

    h = Real(start=10.0, fixed=True, min=0.0, description="height")
    v = Real(start=-2.0, fixed=True, description="speed upwards")
    u = Input(min=0.0, max=3.0, description="thrust")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == self.u - 1.5


class MoonLanding(Optimization):
    """Meditch (1964): land softly with the least fuel; fall, then brake."""

    lander = Lander()
    final_time = Free(4.0, min=0.1, max=20.0)

    def integrand(self):
        return self.lander.u

    def constraints(self):
        yield final(self.lander.h) == 0
        yield final(self.lander.v) == 0


def test_moon_landing():
    # fall for s, brake at 1.5 until rest: v = -2 - 1.5 s, h = 10 - 2 s - 0.75 s^2 = v^2 / 3
    fall = zero(lambda s: 10 - 2 * s - 0.75 * s**2 - (2 + 1.5 * s) ** 2 / 3, 0.0, 3.0)
    brake = (2 + 1.5 * fall) / 1.5
    optimum = optimize(MoonLanding)
    # the fuel is the change of speed, gravity included, so it errs as the duration does: second order in the
    # element of the switch, 0.08 wide
    assert optimum.objective == pytest.approx(3 * brake, abs=2e-3)
    assert optimum.final_time == pytest.approx(fall + brake, abs=2e-3)
    assert optimum.objective == pytest.approx(2 + 1.5 * optimum.final_time, abs=1e-7)


class Particle(Model):
    """A particle pushed by a force of constant size."""

    x = Real(start=0.0, fixed=True)
    y = Real(start=0.0, fixed=True)
    v_x = Real(start=0.0, fixed=True)
    v_y = Real(start=0.0, fixed=True)
    angle = Input(min=-np.pi / 2, max=np.pi / 2)

    def equations(self):
        yield der(self.x) == self.v_x
        yield der(self.y) == self.v_y
        yield der(self.v_x) == 100 * cos(self.angle)
        yield der(self.v_y) == 100 * sin(self.angle)


class ParticleSteering(Optimization):
    """Bryson and Ho (1975), section 2.4; COPS 3: to height 5 and speed (45, 0) in least time."""

    particle = Particle()
    final_time = Free(1.0, min=0.01, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        p = self.particle
        yield final(p.v_x) == 45
        yield final(p.y) == 5
        yield final(p.v_y) == 0


def test_particle_steering():
    assert optimize(ParticleSteering).final_time == pytest.approx(0.554570879, abs=1e-6)


class Arm(Model):
    """A robot arm of three joints in spherical coordinates, COPS 3, arm length 5."""

    rho = Real(start=4.5, fixed=True)
    rho_v = Real(start=0.0, fixed=True)
    theta = Real(start=0.0, fixed=True)
    theta_v = Real(start=0.0, fixed=True)
    phi = Real(start=np.pi / 4, fixed=True)
    phi_v = Real(start=0.0, fixed=True)
    u = Input(3, min=-1.0, max=1.0)

    def equations(self):
        rho, phi = self.rho, self.phi
        inertia = ((5 - rho) ** 3 + rho**3) / 3
        yield der(rho) == self.rho_v
        yield der(self.theta) == self.theta_v
        yield der(phi) == self.phi_v
        yield 5 * der(self.rho_v) == self.u[0]
        yield inertia * sin(phi) ** 2 * der(self.theta_v) == self.u[1]
        yield inertia * der(self.phi_v) == self.u[2]


class RobotArm(Optimization):
    """COPS 3, problem 8 (Moessner-Beigel): a turn of 120 degrees in least time, 9.14093."""

    arm = Arm()
    final_time = Free(5.0, min=1.0, max=50.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        a = self.arm
        yield final(a.rho) == 4.5
        yield final(a.theta) == 2 * np.pi / 3
        yield final(a.phi) == np.pi / 4
        for speed in (a.rho_v, a.theta_v, a.phi_v):
            yield final(speed) == 0


def test_robot_arm():
    # 9.14093 to the switching times, which lie inside of elements: third digit of an element's square
    assert optimize(RobotArm).final_time == pytest.approx(9.14093, abs=2e-3)
    finer = optimize(RobotArm, elements=100)
    assert finer.final_time == pytest.approx(9.14093, abs=5e-4)


class Circuit(Model):
    """The tunnel-diode oscillator of Rayleigh."""

    x1 = Real(start=-5.0, fixed=True, description="current")
    x2 = Real(start=-5.0, fixed=True)
    u = Input()

    def equations(self):
        yield der(self.x1) == self.x2
        yield der(self.x2) == -self.x1 + self.x2 * (1.4 - 0.14 * self.x2**2) + 4 * self.u


class Rayleigh(Optimization):
    """Betts (2010), problem rayl01: least squares of current and control in 2.5."""

    circuit = Circuit()
    final_time = 2.5

    def integrand(self):
        return self.circuit.u**2 + self.circuit.x1**2


def rayleigh_by_pontryagin() -> float:
    """The cost by Pontryagin's conditions: u = -2 lambda2, costates zero at the end, a boundary value problem."""

    def rates(t, z):
        x1, x2, l1, l2, _ = z
        u = -2 * l2
        cubic = x2 * (1.4 - 0.14 * x2**2)
        return np.array(
            [x2, -x1 + cubic + 4 * u, -2 * x1 + l2, -l1 - l2 * (1.4 - 0.42 * x2**2), u**2 + x1**2]
        )

    def ends(start, end):
        return np.array([start[0] + 5, start[1] + 5, start[4], end[2], end[3]])

    grid = np.linspace(0.0, 2.5, 51)
    first = np.zeros((5, grid.size))
    first[0] = -5 + 2 * grid
    found = solve_bvp(rates, ends, grid, first, tol=1e-9, max_nodes=20000)
    assert found.success
    return float(found.y[4, -1])


def test_rayleigh():
    value = rayleigh_by_pontryagin()
    assert value == pytest.approx(29.376, abs=1e-3)  # as published
    # the first motion is quick: 0.1 s of 2.5; the error falls with a high power of the element
    coarse = abs(optimize(Rayleigh, elements=25).objective - value)
    fine = abs(optimize(Rayleigh, elements=50).objective - value)
    assert fine < 1e-4
    assert np.log2(coarse / fine) > 4
    assert optimize(Rayleigh, elements=60, points=6).objective == pytest.approx(value, abs=1e-6)


def test_rayleigh_with_a_limit_on_state_and_control():
    class Mixed(Rayleigh):
        final_time = 4.5

        def constraints(self):
            yield self.circuit.u + self.circuit.x1 / 6 <= 0

    # Maurer and Augustin (2001): 44.8044; the junctions lie inside of elements
    assert optimize(Mixed, elements=100).objective == pytest.approx(44.8044, abs=1e-4)


class Glider(Model):
    """A hang glider in a thermal upwind, Bulirsch and others (1993) in the figures of Betts (2010)."""

    x = Real(start=0.0, fixed=True, min=0.0)
    y = Real(start=1000.0, fixed=True)
    v_x = Real(start=13.227567500, fixed=True, min=1.0)
    v_y = Real(start=-1.2875005200, fixed=True)
    lift = Input(min=0.0, max=1.4, start=0.7)

    def equations(self):
        r = (self.x / 100 - 2.5) ** 2
        upwind = 2.5 * (1 - r) * exp(-r)
        w = self.v_y - upwind
        v = sqrt(self.v_x**2 + w**2)
        drag = 0.5 * (0.034 + 0.069662 * self.lift**2) * 1.13 * 14 * v
        force = 0.5 * self.lift * 1.13 * 14 * v
        yield der(self.x) == self.v_x
        yield der(self.y) == self.v_y
        yield 100 * der(self.v_x) == -force * w - drag * self.v_x
        yield 100 * der(self.v_y) == force * self.v_x - drag * w - 100 * 9.80665


class HangGlider(Optimization):
    """The greatest distance until 900 m, 1248.031."""

    glider: Any = Glider()
    final_time: Any = Free(100.0, min=10.0, max=200.0)

    def objective(self):
        return -final(self.glider.x)

    def constraints(self):
        yield final(self.glider.y) == 900
        yield final(self.glider.v_x) == 13.227567500
        yield final(self.glider.v_y) == -1.2875005200


def test_hang_glider():
    optimum = optimize(HangGlider, elements=100, guess={"glider.x": lambda t: 12.5 * t})
    # the lift meets its limits inside of elements of 1 s: 0.011 m at 50 elements, 0.0006 m at 100
    assert -optimum.objective == pytest.approx(1248.03103, abs=2e-3)
