"""Static problems of dynamic models: all derivatives are zero."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.statements import Equation


def at_rest(flat: FlatModel) -> FlatModel:
    """The model with derivatives of zero; equations that then say nothing, as der(x) = 0 at the start, are left out."""
    rates = ca.vertcat(ca.SX(0, 1), *flat.derivatives.values())
    return replace(
        flat,
        equations=_without(flat.equations, rates),
        initial_equations=_without(flat.initial_equations, rates),
        derivatives={},
    )


def _without(equations: Sequence[Equation], rates: ca.SX) -> tuple[Equation, ...]:
    found: list[Equation] = []
    for one in equations:
        left, right = ca.substitute([one.left, one.right], [rates], [ca.SX.zeros(*rates.shape)])
        if not ca.simplify(left - right).is_zero():
            found.append(replace(one, left=left, right=right))
    return tuple(found)
