"""What switches, written with modes, is what it was, and smooth between its switches."""

import casadi as ca
import numpy as np

from gantrytau import if_else
from gantrytau.language.piecewise import switched, with_modes

x, y, u = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("u")
EXPRESSIONS = [
    x + ca.if_else(x > 0, 1.0, -1.0) - u,
    ca.fabs(x) + ca.fmin(x, y) - ca.fmax(2 * x, u),
    ca.sign(x) * y,
    ca.floor(x) + ca.ceil(y),
    ca.fmod(x, y),
    ca.copysign(x, y),
    ca.if_else(ca.logic_and(x > 1, y <= 2), 3, 4),
    ca.if_else(x, 1, 2),
    ca.if_else(x == y, 1, 2),
    ca.if_else(x != y, 1, 2),
    ca.if_else(u > 0, x, y),
    ca.if_else(ca.fabs(x) - 1 > ca.fmin(y, 0), x, 2 * x),
]


def test_the_values_of_the_modes_give_the_expressions_back():
    found = switched(EXPRESSIONS)
    before = ca.Function("before", [x, y, u], [ca.vertcat(*EXPRESSIONS)])
    after = ca.Function("after", [x, y, u], [ca.vertcat(*with_modes(found, found.expressions))])
    rng = np.random.default_rng(0)
    for _ in range(500):
        point = rng.choice([0.0, 1.0, -1.0, 2.0, 2.5, -3.0, *rng.normal(size=6)], 3)
        np.testing.assert_allclose(after(*point), before(*point), rtol=1e-14, atol=1e-15)


def test_with_modes_no_derivative_depends_on_where_a_switch_stands():
    found = switched([ca.fabs(x) + x * ca.sign(x - 1)])
    slope = ca.jacobian(found.expressions[0], x)
    assert {s.name() for s in ca.symvar(slope)} == {s.mode.name() for s in found.switches}


def test_only_what_moves_with_the_names_asked_for_has_a_mode():
    assert len(switched(EXPRESSIONS, {"u"}).switches) == 2  # fmax(2 x, u) and u > 0
    assert switched([x * y + u]).switches == ()
    assert switched([ca.sign(ca.SX(3.0)) * x]).switches == ()


def test_equal_conditions_have_one_mode():
    assert len(switched([ca.if_else(x > u, 1, 2), ca.if_else(x > u, y, -y)]).switches) == 1


def test_the_shape_of_a_matrix_stays():
    matrix = ca.vertcat(ca.horzcat(ca.fabs(x), y), ca.horzcat(0, u))
    (same,) = switched([matrix]).expressions
    assert same.shape == (2, 2)
    assert ca.is_equal(same[0, 1], y)
    assert ca.is_equal(same[1, 1], u)


SMOOTH = if_else(ca.fabs(x) < 1, x**2 / 2, ca.sqrt(x**2 + 1e-9) - 0.5, smooth=True)


def test_what_is_said_to_be_smooth_has_a_mode_only_where_that_is_asked_for():
    both = [SMOOTH + ca.fabs(y), SMOOTH * if_else(y > 1, 1.0, 2.0)]
    found = switched(both, smooth=False)
    assert found.smooth
    assert {leaf.name() for turn in found.switches for leaf in ca.symvar(turn.margin)} == {"y"}
    assert len(switched(both).switches) == len(found.switches) + 2  # fabs(x), and the condition
    assert not switched([ca.fabs(y)], smooth=False).smooth
    rows = ca.vertcat(*both), ca.vertcat(*with_modes(found, found.expressions))
    slopes = [ca.Function("slopes", [x, y], [row, ca.jacobian(row, x)]) for row in rows]
    for point in np.random.default_rng(0).normal(size=(200, 2)) * 2:
        for before, after in zip(slopes[0](*point), slopes[1](*point), strict=True):
            np.testing.assert_allclose(after, before, rtol=1e-13, atol=1e-15)
