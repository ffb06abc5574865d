"""Quadratics whose leading coefficient vanishes, changes its sign or is small, against roots in extended precision."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, simulate, translate


class Leading(Model):
    """One branch is finite through a = 0."""

    a = Input(start=1.0)
    x = Real(start=0.6)

    def equations(self):
        yield self.a * self.x**2 + self.x - 1 == 0


class Drag(Model):
    """The everyday characteristic with a quadratic part that is left out by default."""

    f = Input(start=1.0)
    d1 = Parameter(1.0)
    d2 = Parameter(0.0)
    v = Real()

    def equations(self):
        yield self.f == self.d1 * self.v + self.d2 * self.v**2


class Steep(Model):
    """The linear coefficient may be far larger than the constant leading one."""

    u = Input(start=1.0)
    x = Real(start=0.5)

    def equations(self):
        yield self.x**2 + self.u * self.x == 1


def leading(a: float) -> float:
    """The root of the start, 2 / (1 + sqrt(1 + 4 a))."""
    return float(2 / (1 + np.sqrt(np.longdouble(1 + 4 * np.longdouble(a)))))


@pytest.mark.parametrize("a", [1.0, 1e-9, 1e-300, 0.0, -1e-12, -0.1, -0.25])
def test_the_branch_of_the_start_goes_through_a_vanishing_leading_coefficient(a):
    function = translate(Leading()).function(["a"], ["x"])
    assert float(function(a)) == pytest.approx(leading(a), rel=1e-15)
    if a > -0.25:  # there the roots meet
        x = leading(a)
        slope = -(x**2) / (2 * a * x + 1)
        assert float(function.jacobian()(a, 0)) == pytest.approx(slope, rel=1e-14)
        assert float(function.reverse(1)(a, 0, 1)) == pytest.approx(slope, rel=1e-14)


def test_beyond_the_meeting_of_the_roots_is_nan():
    assert np.isnan(float(translate(Leading()).function(["a"], ["x"])(-0.26)))


def test_a_simulation_goes_through_zero():
    result = simulate(Leading(), stop=1.2, inputs={"a": lambda t: 1 - t}, points=7)  # exactly zero at a point
    np.testing.assert_allclose(result["x"], [leading(1 - t) for t in result.time], rtol=1e-14)


def test_a_quadratic_part_of_zero_is_a_linear_equation():
    assert simulate(Drag(), stop=1.0, points=2).final("v") == 1.0
    function = translate(Drag()).function(["f", "d2"], ["v"])
    assert [float(function(3.0, d)) for d in (0.0, 1e-12, 2.0)] == pytest.approx([3.0, 3 - 9e-12, 1.0], 1e-15)


@pytest.mark.parametrize("u", [1e-8, 1.0, 1e8, 1e15, -1e8])
def test_no_digit_is_lost_where_the_linear_coefficient_is_large(u):
    exact = 2 / (u + np.hypot(u, 2.0)) if u > 0 else (np.hypot(u, 2.0) - u) / 2
    assert float(translate(Steep()).function(["u"], ["x"])(u)) == pytest.approx(float(exact), rel=1e-15)


def test_the_lifted_form_holds_at_zero_too():
    system = translate(Leading()).system("lifted")
    (x,) = system.to_system([system.dae.expression("x")])
    at = ca.Function("at", [system.z, system.u], [x, system.residuals])
    for a in (0.5, 0.0, -0.1):
        value, residual = at(np.sqrt(1 + 4 * a), a)
        assert float(value) == pytest.approx(leading(a), rel=1e-14)
        assert abs(float(residual)) < 1e-15
