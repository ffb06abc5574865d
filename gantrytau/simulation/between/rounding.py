"""What rounding makes of a number: the sum over all operations that lead to it.

Each result is v (1 + e) with |e| <= 2^-53; to first order a number is off by at most 2^-53 times the sum of its derivatives
by the e of all operations (Wilkinson). That is much where large terms cancel, however small the number is.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

UNIT = np.finfo(float).eps / 2


def rounding(arguments: Sequence[ca.SX], expression: ca.SX) -> ca.Function:
    """Of the same arguments, a bound of the rounding errors of an expression's elements, (n,)."""
    function = ca.Function("exact", list(arguments), [ca.densify(expression)], {"cse": True})
    work: dict[int, ca.SX] = {}
    found, errors = [ca.SX(0)] * function.numel_out(0), []
    for k in range(function.n_instructions()):
        operation, into = function.instruction_id(k), function.instruction_output(k)
        given = function.instruction_input(k)
        if operation == ca.OP_CONST:
            work[into[0]] = ca.SX(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            work[into[0]] = arguments[given[0]][given[1]]
        elif operation == ca.OP_OUTPUT:
            found[into[1]] = work[given[0]]
        else:
            operands = [work[i] for i in given]
            make = ca.SX.unary if len(operands) == 1 else ca.SX.binary
            errors.append(ca.SX.sym("e"))
            work[into[0]] = make(operation, *operands) * (1 + errors[-1])
    e = ca.vertcat(ca.SX(0, 1), *errors)
    slopes = ca.substitute(ca.jacobian(ca.vertcat(*found), e), e, ca.SX.zeros(e.numel()))
    bound = UNIT * ca.sum2(ca.fabs(slopes)) if errors else ca.SX.zeros(len(found))
    return ca.Function("rounding", list(arguments), [ca.densify(bound)], {"cse": True})
