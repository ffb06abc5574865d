"""Rounding error of an expression: the sum over all its operations.

Each operation gives v (1 + e) with |e| <= 2^-53; to first order the error is at most 2^-53 times the sum of the derivatives
by all e (Wilkinson), large where large terms cancel.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau.language.instructions import applied, computed

UNIT = np.finfo(float).eps / 2


def rounding(arguments: Sequence[ca.SX], expression: ca.SX) -> ca.Function:
    """Bound of the rounding errors of an expression's elements, (n,), as a function of the same arguments."""
    function = ca.Function("exact", list(arguments), [ca.densify(expression)], {"cse": True})
    errors: list[ca.SX] = []

    def operation(operator: int, operands: list[ca.SX]) -> ca.SX:
        errors.append(ca.SX.sym("e"))
        return applied(operator, operands) * (1 + errors[-1])

    [found] = computed(function, lambda k, i: arguments[k][i], ca.SX, operation)
    e = ca.vertcat(ca.SX(0, 1), *errors)
    slopes = ca.substitute(ca.jacobian(ca.vertcat(*found), e), e, ca.SX.zeros(e.numel()))
    bound = UNIT * ca.sum2(ca.fabs(slopes)) if errors else ca.SX.zeros(len(found))
    return ca.Function("rounding", list(arguments), [ca.densify(bound)], {"cse": True})
