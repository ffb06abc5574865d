"""Start values that a problem tells: conditions `initial(x) == value`, and first guesses at the start."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau_optimica.problem.optimization import Point
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow


def with_told_starts(
    flat: FlatModel, constraints: Sequence[ConstraintRow], points: Sequence[Point], guess: Any
) -> FlatModel | None:
    """The model with starts as the problem tells them, conditions before guesses; None where it tells none."""
    told = {**_guessed(flat, guess), **_conditions(constraints, points)}
    variables = tuple(_started(v, told) for v in flat.variables)
    if all(a is b for a, b in zip(variables, flat.variables, strict=True)):
        return None
    return replace(flat, variables=variables)


def _started(variable: FlatVariable, told: Mapping[str, ca.SX]) -> FlatVariable:
    if variable.fixed or not any(name in told for name in variable.elements):
        return variable
    own = variable.start or tuple(ca.SX(0) for _ in variable.elements)
    start = tuple(told.get(n, x) for n, x in zip(variable.elements, own, strict=True))
    return replace(variable, start=start, chosen=True)


def _conditions(constraints: Sequence[ConstraintRow], points: Sequence[Point]) -> dict[str, ca.SX]:
    """Values of variables that conditions hold at the start, by scalar name."""
    meaning = {
        s.element_hash(): e.name()
        for p in points
        if p.time == "initial"
        for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
        if e.is_symbolic()
    }
    return {
        meaning[row.expression.element_hash()]: ca.SX(row.lower)
        for row in constraints
        if row.lower is row.upper and row.expression.element_hash() in meaning
    }


def _guessed(flat: FlatModel, guess: Any) -> dict[str, ca.SX]:
    """First values of guesses that are numbers, arrays or functions of time, by scalar name; others tell nothing here."""
    found: dict[str, ca.SX] = {}
    elements = {v.name: v.elements for v in flat.variables} | {
        e: (e,) for v in flat.variables for e in v.elements
    }
    for name, value in guess.items() if isinstance(guess, Mapping) else ():
        try:
            first = np.asarray(value(0.0) if callable(value) else value, dtype=float).ravel(order="F")
        # of a function that is not ours, or another solution: refused or read with the other guesses
        except Exception:
            continue
        own = elements.get(name, ())
        if first.size == len(own) and np.all(np.isfinite(first)):
            found |= {e: ca.SX(x) for e, x in zip(own, first.tolist(), strict=True)}
    return found
