"""Further problems of PSOPT (Becerra, 2010) and dymos (Falck and others, 2021), with the data of their sources."""

from typing import Any

import numpy as np

from gantrytau import Input, Model, Parameter, Real, between, cos, der, exp, sin, sqrt, tanh, time
from gantrytau_optimica import Free, Optimization, at, final, initial
from tests.optimica.known_answers.literature_problems import Double, Integrator
from tests.optimica.known_answers.test_classics import Rayleigh
from tests.optimica.known_answers.test_singular import Goddard, Rocket
from tests.optimica.known_answers.test_state_constraints import Crane


class MixedRayleigh(Rayleigh):
    """PSOPT, rayleigh: a limit on state and input together."""

    final_time = 4.5

    def constraints(self):
        yield self.circuit.u + self.circuit.x1 / 6 <= 0


class Line(Model):
    """The height of a chain along a unit of distance, and its length so far."""

    x, length = Real(start=1.0, fixed=True), Real(start=0.0, fixed=True)
    slope = Input(min=-20.0, max=20.0)

    def equations(self):
        yield der(self.x) == self.slope
        yield der(self.length) == sqrt(1 + self.slope**2)


class HangingChain(Optimization):
    """COPS 3, problem 4, and PSOPT: the least potential energy of a chain of length 4; a catenary."""

    chain, final_time = Line(), 1.0

    def integrand(self):
        return self.chain.x * sqrt(1 + self.chain.slope**2)

    def constraints(self):
        yield final(self.chain.x) == 3
        yield final(self.chain.length) == 4


class Slider(Model):
    """A point in a field of gravity 1, pushed along its way by 1/2; heading from the horizontal."""

    x, y, v = Real(start=0.0, fixed=True), Real(start=0.0, fixed=True), Real(start=0.0, fixed=True)
    heading = Input()

    def equations(self):
        yield der(self.x) == self.v * cos(self.heading)
        yield der(self.y) == self.v * sin(self.heading)
        yield der(self.v) == 0.5 - sin(self.heading)


class MaximumRange(Optimization):
    """PSOPT, bryson_max_range (Bryson and Ho, 1975), by the heading whose cosine and sine are its inputs."""

    point, final_time = Slider(), 2.0

    def objective(self):
        return -final(self.point.x)

    def constraints(self):
        yield final(self.point.y) == 0.1


class Swung(Model):
    """A singular plant that time drives."""

    x1, x2, x3 = (
        Real(start=0.0, fixed=True),
        Real(start=-1.0, fixed=True),
        Real(start=-np.sqrt(5), fixed=True),
    )
    u, one = Input(min=0.0, max=10.0), Parameter(1.0, unit="s")

    def equations(self):
        yield der(self.x1) == self.x2
        yield der(self.x2) == -self.x3 * self.u + 16 * time / self.one - 8
        yield der(self.x3) == self.u


class Singular(Optimization):
    """PSOPT, singular5 (Luus, 2002): a singular arc."""

    plant, final_time = Swung(), 1.0
    one = Parameter(1.0, unit="s")

    def integrand(self):
        p = self.plant
        turn = p.x2 + 16 * time / self.one - 8 - 0.1 * p.x3 * p.u**2
        return p.x1**2 + p.x2**2 + 0.0005 * turn**2


class Masses(Model):
    """Two masses with springs and Coulomb friction, tanh(v / 0.01)."""

    q1, v1 = Real(start=0.0, fixed=True), Real(start=-1.0, fixed=True)
    q2, v2 = Real(start=0.0, fixed=True), Real(start=-2.0, fixed=True)
    u1, u2 = Input(min=-4.0, max=4.0), Input(min=-4.0, max=4.0)

    def equations(self):
        yield der(self.q1) == self.v1
        yield 1.1 * der(self.v1) == -1.8 * self.q1 + 0.85 * self.q2 - tanh(self.v1 / 0.01) + self.u1
        yield der(self.q2) == self.v2
        yield 1.2 * der(self.v2) == 0.85 * (self.q1 - self.q2) - tanh(self.v2 / 0.01) + self.u2


