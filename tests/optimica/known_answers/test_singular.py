"""Singular arcs, switches and bang-bang motions; tolerances follow from switches inside of elements."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import Input, Model, Parameter, Real, der, exp
from gantrytau_optimica import Free, Optimization, final, optimize
from tests.optimica.known_answers.known_problems import least, motion, zero, zeros


class Rocket(Model):
    """Goddard's rocket in units of its own (COPS 3, problem 10): 620, 500, 0.6, 3.5."""

    drag_factor = Parameter(310.0, description="drag, half of 620 by gravity and mass")
    fuel_factor = Parameter(2.0, description="mass per impulse: 1 / (0.5 sqrt(g h))")
    h = Real(start=1.0, fixed=True, min=0.99, description="distance from the centre of the earth")
    v = Real(start=0.0, fixed=True, description="speed")
    m = Real(start=1.0, fixed=True, min=0.6, description="mass")
    thrust = Input(min=0.0, max=3.5, start=1.75)

    def equations(self):
        drag = self.drag_factor * self.v**2 * exp(-500 * (self.h - 1))
        yield der(self.h) == self.v
        yield der(self.v) == (self.thrust - drag) / self.m - 1 / self.h**2
        yield der(self.m) == -self.fuel_factor * self.thrust


class Goddard(Optimization):
    """The greatest height, 1.01283 (COPS)."""

    rocket: Any = Rocket()
    final_time: Any = Free(0.2, min=0.01, max=1.0)

    def objective(self):
        return -final(self.rocket.h)

    def constraints(self):
        yield final(self.rocket.m) == 0.6


def goddard_by_its_singular_arc() -> float:
    """Full thrust, the arc on which D (1 + v / c) = m g, flight without thrust; c = 1/2 is the exhaust's speed."""

    def drag(h, v):
        return 310 * v**2 * np.exp(-500 * (h - 1))

    def surface(t, z):
        h, v, m = z
        return drag(h, v) * (1 + 2 * v) - m / h**2

    def rates(z, thrust):
        h, v, m = z
        return np.array([v, (thrust - drag(h, v)) / m - 1 / h**2, -2 * thrust])

    def singular(t, z):
        h, v, m = z
        # the surface's rate is linear in the thrust and zero on the arc
        d = drag(h, v)
        slope = np.array([-500 * d * (1 + 2 * v) + 2 * m / h**3, 2 * d / v * (1 + 2 * v) + 2 * d, -1 / h**2])
        idle, pushed = slope @ rates(z, 0.0), slope @ rates(z, 1.0)
        return rates(z, -idle / (pushed - idle))

    _, z = motion(lambda t, z: rates(z, 3.5), [1, 0, 1], 0.1, surface)
    _, z = motion(singular, list(z), 0.2, lambda t, z: z[2] - 0.6)
    return float(motion(lambda t, z: rates(z, 0.0), list(z), 0.5, lambda t, z: z[1])[1][0])


def test_goddard_with_drag():
    top = goddard_by_its_singular_arc()
    assert top == pytest.approx(1.01283, abs=1e-5)  # COPS
    # three arcs, whose ends lie inside of elements: second order in an element of 0.002
    assert -optimize(Goddard, elements=100).objective == pytest.approx(top, abs=1e-5)


def test_goddard_without_drag():
    """Full thrust until the fuel is spent, then a free flight, whose energy gives the height."""
    spent = 0.4 / 7
    _, (h, v, _) = motion(lambda t, z: [z[1], 3.5 / z[2] - 1 / z[0] ** 2, -7.0], [1, 0, 1], spent)
    top = 1 / (1 / h - v**2 / 2)
    optimum = optimize(Goddard(rocket=dict(drag_factor=0.0)))
    # one switch inside of an element of 0.01
    assert -optimum.objective == pytest.approx(top, abs=2e-4)


class Tube(Model):
    """Two catalysts along a tube, COPS 3, problem 14; u is the share of the first."""

    x1 = Real(start=1.0, fixed=True)
    x2 = Real(start=0.0, fixed=True)
    u = Input(min=0.0, max=1.0, start=0.5)

    def equations(self):
        yield der(self.x1) == self.u * (10 * self.x2 - self.x1)
        yield der(self.x2) == self.u * (self.x1 - 10 * self.x2) - (1 - self.u) * self.x2


class CatalystMixing(Optimization):
    """The most of the third substance, von Stryk (1999)."""

    tube = Tube()

    def objective(self):
        return final(self.tube.x1) + final(self.tube.x2) - 1


def catalyst_by_switches() -> float:
    """Full, singular and no mixing, the switches and the constant share sought directly."""

    def value(p):
        t1, t2, u = p
        z = np.array([1.0, 0.0])
        for share, span in ((1.0, t1), (u, t2 - t1), (0.0, 1 - t2)):
            a = np.array([[-share, 10 * share], [share, -10 * share - (1 - share)]])
            z = expm(a * span) @ z
        return z.sum() - 1

    return least(value, [0.136, 0.725, 0.227])


