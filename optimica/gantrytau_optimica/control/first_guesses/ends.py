"""Values at the start and at the end of a problem, as its conditions say them or as they follow from these."""

from collections.abc import Mapping, Sequence

import casadi as ca

from gantrytau import Dae, InitializationError, StructureError
from gantrytau_optimica.control.limits import value_at
from gantrytau_optimica.problem.optimization import Point
from gantrytau_optimica.problem.symbolic_problem import ConstraintRow

ROUNDING = 1e-12  # what is left of a rate that is zero


def values_at_ends(
    dae: Dae, points: Sequence[Point], constraints: Sequence[ConstraintRow], chosen: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Values given at "initial" and "final" times, by symbol; `chosen`: free and held numbers.

    Where what is given is no state, states that are missing follow from it by the model: a pose gives the joints.
    """
    meaning = {
        s.element_hash(): (p.time, e)
        for p in points
        if isinstance(p.time, str)
        for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
        if e.is_symbolic()
    }
    found: dict[str, dict[str, float]] = {}
    given: dict[str, dict[str, float]] = {}
    for constraint in constraints:
        known = meaning.get(constraint.expression.element_hash())
        value = _number(dae, constraint.lower, chosen)
        if known is None or value is None or value != _number(dae, constraint.upper, chosen):
            continue
        which, leaf = known
        alias = dae.root(leaf.name())
        if alias is not None and alias.root is not None:
            found.setdefault(alias.symbol, {})[which] = dae.number(alias.root_value(value))
            given.setdefault(which, {})[leaf.name()] = value
    for which, values in given.items():
        for name, number in _following(dae, values, {n for n, own in found.items() if which in own}).items():
            found.setdefault(name, {})[which] = number
    return found


def _following(dae: Dae, given: Mapping[str, float], known: set[str]) -> dict[str, float]:
    """States that are not known, with their rates, by symbol, as they follow from values at the same time; or {}.

    Kept with the model: guesses of other durations have the same ends.
    """
    states = {alias.symbol for n in dae.states if (alias := dae.root(n)) is not None}
    missing = states - known
    if not missing or known <= states:
        return {}
    key = "following", tuple(given.items()), frozenset(known)
    if key not in dae.made:
        names = [*missing, *(f"der({n})" for n in states if f"der({n})" not in known)]
        dae.made[key] = _completed(dae, given, names)
    return dae.made[key]


def _completed(dae: Dae, given: Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    try:
        point = dae.evaluate(given)
    except (InitializationError, StructureError):
        return {}  # told when the problem is solved
    found = {name: float(point[name]) for name in names if name in point}
    return {name: 0.0 if abs(x) < ROUNDING else x for name, x in found.items()}


def _number(dae: Dae, bound: ca.SX, chosen: Mapping[str, float]) -> float | None:
    """The value of an expression of parameters, or None if others occur in it."""
    if bound.is_constant():
        return float(bound)
    bound = dae.to_reduced(bound)
    leaves = ca.symvar(bound)
    if any(leaf.name() not in dae.parameter_values for leaf in leaves):
        return None
    numbers = {**dae.parameter_values, **chosen}
    return value_at(bound, {leaf.element_hash(): numbers[leaf.name()] for leaf in leaves})