class TwoMasses(Optimization):
    """PSOPT, coulomb (Driessen and Sadegh, 2004): least time."""

    masses, final_time = Masses(), Free(2.0, min=1.8, max=4.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        m = self.masses
        yield from (final(m.q1) == 1, final(m.v1) == 0, final(m.q2) == 2, final(m.v2) == 0)


class CraneSwing(Optimization):
    """PSOPT, crane (Sakawa and Shindo, 1982): swing alone counts."""

    crane, final_time = Crane(), 9.0

    def integrand(self):
        return 0.5 * (self.crane.x3**2 + self.crane.x6**2)

    def constraints(self):
        c = self.crane
        ends = ((c.x1, 10), (c.x2, 14), (c.x3, 0), (c.x4, 2.5), (c.x5, 0), (c.x6, 0))
        yield from (final(x) == value for x, value in ends)


class Bent(Model):
    """x' = u - sin x, and the effort so far."""

    x, effort, u = Real(start=1.0, fixed=True), Real(start=0.0, fixed=True), Input(min=-4.0, max=4.0)

    def equations(self):
        yield der(self.x) == self.u - sin(self.x)
        yield der(self.effort) == self.u**2


class Isoperimetric(Optimization):
    """PSOPT, isoperimetric (Betts, 2010): an effort of 10."""

    plant, final_time = Bent(), 1.0

    def integrand(self):
        return self.plant.x

    def constraints(self):
        yield final(self.plant.x) == 0
        yield final(self.plant.effort) == 10


class InteriorPoint(Optimization):
    """PSOPT, interior_point (Miele, 1975): through 0.9 at three quarters; hyperbolic sines in closed form."""

    plant, final_time = Integrator(x=dict(start=1.0)), 1.0

    def integrand(self):
        return self.plant.x**2 + self.plant.u**2

    def constraints(self):
        yield at(0.75, self.plant.x) == 0.9
        yield final(self.plant.x) == 0.75


class Links(Model):
    """A robot arm of two links in the plane, in units of its own."""

    x1, x2 = Real(start=0.0, fixed=True, min=-2.0, max=2.0), Real(start=0.0, fixed=True, min=-2.0, max=2.0)
    x3, x4 = Real(start=0.5, fixed=True, min=-2.0, max=2.0), Real(start=0.0, fixed=True, min=-2.0, max=2.0)
    u1, u2 = Input(min=-1.0, max=1.0), Input(min=-1.0, max=1.0)

    def equations(self):
        s, c = sin(self.x3), cos(self.x3)
        den, pull = 31 / 36 + 9 / 4 * s**2, self.u1 - self.u2
        first = s * (9 / 4 * c * self.x1**2 + 2 * self.x2**2) + 4 / 3 * pull - 3 / 2 * c * self.u2
        second = s * (7 / 2 * self.x1**2 + 9 / 4 * c * self.x2**2) - 7 / 3 * self.u2 + 3 / 2 * c * pull
        yield der(self.x1) == first / den
        yield der(self.x2) == -second / den
        yield der(self.x3) == self.x2 - self.x1
        yield der(self.x4) == self.x1


class TwoLinkArm(Optimization):
    """PSOPT, twolinkarm (Luus, 2000): least time."""

    arm, final_time = Links(), Free(3.0, min=1.0, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        a = self.arm
        yield from (final(a.x1) == 0, final(a.x2) == 0, final(a.x3) == 0.5, final(a.x4) == 0.522)


class Farthest(Optimization):
    """dymos, double_integrator: the greatest way in 1 s from rest to rest, |u| <= 1: 1/4."""

    mass, final_time = Double(), 1.0

    def objective(self):
        return -final(self.mass.x)

    def constraints(self):
        m = self.mass
        yield from (initial(m.x) == 0, initial(m.v) == 0, final(m.v) == 0)
        yield between(-1, m.u, 1)


class Shuttle(Model):
    """A space shuttle in feet and seconds, angles in rad."""

    h = Real(start=260000.0, fixed=True, min=0.0, max=300000.0, nominal=1e5)
    phi = Real(start=np.radians(-0.5 * 75.3153), fixed=True)
    theta = Real(start=0.0, fixed=True, min=np.radians(-89.0), max=np.radians(89.0))
    v = Real(start=25600.0, fixed=True, min=1000.0, max=40000.0, nominal=1e4)
    gamma = Real(start=np.radians(-1.0), fixed=True, min=np.radians(-89.0), max=np.radians(89.0))
    psi = Real(start=np.radians(90.0), fixed=True, min=-np.pi, max=np.pi)
    alpha = Input(start=0.3, min=np.radians(-89.0), max=np.radians(89.0))
    beta = Input(start=-1.0, min=np.radians(-90.0), max=np.radians(1.0))

    def equations(self):
        degrees, mass = self.alpha * 180 / np.pi, 203000 / 32.174
        radius, level = 20902900 + self.h, self.v * cos(self.gamma)
        gravity = 0.14076539e17 / radius**2
        push = 0.5 * 0.002378 * exp(-self.h / 23800) * self.v**2 * 2690 / mass
        lift = push * (-0.20704 + 0.029244 * degrees)
        drag = push * (0.07854 - 6.1592e-3 * degrees + 6.21408e-4 * degrees**2)
        yield der(self.h) == self.v * sin(self.gamma)
        yield der(self.phi) == level * sin(self.psi) / (radius * cos(self.theta))
        yield der(self.theta) == level * cos(self.psi) / radius
        yield der(self.v) == -drag - gravity * sin(self.gamma)
        bend = cos(self.gamma) * (self.v / radius - gravity / self.v)
        yield der(self.gamma) == lift * cos(self.beta) / self.v + bend
        turn = level * sin(self.psi) * sin(self.theta) / (radius * cos(self.theta))
        yield der(self.psi) == lift * sin(self.beta) / level + turn


class Reentry(Optimization):
    """PSOPT, shuttle_reentry, and dymos (Betts, 2010): the greatest cross-range, in degrees."""

    shuttle: Any = Shuttle()
    final_time = Free(2000.0, min=100.0, max=4000.0)

    def objective(self):
        return -final(self.shuttle.theta) * 180 / np.pi

    def constraints(self):
        s = self.shuttle
        yield from (final(s.h) == 80000, final(s.v) == 2500, final(s.gamma) == np.radians(-5.0))


class Diving(Model):
    """A missile, SI; air and wings by polynomials."""

    gamma = Real(start=0.0, fixed=True, min=-np.pi / 2, max=np.pi / 2)
    v = Real(start=272.0, fixed=True, min=200.0, max=310.0, nominal=100.0)
    x = Real(start=0.0, fixed=True, min=0.0, max=10000.0, nominal=1e4)
    h = Real(start=30.0, fixed=True, min=0.0, max=1900.0, nominal=1e3)
    lift = Real(description="in weights", min=-4.0, max=4.0)
    T = Input(start=6000.0, min=1000.0, max=6000.0, nominal=1e3)
    alpha = Input(min=-0.3, max=0.3)

    def equations(self):
        s, c, weight = sin(self.alpha), cos(self.alpha), 1005 * 9.81
        push = 0.5 * (3.312e-9 * self.h**2 - 1.142e-4 * self.h + 1.224) * self.v**2 * 0.3376 / weight
        yield self.lift == 21.9 * self.alpha * push
        ahead = self.T / weight - push * (-1.9431 * self.alpha**2 - 0.1499 * self.alpha + 0.2359)
        yield der(self.gamma) == 9.81 / self.v * (ahead * s + self.lift * c - cos(self.gamma))
        yield der(self.v) == 9.81 * (ahead * c - self.lift * s - sin(self.gamma))
        yield der(self.x) == self.v * cos(self.gamma)
        yield der(self.h) == self.v * sin(self.gamma)


class Missile(Optimization):
    """PSOPT, missile (Subchan and Zbikowski, 2009): a bunt from above in least time, low until 7.5 km."""

    missile, final_time = Diving(), Free(40.0, min=10.0, max=100.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        m = self.missile
        ends = ((m.gamma, -np.pi / 2), (m.v, 310), (m.x, 10000), (m.h, 0))
        yield from (final(x) == value for x, value in ends)
        yield m.h - 15 * (1 + tanh((7500 - m.x) / 10)) >= 0


class DenseOscillator(Model):
    """Van der Pol's oscillator of dymos."""

    x0, x1, u = Real(start=1.0, fixed=True), Real(start=1.0, fixed=True), Input(min=-0.75, max=1.0)

    def equations(self):
        yield der(self.x0) == (1 - self.x1**2) * self.x0 - self.x1 + self.u
        yield der(self.x1) == self.x0


class VanDerPol(Optimization):
    """dymos, vanderpol: to rest in 15 s."""

    circuit, final_time = DenseOscillator(), 15.0

    def integrand(self):
        c = self.circuit
        return c.x0**2 + c.x1**2 + c.u**2

    def constraints(self):
        yield final(self.circuit.x0) == 0
        yield final(self.circuit.x1) == 0


class Launcher(Model):
    """A rocket of one stage over a flat earth with air, SI; theta from the horizontal."""

    x, y = Real(start=0.0, fixed=True, nominal=1e5), Real(start=0.0, fixed=True, nominal=1e5)
    vx, vy = Real(start=0.0, fixed=True, nominal=1e3), Real(start=0.0, fixed=True, nominal=1e3)
    m = Real(start=117000.0, fixed=True, min=100.0, nominal=1e4)
    theta = Input(start=0.5, min=-1.57, max=1.57)

    def equations(self):
        air, thrust = 0.5 * 0.5 * 7.069 * 1.225 * exp(-self.y / 8440), 2.1e6
        yield der(self.x) == self.vx
        yield der(self.y) == self.vy
        yield der(self.vx) == (thrust * cos(self.theta) - air * self.vx**2) / self.m
        yield der(self.vy) == (thrust * sin(self.theta) - air * self.vy**2) / self.m - 9.80665
        yield der(self.m) == -thrust / (9.80665 * 265.2)


class Ascent(Optimization):
    """dymos, ssto_earth: to 185 km and circular speed in least time."""

    rocket, final_time = Launcher(), Free(150.0, min=10.0, max=500.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        r = self.rocket
        yield from (final(r.y) == 1.85e5, final(r.vx) == 7796.6961, final(r.vy) == 0)


class AirlessGoddard(Goddard):
    """PSOPT, goddard: its drag, 310 v^2 exp(-500 h), is none."""

    rocket = Rocket(drag_factor=0.0)
