"""Dimensions of times and constraints, checked like those of equations.

Objective and integrand are not: a cost may add what is not alike, with weights of one that nobody writes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.flattening.check_units import check_equations
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import time
from gantrytau_optimica.problem.optimization import Point
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow


@dataclass(frozen=True, eq=False)
class _Sides(Equation):
    """Two expressions of one dimension, at a place of an optimisation problem."""

    @property
    def name(self) -> str:
        """The place."""
        return self.path


def check_problem_units(
    flat: FlatModel,
    constraints: Sequence[ConstraintRow],
    points: Sequence[Point],
    times: Mapping[str, ca.SX],
) -> None:
    """ModelError for terms or sides whose units disagree. A value at a time has the unit of its variable."""
    pairs = [(value, time, place) for place, value in times.items()]
    for constraint in constraints:
        for bound in (constraint.lower, constraint.upper):
            if not bound.is_constant():
                pairs.append((constraint.expression, bound, constraint.place))
        pairs.append((constraint.expression, constraint.expression, constraint.place))
    sides = ca.vertcat(*(side for left, right, _ in pairs for side in (left, right)))
    for point in reversed(points):
        sides = ca.substitute(sides, point.symbol, point.expression)
    elements = sides.elements()
    equations = tuple(
        _Sides(elements[2 * k], elements[2 * k + 1], place, "", k) for k, (_, _, place) in enumerate(pairs)
    )
    check_equations(flat, equations)
