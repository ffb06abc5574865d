"""Margins without poles: n / d has the sign of n d, which passes zero where n / d jumps from one infinity to the other."""

import casadi as ca

from gantrytau.language.instructions import applied, computed

MOST = 3  # denominators in one margin: products of many would overflow
_Fraction = tuple[ca.SX, tuple[ca.SX, ...]]  # a numerator, and what it is divided by


def without_poles(margin: ca.SX) -> ca.SX:
    """An expression of the same sign that is finite where the margin has a pole; the margin, if it has none."""
    leaves = ca.symvar(margin)
    function = ca.Function("margin", leaves, [margin])
    divides = (ca.OP_DIV, ca.OP_INV, ca.OP_TAN)
    if not any(function.instruction_id(k) in divides for k in range(function.n_instructions())):
        return margin
    [[(above, below)]] = computed(
        function, lambda k, _: (leaves[k], ()), lambda value: (ca.SX(value), ()), _operation
    )
    return above * _product(below) if below else margin


def _operation(operator: int, operands: list[_Fraction]) -> _Fraction:
    (a, under), (b, under_b) = operands[0], operands[-1]
    found: _Fraction | None = None
    if operator == ca.OP_TAN and not under and not a.is_constant():
        found = ca.sin(a), (ca.cos(a),)
    elif operator == ca.OP_INV and not (a.is_constant() and not under):
        found = _product(under), (a,)
    elif operator == ca.OP_DIV and not (b.is_constant() and not under_b):
        found = a * _product(under_b), (*under, b)
    elif operator == ca.OP_DIV:
        found = a / b, under
    elif operator == ca.OP_NEG:
        found = -a, under
    elif operator == ca.OP_MUL:
        found = a * b, (*under, *under_b)
    elif operator in (ca.OP_ADD, ca.OP_SUB):
        shared = [d for d in under if _within(d, under_b)]
        left, right = ([d for d in ds if not _within(d, shared)] for ds in (under, under_b))
        found = ca.SX.binary(operator, a * _product(right), b * _product(left)), (*shared, *left, *right)
    if found is not None and len(found[1]) <= MOST:
        return found
    whole = [e / _product(ds) if ds else e for e, ds in operands]
    return applied(operator, whole), ()


def _within(one: ca.SX, others: list[ca.SX] | tuple[ca.SX, ...]) -> bool:
    return any(ca.is_equal(one, other) for other in others)


def _product(factors: list[ca.SX] | tuple[ca.SX, ...]) -> ca.SX:
    found = ca.SX(1)
    for factor in factors:
        found *= factor
    return found
