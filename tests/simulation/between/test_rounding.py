"""What all operations that lead to a number make of it by rounding."""

import casadi as ca
import numpy as np

from gantrytau.simulation.between.rounding import UNIT, rounding


def test_rounding_is_that_of_the_terms_not_of_their_difference():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    bound = rounding([x, y], ca.vertcat((x + y) - ca.sqrt(x * y), x * y))
    found = np.array(bound(1e8, 1e8)).ravel()
    terms = 2e8 + 1e8 + 0.5e8 + 1e8  # sum, root, half of what the product brings to it, difference
    np.testing.assert_allclose(found, UNIT * np.array([terms, 1e16]), rtol=1e-6)


def test_no_error_is_larger_than_its_bound():
    x = ca.SX.sym("x", 2)
    terms = ca.sin(3 * x[0]) * ca.exp(x[1]) - ca.sin(3 * x[0] + x[1]) + ca.sqrt(1 + x[0] ** 2) / 7
    exact, bound = ca.Function("exact", [x], [terms]), rounding([x], terms)
    for a, b in np.random.default_rng(3).uniform(-3, 3, (50, 2)):
        other = np.longdouble
        a_, b_ = other(a), other(b)
        true = np.sin(3 * a_) * np.exp(b_) - np.sin(3 * a_ + b_) + np.sqrt(1 + a_**2) / 7
        # sin and exp round to 1 unit
        assert abs(other(float(exact([a, b]))) - true) <= 2 * float(bound([a, b]))
