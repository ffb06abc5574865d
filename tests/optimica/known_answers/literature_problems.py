"""Optimal-control problems of COPS 3, dymos, PSOPT and others.

COPS: Dolan, More, Munson (2004); dymos: Falck and others (2021); PSOPT: Becerra (2010); others by their authors.
"""

from typing import Any

import numpy as np

from gantrytau import Input, Model, Real, between, cos, der, sin
from gantrytau_optimica import Free, Optimization, final, initial


class Double(Model):
    """x' = v, v' = u."""

    x, v, u = Real(), Real(), Input()

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u


class BrysonDenham(Optimization):
    """The least effort under a ceiling of 1/9: 4 / (9 l) = 4."""

    cart, final_time, ceiling = Double(), 1.0, 1 / 9

    def integrand(self):
        return self.cart.u**2 / 2

    def constraints(self):
        c = self.cart
        yield from (initial(c.x) == 0, initial(c.v) == 1, final(c.x) == 0, final(c.v) == -1)
        yield c.x <= self.ceiling


class Breakwell(BrysonDenham):
    """Under a ceiling of 1/10: 40/9."""

    ceiling = 0.1


class Wire(Model):
    """A bead on a wire from (0, 10), y upwards; theta: from the vertical."""

    x, y, v = Real(start=0.0, fixed=True), Real(start=10.0, fixed=True), Real(start=0.0, fixed=True)
    theta = Input(start=1.0, min=0.0, max=np.pi)

    def equations(self):
        yield der(self.x) == self.v * sin(self.theta)
        yield der(self.y) == -self.v * cos(self.theta)
        yield der(self.v) == 9.80665 * cos(self.theta)


class Brachistochrone(Optimization):
    """dymos: 1.8016 s to (10, 5)."""

    bead, final_time = Wire(), Free(1.0, min=0.1, max=10.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.bead.x) == 10
        yield final(self.bead.y) == 5


class Sensitive(Model):
    """x' = -x^power + u."""

    x, u, power = Real(start=1.5, fixed=True), Input(), 1

    def equations(self):
        yield der(self.x) == -(self.x**self.power) + self.u


class CubicSensitive(Sensitive):
    """x' = -x^3 + u."""

    power = 3


class LinearHypersensitive(Optimization):
    """dymos: exponentials that fall from either end, in closed form."""

    plant: Any = Sensitive()
    final_time = 10.0

    def integrand(self):
        return (self.plant.x**2 + self.plant.u**2) / 2

    def constraints(self):
        yield final(self.plant.x) == 1


class CubicHypersensitive(LinearHypersensitive):
    """PSOPT: 1.330826 on its mesh."""

    plant, final_time = CubicSensitive(), 50.0


class Integrator(Model):
    """x' = u."""

    x, u = Real(start=1.5, fixed=True), Input()

    def equations(self):
        yield der(self.x) == self.u


class Hull(Optimization):
    """Hull (2003): u = -5 x0 / (1 + 5 tf)."""

    plant, final_time = Integrator(), 5.0

    def objective(self):
        return 2.5 * final(self.plant.x) ** 2

    def integrand(self):
        return self.plant.u**2 / 2


class RestToRest(Optimization):
    """A mass over 100 m with |u| <= 1: 20 s."""

    mass, final_time = Double(), Free(10.0, min=0.1)

    def objective(self):
        return self.final_time

    def constraints(self):
        m = self.mass
        yield from (initial(m.x) == -100, initial(m.v) == 0, final(m.x) == 0, final(m.v) == 0)
        yield between(-1, m.u, 1)


class Moon(Model):
    """A lander whose mass is burnt, in units of lunar gravity."""

    h, v, m = Real(start=1.0, fixed=True), Real(start=-0.783, fixed=True), Real(start=1.0, fixed=True)
    T = Input(min=0.0, max=1.227)

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -1 + self.T / self.m
        yield der(self.m) == -self.T / 2.349


class MoonLander(Optimization):
    """dymos: a mass of 0.3953 is left."""

    lander, final_time = Moon(), Free(1.0, min=0.1, max=10.0)

    def objective(self):
        return -final(self.lander.m)

    def constraints(self):
        yield final(self.lander.h) == 0
        yield final(self.lander.v) == 0


class CartPole(Model):
    """A pole of 0.3 kg and 0.5 m on a cart of 1 kg; theta from hanging."""

    x, v = Real(start=0.0, fixed=True, min=-2.0, max=2.0), Real(start=0.0, fixed=True)
    theta, w = Real(start=0.0, fixed=True), Real(start=0.0, fixed=True)
    F = Input(min=-20.0, max=20.0)

    def equations(self):
        s, c, pull = sin(self.theta), cos(self.theta), self.F + 0.15 * self.w**2 * sin(self.theta)
        det = 0.15 * c**2 - 0.65
        yield from (der(self.x) == self.v, der(self.theta) == self.w)
        yield der(self.v) == (-0.15 * 9.81 * s * c - 0.5 * pull) / det
        yield der(self.w) == (1.3 * 9.81 * s + c * pull) / det


class SwingUp(Optimization):
    """dymos, without its F(T) = 0; unstable about the upper end."""

    cart, final_time = CartPole(), 2.0

    def integrand(self):
        return self.cart.F**2

    def constraints(self):
        c = self.cart
        yield from (final(c.x) == 1, final(c.v) == 0, final(c.theta) == np.pi, final(c.w) == 0)


class Car(Model):
    """A car between two hills, too weak to climb one of them at once."""

    x, v = Real(start=-0.5, fixed=True, min=-1.2, max=0.5), Real(start=0.0, fixed=True, min=-0.07, max=0.07)
    u = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == 0.001 * self.u - 0.0025 * cos(3 * self.x)


class MountainCar(Optimization):
    """dymos: up to 0.5 in least time, by a swing to the other side."""

    car, final_time = Car(), Free(100.0, min=1.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.car.x) == 0.5


class Body(Model):
    """A rigid body with a torque about each principal axis; q: unit quaternion, its scalar last."""

    q, w = Real(4, start=[0.0, 0.0, 0.0, 1.0], fixed=True), Real(3, start=0.0, fixed=True, min=-0.5, max=0.5)
    u = Input(3, min=-50.0, max=50.0)

    def equations(self):
        (x, y, z, s), (a, b, c) = (self.q[k] for k in range(4)), (self.w[k] for k in range(3))
        yield der(self.q[0]) == (a * s - b * z + c * y) / 2
        yield der(self.q[1]) == (a * z + b * s - c * x) / 2
        yield der(self.q[2]) == (b * x - a * y + c * s) / 2
        yield der(self.q[3]) == -(a * x + b * y + c * z) / 2
        yield der(self.w[0]) == (self.u[0] - (2364 - 4547) * b * c) / 5621
        yield der(self.w[1]) == (self.u[1] - (5621 - 2364) * a * c) / 4547
        yield der(self.w[2]) == (self.u[2] - (4547 - 5621) * a * b) / 2364


class Reorientation(Optimization):
    """Fleming and others (2010), PSOPT: a turn by 150 degrees in least time; all four ends of q, of which one follows."""

    body, final_time = Body(), Free(30.0, min=25.0, max=35.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        turned = np.radians(150) / 2
        yield final(self.body.q) == [np.sin(turned), 0.0, 0.0, np.cos(turned)]
        yield final(self.body.w) == [0.0, 0.0, 0.0]
