"""Problems without motion: free numbers and algebraic variables only, with known minima."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, cos, der, log, sin, sqrt
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.known_answers.known_problems import least
from tests.optimica.problems import Mass


class Rosenbrock(Optimization):
    """The banana function of two free numbers."""

    x = Free(-1.2, description="first number")
    y = Free(1.0, description="second number")

    def objective(self):
        return (1 - self.x) ** 2 + 100 * (self.y - self.x**2) ** 2


def test_free_numbers_alone():
    optimum = optimize(Rosenbrock)
    assert optimum["x"] == pytest.approx(1.0, abs=1e-6)
    assert optimum["y"] == pytest.approx(1.0, abs=1e-6)
    assert optimum.objective == pytest.approx(0.0, abs=1e-10)


def test_free_numbers_in_a_disc():
    class InDisc(Rosenbrock):
        x = Free(0.0)
        y = Free(0.0)

        def constraints(self):
            yield self.x**2 + self.y**2 <= 2

    # the minimum (1, 1) lies on the rim of x^2 + y^2 <= 2 (a documented test function of optimisers)
    assert optimize(InDisc).objective == pytest.approx(0.0, abs=1e-6)

    class InSmallDisc(Rosenbrock):
        x = Free(0.5)
        y = Free(0.5)

        def constraints(self):
            yield self.x**2 + self.y**2 <= 1

    # 0.0456748 at (0.7864, 0.6177): on the rim the angle is searched
    assert optimize(InSmallDisc).objective == pytest.approx(_on_the_unit_circle(), abs=1e-7)


def _on_the_unit_circle() -> float:
    """The least value of the banana function on the unit circle, by a search over the angle."""

    def value(angle):
        x, y = np.cos(angle[0]), np.sin(angle[0])
        return (1 - x) ** 2 + 100 * (y - x**2) ** 2

    return least(value, [0.7])


class HockSchittkowski71(Optimization):
    """Problem 71 of Hock and Schittkowski (1981): 17.0140173 at (1, 4.743, 3.8211, 1.3794)."""

    a = Free(1.0, min=1.0, max=5.0)
    b = Free(5.0, min=1.0, max=5.0)
    c = Free(5.0, min=1.0, max=5.0)
    d = Free(1.0, min=1.0, max=5.0)

    def objective(self):
        return self.a * self.d * (self.a + self.b + self.c) + self.c

    def constraints(self):
        yield self.a * self.b * self.c * self.d >= 25
        yield self.a**2 + self.b**2 + self.c**2 + self.d**2 == 40


def test_bounds_and_both_kinds_of_constraints():
    optimum = optimize(HockSchittkowski71)
    assert optimum.objective == pytest.approx(17.0140172892, abs=1e-6)  # the tolerance of Ipopt
    assert optimum.free == pytest.approx({"a": 1.0, "b": 4.7429996, "c": 3.8211500, "d": 1.3794083}, abs=1e-5)


class Rod(Model):
    """A weightless arm with a hanging load and a horizontal spring: equilibrium is an implicit equation."""

    load = Parameter(1.0, description="weight of the load times length")
    stiffness = Parameter(2.0, description="stiffness of the spring times length squared")
    angle = Real(start=0.5, description="angle from the vertical")

    def equations(self):
        yield self.stiffness * sin(self.angle) * cos(self.angle) == self.load * cos(self.angle) / 2 + (
            0.1 * self.angle
        )


def test_an_equilibrium_of_algebraic_variables():
    class Level(Optimization):
        """The load at which the arm rests at 0.4 rad."""

        arm = Rod(load=Free(0.5))

        def objective(self):
            return (final(self.arm.angle) - 0.4) ** 2

    load = (2 * np.sin(0.4) * np.cos(0.4) - 0.04) / (np.cos(0.4) / 2)
    optimum = optimize(Level, elements=1, points=1)
    assert optimum["arm.load"] == pytest.approx(load, abs=1e-4)  # the root of the tolerance: a flat minimum
    assert optimum.final("arm.angle") == pytest.approx(0.4, abs=1e-4)


class Hanging(Model):
    """A chain of three bars in a plane between two nails: heights of its two joints by energy."""

    x1 = Real(start=0.3)
    y1 = Real(start=-0.3)
    x2 = Real(start=0.9)
    y2 = Real(start=-0.3)
    a = Input(start=-1.2, description="angle of the first bar")
    b = Input(start=0.0, description="angle of the second bar")

    def equations(self):
        yield self.x1 == 0.5 * cos(self.a)
        yield self.y1 == 0.5 * sin(self.a)
        yield self.x2 == self.x1 + 0.5 * cos(self.b)
        yield self.y2 == self.y1 + 0.5 * sin(self.b)


def test_inputs_without_any_derivative():
    class Rest(Optimization):
        """The pose of least potential energy; nails 1 m apart, three bars of 0.5 m."""

        chain = Hanging()

        def integrand(self):
            return self.chain.y1 + self.chain.y2

        def constraints(self):
            yield (self.chain.x2 - 1) ** 2 + self.chain.y2**2 == 0.25

    # a symmetric trapezoid: the middle bar is level, the outer ones span 0.25 each across
    optimum = optimize(Rest, elements=2)
    depth = np.sqrt(0.5**2 - 0.25**2)
    assert optimum.objective == pytest.approx(-2 * depth, abs=1e-7)
    np.testing.assert_allclose(optimum["chain.y1"][1:], -depth, atol=1e-6)


def test_objective_of_inputs_at_a_time():
    class Pick(Optimization):
        mass = Mass(u=0.0)  # what moves has two ends
        u = Input(min=-3.0, max=3.0)

        def objective(self):
            return (final(self.u) - 1) ** 2 + (initial(self.u) + 2) ** 2

    optimum = optimize(Pick, elements=1, points=2)
    assert optimum.final("u") == pytest.approx(1.0, abs=1e-4)
    assert optimum.objective == pytest.approx(0.0, abs=1e-7)


class Column(Optimization):
    """Reaction equilibrium A <=> B <=> C by least free energy of three amounts that sum to one."""

    amount = Free([0.3, 0.3, 0.4], min=1e-9, description="mole fractions")
    potential = Parameter([0.0, -1.0, 0.5], description="standard potentials over R T")

    def objective(self):
        return sum(self.amount[k] * (self.potential[k] + log(self.amount[k])) for k in range(3))

    def constraints(self):
        yield self.amount[0] + self.amount[1] + self.amount[2] == 1


def test_a_free_vector():
    weights = np.exp([0.0, 1.0, -0.5])
    optimum = optimize(Column)
    # Boltzmann's distribution, and minus the logarithm of the partition sum
    assert optimum.objective == pytest.approx(-np.log(weights.sum()), abs=1e-7)
    amounts = [optimum[f"amount[{k}]"] for k in range(3)]
    np.testing.assert_allclose(amounts, weights / weights.sum(), atol=1e-5)


def test_a_free_vector_by_its_name():
    optimum = optimize(Column)
    assert np.shape(optimum["amount"]) == (3,)


def test_a_free_initial_value_alone():
    """Shooting: the speed at which a mass with linear drag, thrown upwards, has risen by 1 after 1."""

    class Thrown(Model):
        x = Real(start=0.0, fixed=True)
        v = Real(start=Free(1.0), fixed=True)

        def equations(self):
            yield der(self.x) == self.v
            yield der(self.v) == -1 - self.v

    class Aim(Optimization):
        ball: Any = Thrown()

        def constraints(self):
            yield final(self.ball.x) == 1

    # x(1) = (v0 + 1)(1 - 1/e) - 1
    assert optimize(Aim, elements=10)["ball.v"][0] == pytest.approx(2 / (1 - np.exp(-1)) - 1, abs=1e-7)


def test_a_limit_on_an_expression_of_free_numbers_only():
    class Longest(Optimization):
        """The largest rectangle of perimeter 4."""

        width = Free(0.2, min=0.0)
        height = Free(0.3, min=0.0)

        def objective(self):
            return -self.width * self.height

        def constraints(self):
            yield 2 * (self.width + self.height) <= 4

    optimum = optimize(Longest)
    assert optimum.objective == pytest.approx(-1.0, abs=1e-7)


def test_free_numbers_next_to_a_motion_that_does_not_matter():
    class Both(HockSchittkowski71):
        mass = Mass()

    assert optimize(Both, elements=3).objective == pytest.approx(17.0140172892, abs=1e-6)


def test_least_squares_through_the_roots_of_a_kinematic_chain():
    class Crank(Optimization):
        """Crank radius and rod length so that a slider is at 1.4, 1.0 and 0.8 for 0, 1 and 2 rad."""

        r = Free(0.2, min=0.05, max=2.0)
        length = Free(1.0, min=0.2, max=5.0)
        angles = (0.0, 1.0, 2.0)

        def place(self, angle):
            return self.r * np.cos(angle) + sqrt(self.length**2 - self.r**2 * np.sin(angle) ** 2)

        def objective(self):
            places = [0.3 * np.cos(a) + np.sqrt(1.1**2 - 0.3**2 * np.sin(a) ** 2) for a in self.angles]
            return sum((self.place(a) - p) ** 2 for a, p in zip(self.angles, places, strict=True))

    optimum = optimize(Crank)
    assert optimum["r"] == pytest.approx(0.3, abs=1e-4)
    assert optimum["length"] == pytest.approx(1.1, abs=1e-4)
