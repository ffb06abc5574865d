"""The reader of CasADi's instructions: dual numbers give the derivatives that CasADi's own rules give."""

import casadi as ca
import numpy as np

from gantrytau.language.instructions import computed

RULES = {
    ca.OP_ADD: lambda a, b: (a[0] + b[0], a[1] + b[1]),
    ca.OP_MUL: lambda a, b: (a[0] * b[0], a[0] * b[1] + a[1] * b[0]),
    ca.OP_SQ: lambda a: (a[0] ** 2, 2 * a[0] * a[1]),
    ca.OP_SIN: lambda a: (np.sin(a[0]), np.cos(a[0]) * a[1]),
}


def test_dual_numbers_have_the_derivatives_of_casadi():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    results = [ca.vertcat(ca.sin(x[0] * y) + 3, x[1] ** 2), x[0] * x[1] + y]
    function = ca.Function("f", [x, y], results)
    values, speeds = ([1.2, -0.4], [0.7]), ([0.5, 2.0], [-1.0])
    found = computed(
        function,
        lambda k, i: (values[k][i], speeds[k][i]),
        lambda number: (number, 0.0),
        lambda operator, operands: RULES[operator](*operands),
    )
    slope = ca.Function(
        "slope", [x, y], [ca.jtimes(r, ca.vertcat(x, y), ca.DM([0.5, 2.0, -1.0])) for r in results]
    )
    for dual, number, rate in zip(found, function(*values), slope(*values), strict=True):
        np.testing.assert_allclose([a for a, _ in dual], np.array(number).ravel(), rtol=1e-15)
        np.testing.assert_allclose([b for _, b in dual], np.array(rate).ravel(), rtol=1e-15)


def test_zeros_that_are_not_stored_are_no_results():
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [ca.SX(2, 1), ca.vertcat(x, ca.SX(1, 1))])
    assert computed(function, lambda k, i: "x", str, lambda operator, operands: "") == [[], ["x"]]
