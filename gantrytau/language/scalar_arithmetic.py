"""Arithmetic of scalar SX expressions where there are many.

The operators of CasADi's Python try every conversion of their operands first, which takes seven times as long (casadi 3.8).
"""

from collections.abc import Iterable, Sequence

import casadi as ca


def plus(a: ca.SX, b: ca.SX) -> ca.SX:
    """The sum a + b."""
    return ca.SX.binary(ca.OP_ADD, a, b)


def minus(a: ca.SX, b: ca.SX) -> ca.SX:
    """The difference a - b."""
    return ca.SX.binary(ca.OP_SUB, a, b)


def times(a: ca.SX | float, b: ca.SX) -> ca.SX:
    """The product a * b."""
    return ca.SX.binary(ca.OP_MUL, a, b)


def negative(a: ca.SX) -> ca.SX:
    """The opposite -a."""
    return ca.SX.unary(ca.OP_NEG, a)


def size_of(a: ca.SX) -> ca.SX:
    """The absolute value of a."""
    return ca.SX.unary(ca.OP_FABS, a)


def leaf_names(expressions: Iterable[ca.SX]) -> list[str]:
    """Names of all symbols in expressions."""
    return [leaf.name() for leaf in ca.symvar(ca.vertcat(ca.SX(0, 1), *expressions))]


def depending(expressions: Sequence[ca.SX], symbols: Sequence[ca.SX]) -> list[bool]:
    """For each scalar expression whether any of the symbols stands in it."""
    if not symbols or not expressions:
        return [False] * len(expressions)
    return ca.which_depends(ca.vertcat(*expressions), ca.vertcat(*symbols), 1, True)
