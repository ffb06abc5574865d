"""Sums in which terms cancel, as x - (a + (x - a - w)) = w, written without them.

What has cancelled is still a dependence to those who look at symbols: Jacobians and Hessians had
elements that are always zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from gantrytau.language.instructions import applied, computed

MOST_TERMS = 12  # of a sum that is looked through
ROUNDING = 1e-14  # of the terms that cancel
FEW = 2  # terms and constants of a sum that is written anew: more are cheaper as they are shared


@dataclass(frozen=True, eq=False)
class _Sum:
    """An expression, and the same as sum of factor * term + constant; terms: by their hashes."""

    expression: ca.SX
    terms: dict[int, tuple[float, ca.SX]] = field(default_factory=dict)
    constant: float = 0.0

    def times(self, factor: float, expression: ca.SX) -> "_Sum":
        """Itself times a factor, which is the expression."""
        terms = {h: (factor * c, term) for h, (c, term) in self.terms.items()}
        return _Sum(expression, terms, factor * self.constant)

    def plus(self, other: "_Sum", sign: float, expression: ca.SX) -> "_Sum":
        """Itself plus sign times another one, which is the expression where nothing cancels."""
        terms, cancels = dict(self.terms), False
        for h, (c, term) in other.terms.items():
            before, _ = terms.get(h, (0.0, term))
            total = before + sign * c
            if abs(total) <= ROUNDING * abs(c):
                terms.pop(h, None)
                cancels = True
            else:
                terms[h] = total, term
        constant = self.constant + sign * other.constant
        if abs(constant) <= ROUNDING * abs(other.constant):
            constant = 0.0
        if cancels and len(terms) + (constant != 0.0) <= FEW:
            expression = sum((c * term for c, term in terms.values()), ca.SX(constant))
        elif len(terms) > MOST_TERMS:
            return _alone(expression)
        return _Sum(expression, terms, constant)


def _alone(expression: ca.SX) -> _Sum:
    return _Sum(expression, {expression.element_hash(): (1.0, expression)})


def without_cancelled(columns: Sequence[ca.SX]) -> list[ca.SX]:
    """Columns of expressions in which no term of a sum cancels."""
    whole = ca.vertcat(ca.SX(0, 1), *columns)
    symbols = ca.symvar(whole)
    function = ca.Function("sums", [ca.vertcat(ca.SX(0, 1), *symbols)], [ca.densify(whole)])
    known = [_alone(symbol) for symbol in symbols]
    (found,) = computed(function, lambda _, i: known[i], lambda x: _Sum(ca.SX(x), {}, x), _operation)
    ends = np.cumsum([0, *(one.numel() for one in columns)])
    return ca.vertsplit(ca.vertcat(ca.SX(0, 1), *(one.expression for one in found)), ends.tolist())


def _operation(operator: int, operands: list[_Sum]) -> _Sum:
    expression = applied(operator, [one.expression for one in operands])
    first, last = operands[0], operands[-1]
    if operator in (ca.OP_ADD, ca.OP_SUB):
        return first.plus(last, 1.0 if operator == ca.OP_ADD else -1.0, expression)
    if operator in (ca.OP_NEG, ca.OP_TWICE):
        return first.times(-1.0 if operator == ca.OP_NEG else 2.0, expression)
    if operator == ca.OP_MUL and not (first.terms and last.terms):
        number, rest = (last, first) if first.terms else (first, last)
        return rest.times(number.constant, expression)
    if operator == ca.OP_DIV and not last.terms and last.constant:
        return first.times(1 / last.constant, expression)
    return _alone(expression)
