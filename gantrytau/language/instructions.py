"""The reader of CasADi's instructions: a function of scalars computed with values of any kind."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import casadi as ca

from gantrytau.border.refusal import ModelError

Value = TypeVar("Value")


def computed(
    function: ca.Function,
    symbol: Callable[[int, int], Value],
    number: Callable[[float], Value],
    operation: Callable[[int, list[Value]], Value],
) -> list[list[Value]]:
    """The results of an SX function, the nonzeros of each, instruction by instruction with other values than numbers.

    symbol: the value of an element (argument, nonzero); number: that of a constant; operation: that of CasADi's
    operator, such as casadi.OP_ADD, on the values of its operands.
    """
    work: dict[int, Value] = {}
    results: list[dict[int, Value]] = [{} for _ in range(function.n_out())]
    for k in range(function.n_instructions()):
        operator = function.instruction_id(k)
        inside, outside = function.instruction_input(k), function.instruction_output(k)
        if operator == ca.OP_OUTPUT:
            results[outside[0]][outside[1]] = work[inside[0]]
        elif operator == ca.OP_INPUT:
            work[outside[0]] = symbol(inside[0], inside[1])
        elif operator == ca.OP_CONST:
            work[outside[0]] = number(function.instruction_constant(k))
        else:
            work[outside[0]] = operation(operator, [work[i] for i in inside])
    return [[found[i] for i in sorted(found)] for found in results]


def applied(operator: int, operands: Sequence[ca.SX]) -> ca.SX:
    """CasADi's operator on expressions."""
    return (ca.SX.unary if len(operands) == 1 else ca.SX.binary)(operator, *operands)


def refuse_calls(place: str, *expressions: ca.SX) -> None:
    """ModelError for a call of what is no expression: a table, an external function, a callback.

    CasADi evaluates it, but the derivative of such a call ends Python or is NaN (casadi 3.8).
    """
    if all(one.is_scalar() and one.n_dep() == 0 for one in expressions):
        return
    whole = ca.SX(ca.veccat(*expressions))
    leaves = ca.vertcat(ca.SX(0, 1), *ca.symvar(whole))
    called = ca.Function("calls", [leaves], [whole]).find_functions(0)
    if called:
        raise ModelError(
            f"{place}: found a call of the function '{called[0].name()}', a table or a function from outside, "
            "expected an expression of symbols; write table(x, xs, ys) for a table, a formula, or a casadi.Function of a "
            "formula; a course over time can be an Input with samples (times, values)"
        )