def test_catalyst_mixing():
    value = catalyst_by_switches()
    # on the singular arc the share is constant; COPS: 0.0480557 on its mesh
    assert value == pytest.approx(-0.0480557, abs=2e-6)
    optimum = optimize(CatalystMixing, elements=100)
    assert optimum.objective == pytest.approx(value, abs=2e-6)


class Sliding(Model):
    """A double integrator with bounded force (Jacobson, Gershwin and Lele, 1970)."""

    x = Real(start=0.0, fixed=True)
    v = Real(start=1.0, fixed=True)
    u = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u


class Regulator(Optimization):
    """Least squares of place and speed in 5: u = -1, then the singular u = x."""

    mass = Sliding()
    final_time = 5.0

    def integrand(self):
        return (self.mass.x**2 + self.mass.v**2) / 2


def test_a_singular_regulator():
    # on the arc x = A cosh(t - 5), v = A sinh(t - 5); before x = t - t^2 / 2, v = 1 - t
    def off(t):
        return (1 - t) - (t - t**2 / 2) * np.tanh(t - 5)

    switch = zero(off, 1.0, 2.0)
    amplitude = (switch - switch**2 / 2) / np.cosh(switch - 5)
    first = np.polynomial.Polynomial([0, 1, -0.5]) ** 2 + np.polynomial.Polynomial([1, -1]) ** 2
    cost = first.integ()(switch) / 2 + amplitude**2 * np.sinh(2 * (5 - switch)) / 4
    optimum = optimize(Regulator, elements=100)
    assert optimum.objective == pytest.approx(cost, abs=1e-4)  # the switch inside of an element of 0.05


class Fish(Model):
    """Prey and predators, both fished (Sager, 2005)."""

    prey = Real(start=0.5, fixed=True)
    hunters = Real(start=0.7, fixed=True)
    boats = Input(min=0.0, max=1.0, start=0.5)

    def equations(self):
        yield der(self.prey) == self.prey * (1 - self.hunters - 0.4 * self.boats)
        yield der(self.hunters) == self.hunters * (-1 + self.prey - 0.2 * self.boats)


class Fishing(Optimization):
    """Bring both to 1; relaxed control, 1.34408."""

    sea = Fish()
    final_time = 12.0

    def integrand(self):
        return (self.sea.prey - 1) ** 2 + (self.sea.hunters - 1) ** 2


def test_fishing():
    # Sager (2005): 1.34408 for the relaxed control, finest mesh; two switches inside of elements
    assert optimize(Fishing, elements=100).objective == pytest.approx(1.34408, abs=3e-5)


class Reactor(Model):
    """Fed-batch fermentation of penicillin-like product with a growth law that has a best concentration."""

    x = Real(start=1.0, fixed=True, description="cells")
    s = Real(start=0.5, fixed=True, min=0.0, description="substrate in excess")
    feed = Input(min=0.0, max=10.0, start=1.0)

    def equations(self):
        growth = self.s / (1 + self.s + self.s**2)
        yield der(self.x) == growth * self.x
        yield der(self.s) == self.feed - growth * self.x


class Grown(Optimization):
    """The most cells after 2: feed at once to the best concentration and hold it there."""

    tank = Reactor()
    final_time = 2.0

    def objective(self):
        return -final(self.tank.x)


def test_fed_batch_on_its_best_concentration():
    # growth is fastest at s = 1, with rate 1/3; until then the feed is full
    def filling(t, z):
        x, s = z
        growth = s / (1 + s + s**2)
        return [growth * x, 10 - growth * x]

    filled, (x, _) = motion(filling, [1, 0.5], 1.0, lambda t, z: z[1] - 1)
    cells = x * np.exp((2 - filled) / 3)
    optimum = optimize(Grown, elements=100)
    assert -optimum.objective == pytest.approx(cells, abs=1e-4)  # the switch inside of an element of 0.02


class Cart(Model):
    """A harmonic oscillator with bounded force."""

    x = Real(start=3.0, fixed=True)
    v = Real(start=0.0, fixed=True)
    u = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -self.x + self.u


class Quieted(Optimization):
    """Bushaw's problem: an oscillator to rest in least time."""

    cart = Cart()
    final_time = Free(4.0, min=0.5, max=20.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.cart.x) == 0
        yield final(self.cart.v) == 0


def test_an_oscillator_to_rest():
    # clockwise about (-1, 0), half a turn about (1, 0), and about (-1, 0) again into the origin
    def end(p):
        z = 3 + 0j
        for centre, span in ((-1.0, p[0]), (1.0, np.pi), (-1.0, p[1])):
            z = centre + (z - centre) * np.exp(-1j * span)
        return [z.real, z.imag]

    first, last = zeros(end, [0.3, 1.0])
    assert 0 < first < np.pi
    assert 0 < last < np.pi
    duration = first + np.pi + last
    # one search in three ends where the conditions contradict each other nearby, on some processors and not on others
    assert optimize(Quieted, elements=100, starts=3).final_time == pytest.approx(duration, abs=2e-3)
