"""How large the terms are that an expression is the sum of: what rounding errors, and small residuals, are measured by."""

from collections.abc import Mapping, Sequence

import casadi as ca

from gantrytau.language.instructions import computed
from gantrytau.language.scalar_arithmetic import plus, size_of, times

_Sized = tuple[ca.SX, ca.SX]  # an expression, and the size of its terms
_SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX)
_SAME = (ca.OP_NEG, ca.OP_FABS, ca.OP_ASSIGN)
_TURNING = (ca.OP_SIN, ca.OP_COS, ca.OP_TAN)


def term_sizes(expressions: Sequence[ca.SX], least: Mapping[str, float] | None = None) -> list[ca.SX]:
    """For each scalar expression the sum of the absolute values of what it adds up, symbols being as large as they are.

    a + b has the size |a| + |b|, also where the sum is zero; a factor passes the size of the other one on, and sin(a) that
    of a where it is steep. least: symbols that count as at least so large, because they are sums themselves.
    """
    least = least or {}
    leaves = ca.symvar(ca.vertcat(*expressions))
    dense = [ca.densify(e) for e in expressions]
    (found,) = computed(
        ca.Function("sized", [ca.vertcat(*leaves)], [ca.vertcat(*dense)], {"cse": True}),
        lambda _, i: (
            leaves[i],
            ca.SX.binary(ca.OP_FMAX, size_of(leaves[i]), least.get(leaves[i].name(), 0.0)),
        ),
        lambda value: (ca.SX(value), ca.SX(abs(value))),
        _operation,
    )
    return [size for _, size in found]


def _operation(operator: int, operands: list[_Sized]) -> _Sized:
    apply = ca.SX.unary if len(operands) == 1 else ca.SX.binary
    value = apply(operator, *(e for e, _ in operands))
    a, b = operands[0][1], operands[-1][1]
    if operator in _SUMS:
        return value, plus(a, b)
    if operator in _SAME:
        return value, a
    if operator == ca.OP_TWICE:
        return value, times(2, a)
    if operator == ca.OP_SQ:
        return value, times(times(2, size_of(operands[0][0])), a)
    if operator == ca.OP_MUL:
        return value, plus(times(a, size_of(operands[1][0])), times(size_of(operands[0][0]), b))
    if operator == ca.OP_DIV:
        total = plus(a, times(size_of(value), b))
        return value, ca.SX.binary(ca.OP_DIV, total, size_of(operands[1][0]))
    if operator == ca.OP_IF_ELSE_ZERO:
        return value, ca.if_else(operands[0][0], b, 0)
    if operator in _TURNING:
        t = ca.SX.sym("t")
        slope = ca.substitute(ca.jacobian(apply(operator, t), t), t, operands[0][0])
        return value, plus(size_of(value), times(size_of(slope), a))
    return value, size_of(value)
