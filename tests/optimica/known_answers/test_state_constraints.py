"""Limits of states: touch points and boundary arcs of first and second order."""

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, cos, der, sin, time
from gantrytau_optimica import Free, Optimization, final, optimize
from tests.optimica.problems import FastestMass, Mass


class Bounce(Optimization):
    """Bryson and Denham (1963): from 0 to 0, speed 1 to -1 in 1, x <= limit, least effort."""

    limit = Parameter(1 / 9, unit="m", description="how far the mass may go")
    mass = Mass(x=dict(start=0.0, fixed=True), v=dict(start=1.0, fixed=True))

    def integrand(self):
        return self.mass.u**2 / 2

    def constraints(self):
        yield self.mass.x <= self.limit
        yield final(self.mass.x) == 0
        yield final(self.mass.v) == -1


def test_a_boundary_arc_of_second_order():
    # junctions at 3 l and 1 - 3 l, on a mesh of 30: cubic in between, which Radau's three points carry exactly
    assert optimize(Bounce, elements=30).objective == pytest.approx(4.0, abs=1e-6)
    # at l = 0.1 junctions at 0.3 and 0.7
    assert optimize(Bounce(limit=0.1), elements=30).objective == pytest.approx(4 / 0.9, abs=1e-6)


def test_a_touch_point():
    # 1/6 <= l <= 1/4: one contact at 1/2, cost 2 + 6 (1 - 4 l)^2, on a mesh of an even number
    for limit in (1 / 5, 0.22):
        value = optimize(Bounce(limit=limit), elements=20).objective
        assert value == pytest.approx(2 + 6 * (1 - 4 * limit) ** 2, abs=1e-6)
    # without contact u = -2
    assert optimize(Bounce(limit=0.3), elements=20).objective == pytest.approx(2.0, abs=1e-7)


def test_junctions_off_the_mesh():
    # 7 elements: error of the second order in an element's width, with either scheme
    for scheme in ("radau", "gauss"):
        assert optimize(Bounce, elements=7, scheme=scheme).objective == pytest.approx(4.0, abs=0.05)
        assert optimize(Bounce, elements=70, scheme=scheme).objective == pytest.approx(4.0, abs=1e-3)


def test_a_limit_of_the_first_order():
    class Slow(Optimization):
        """1 m in 1 s from rest to rest with v <= 1.2: linear u, rest, linear u."""

        mass = Mass(x=dict(start=0.0, fixed=True), v=dict(start=0.0, fixed=True, max=1.2))

        def integrand(self):
            return self.mass.u**2

        def constraints(self):
            yield final(self.mass.x) == 1
            yield final(self.mass.v) == 0

    # v rises as a parabola that ends level: way 2/3 T V in T; 1 = V (1 - 2 T) + 4/3 T V, cost 2 * 4/3 V^2 / T
    top = 1.2
    rise = (1 - 1 / top) / (2 / 3)
    assert rise == pytest.approx(0.25)
    optimum = optimize(Slow, elements=20)
    assert optimum.objective == pytest.approx(2 * 4 / 3 * top**2 / rise, abs=1e-6)
    t = np.linspace(0.3, 0.7, 5)
    np.testing.assert_allclose(optimum.signal("mass.v")(t), top, atol=1e-6)


def test_minimum_time_with_limits_of_speed_and_both_forces():
    class Weak(FastestMass):
        mass = Mass(u=dict(min=-2.0, max=0.5), v=dict(max=0.4))

    # 0.8 s and 0.16 m up, 0.2 s and 0.04 m down, 0.8 m at 0.4 m/s
    assert optimize(Weak, elements=60).final_time == pytest.approx(0.8 + 0.2 + 2.0, abs=1e-6)


class Damped(Model):
    """The plant of Jacobson and Lele (1969)."""

    x1 = Real(start=0.0, fixed=True)
    x2 = Real(start=-1.0, fixed=True)
    u = Input()

    def equations(self):
        yield der(self.x1) == self.x2
        yield der(self.x2) == -self.x2 + self.u


class JacobsonLele(Optimization):
    """A parabolic limit of a state, 0.16982."""

    plant = Damped()
    one = Parameter(1.0, unit="s", description="one second")

    def integrand(self):
        p = self.plant
        return p.x1**2 + p.x2**2 + 0.005 * p.u**2

    def constraints(self):
        yield self.plant.x2 <= 8 * (time / self.one - 0.5) ** 2 - 0.5


def test_a_limit_that_moves_in_time():
    # 0.16983 published to 5 digits; junctions inside of elements
    assert optimize(JacobsonLele, elements=50).objective == pytest.approx(0.16983, abs=5e-5)
    assert optimize(JacobsonLele, elements=100, points=4).objective == pytest.approx(0.169827, abs=1e-5)


class Crane(Model):
    """The container crane of Sakawa and Shindo (1982): trolley, swing, hoist; states x1 to x6."""

    x1 = Real(start=0.0, fixed=True)
    x2 = Real(start=22.0, fixed=True)
    x3 = Real(start=0.0, fixed=True)
    x4 = Real(start=0.0, fixed=True, min=-2.5, max=2.5)
    x5 = Real(start=-1.0, fixed=True, min=-1.0, max=1.0)
    x6 = Real(start=0.0, fixed=True)
    u1 = Input(min=-2.83374, max=2.83374)
    u2 = Input(min=-0.80865, max=0.71265)

    def equations(self):
        yield der(self.x1) == self.x4
        yield der(self.x2) == self.x5
        yield der(self.x3) == self.x6
        yield der(self.x4) == self.u1 + 17.2656 * self.x3
        yield der(self.x5) == self.u2
        yield der(self.x6) == -(self.u1 + 27.0756 * self.x3 + 2 * self.x5 * self.x6) / self.x2


class CraneMove(Optimization):
    """Least swing and force in 9 s, 0.0375195 (Augustin and Maurer, 2001)."""

    crane = Crane()
    final_time = 9.0

    def integrand(self):
        c = self.crane
        return 0.5 * (c.x3**2 + c.x6**2 + 0.01 * (c.u1**2 + c.u2**2))

    def constraints(self):
        c = self.crane
        yield final(c.x1) == 10
        yield final(c.x2) == 14
        yield final(c.x3) == 0
        yield final(c.x4) == 2.5
        yield final(c.x5) == 0
        yield final(c.x6) == 0


def test_container_crane():
    value = optimize(CraneMove, elements=60).objective
    assert value == pytest.approx(0.0375195, abs=1e-5)


def test_a_wall_that_depends_on_another_state():
    class Plane(Model):
        x = Real(start=-1.0, fixed=True)
        y = Real(start=0.0, fixed=True)
        heading = Input(start=0.0)

        def equations(self):
            yield der(self.x) == cos(self.heading)
            yield der(self.y) == sin(self.heading)

    class Around(Optimization):
        """The shortest way around a disc of radius 1/2: two tangents and an arc."""

        boat = Plane()
        final_time = Free(2.5, min=0.5, max=20.0)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield self.boat.x**2 + self.boat.y**2 >= 0.25
            yield final(self.boat.x) == 1
            yield final(self.boat.y) == 0

    exact = 2 * np.sqrt(1 - 0.25) + 0.5 * (np.pi - 2 * np.arccos(0.5))
    # a way around needs a guess on one side
    optimum = optimize(Around, guess={"boat.y": lambda t: 0.6 * np.sin(np.pi * t / 2.5)})
    # between collocation points the way cuts the disc a little: second order in 0.045
    assert optimum.final_time == pytest.approx(exact, abs=1e-3)
