"""What is small for a limit or a condition: the size of its terms, in micrometres as in megametres."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, between, der, sin, time
from gantrytau_optimica import Optimization, final, initial, optimize
from gantrytau_optimica.answers.playback.ranges import magnitude, terms
from tests.optimica.problems import FastestMass, LinearQuadratic, Mass

ACCURACY = 1e-5


class Chase(Model):
    """x may be steered, y swings by itself: y = size (1 - cos(rate t)) / 2, and `ahead` is their difference."""

    size = Parameter(1.0, description="of both")
    rate = Parameter(3.0, unit="rad/s", description="of y")
    x = Real(description="steered")
    y = Real(start=0.0, fixed=True, description="swinging")
    ahead = Real(description="x before y")
    u = Input(description="speed of x")

    def equations(self):
        yield der(self.x) == self.u
        yield der(self.y) == self.size * self.rate / 2 * sin(self.rate * time)
        yield self.ahead == self.x - self.y


class Behind(Optimization):
    """x wants to be twice y, and may not pass it."""

    chase: Any = Chase(x=dict(start=0.0, fixed=True))
    final_time = 2.0

    def integrand(self):
        c = self.chase
        return (c.x - 2 * c.y) ** 2 / c.size**2

    def constraints(self):
        yield self.chase.x - self.chase.y <= 0


class BehindByName(Behind):
    """The difference as a variable of the model."""

    def constraints(self):
        yield self.chase.ahead <= 0


class Together(Optimization):
    """x is y, written as an equality."""

    chase: Any = Chase()
    final_time = 2.0

    def integrand(self):
        return self.chase.u**2 / self.chase.size**2

    def constraints(self):
        yield self.chase.x == self.chase.y


SIZES = (1.0, 1e-6, 1e6)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("problem", [Behind, BehindByName])
def test_a_limit_on_a_difference_is_measured_by_its_terms(problem, size):
    optimum = optimize(problem(chase=Chase(size=size, x=dict(start=0.0, fixed=True))), elements=20)
    (found,) = optimum.playback.violations
    played = optimum.playback
    larger = np.max(np.abs([optimum["chase.x"], optimum["chase.y"]]))
    assert found.range == pytest.approx(larger, rel=1e-6)
    assert found.amount == pytest.approx(max(np.max(played["chase.ahead"]), 0.0), rel=1e-6, abs=1e-12 * size)
    assert found.amount < 1e-3 * size + 2e-8  # by which the solver relaxes limits


def test_a_limit_on_a_difference_is_refined():
    optimum = optimize(Behind, elements=20, refine=ACCURACY)
    assert optimum.refinement.reached
    assert optimum.playback.violation <= ACCURACY
    assert [s.name for s in optimum.refinement.switches].count("(chase.x-chase.y) <= 0") < 6
    exact = (3 - 2 * np.sin(6.0) / 3 + np.sin(12.0) / 12) / 4  # x keeps to y: the integral of y^2
    assert optimum.objective == pytest.approx(exact, rel=2 * ACCURACY)


@pytest.mark.parametrize("size", SIZES)
def test_an_equality_is_measured_by_what_it_compares(size):
    optimum = optimize(Together(chase=Chase(size=size)), elements=20)
    (found,) = optimum.playback.violations
    y = optimum.playback["chase.y"]
    assert found.range == pytest.approx(np.max(y), rel=1e-3)
    assert found.amount == pytest.approx(np.max(np.abs(optimum.playback["chase.x"] - y)), rel=1e-3)
    assert found.relative < 1e-3
    # u is y' = 3/2 sin(3 t): the integral of its square
    assert optimum.objective == pytest.approx(2.25 * (1 - np.sin(12.0) / 12), rel=1e-3)


def test_an_equality_never_switches():
    from gantrytau_optimica.answers.playback.switches import switches

    optimum = optimize(Together, elements=20)
    assert [s for s in switches(next(iter(optimum.phases.values()))) if "chase.x" in s.name] == []


def test_an_equality_with_zero_is_measured_by_what_is_typical():
    class Kept(Optimization):
        """y runs free, x stays where it is."""

        chase = Chase(x=dict(nominal=0.5))
        final_time = 2.0

        def integrand(self):
            return self.chase.u**2

        def constraints(self):
            yield self.chase.x == 0

    (found,) = optimize(Kept, elements=10).playback.violations
    assert found.range == 0.5
    assert found.relative < 1e-6


def test_conditions_are_measured_by_what_they_compare():
    class Closed(FastestMass):
        """There and back: the speed at the end is that of the start."""

        mass = Mass(u=dict(min=-1.0, max=1.0), x=dict(nominal=4.0), v=dict(nominal=0.25))

        def constraints(self):
            yield initial(self.mass.x) == 0
            yield initial(self.mass.v) == 3
            yield final(self.mass.v) == initial(self.mass.v)
            yield 1e3 * final(self.mass.x) == 7000
            yield between(-5, final(self.mass.u), 0.5)

    sizes = {d.name: d.size for d in optimize(Closed, elements=10).playback.defects}
    assert list(sizes.values()) == pytest.approx([4.0, 3.0, 6.0, 7000.0, 5.0], rel=1e-3)


@pytest.mark.parametrize("scale", [1e-3, 1e-6, 1e6])
def test_small_objectives_stand_still_relative_to_themselves(scale):
    class Scaled(LinearQuadratic):
        """Weights that make the objective as small as a micrometre squared, or as large."""

        weight = Parameter(scale**2, description="of all costs")

        def integrand(self):
            return self.weight * super().integrand()

    optimum = optimize(Scaled, elements=20, refine=ACCURACY)
    assert optimum.refinement.reached
    assert optimum.playback.objective_size == pytest.approx(optimum.objective, rel=1e-3)
    assert optimum.objective == pytest.approx(50.9836626 * scale**2, rel=2 * ACCURACY)


def test_terms_are_what_is_added_up():
    x, y, z = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("z")
    values = ca.Function("values", [x, y, z], terms(2 * (x - y) / 4 + z * (x + y) - 3))
    assert sorted(float(v) for v in values(1.0, 2.0, 5.0)) == [0.5, 1.0, 3.0, 15.0]
    assert terms(ca.SX(0)) == []
    chain = x
    for _ in range(200):  # as many ways to x as 2^200
        chain = chain + chain
    assert len(terms(chain)) == 1


def test_magnitudes_take_what_cancels_as_if_it_did_not():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    form = ca.Function(
        "form", [x, y], [magnitude((x - 2 * y) ** 2 - ca.fabs(x - y) / (y - 3) + ca.sqrt(x + y))]
    )
    assert float(form(4.0, 2.0)) == pytest.approx(8.0**2 + 6.0 / 1.0 + np.sqrt(6.0))
