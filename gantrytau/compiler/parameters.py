"""Values of parameters: bindings resolved, some replaced by new numbers, some folded into the equations."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.border.units import given
from gantrytau.compiler.symbol_spaces import column, values_at
from gantrytau.flattening.flat_model import FlatModel, FlatParameter
from gantrytau.flattening.shapes import elements_of


@dataclass(frozen=True, eq=False)
class ParameterTable:
    """The parameters of a model sorted out.

    independent: names of the scalars that stay symbols; values: numbers of all scalars by name;
    expressions: all others in terms of the independent ones (a number where folded); symbols by name.
    """

    independent: tuple[str, ...]
    values: Mapping[str, float]
    expressions: Mapping[str, ca.SX]
    symbols: Mapping[str, ca.SX]

    def to_reduced(self, expression: ca.SX) -> ca.SX:
        """The expression with dependent and folded parameters replaced."""
        names = [leaf.name() for leaf in ca.symvar(expression)] if self.expressions else []
        dependent = [name for name in names if name in self.expressions]
        if not dependent:
            return expression
        old, new = (column([of[name] for name in dependent]) for of in (self.symbols, self.expressions))
        return ca.substitute(expression, old, new)

    def numbers(self, expression: ca.SX) -> np.ndarray:
        """The values of expressions of parameters, (n,)."""
        if expression.is_constant():
            return np.array(ca.DM(expression)).ravel()
        return values_at(expression, self.values).ravel()

    def number(self, expression: ca.SX) -> float:
        """The value of one expression of parameters."""
        return float(self.numbers(expression)[0])


def with_values(flat: FlatModel, values: Mapping[str, object]) -> FlatModel:
    """The model with other numbers for some parameters; ModelError for unknown names or wrong shapes."""
    if not values:
        return flat
    if not isinstance(values, Mapping):
        raise ModelError("expected {name: value}", place=flat.name, found=Given("parameters", values))
    remaining = dict(values)
    known = [*(p.name for p in flat.parameters), *(e for p in flat.parameters for e in p.elements)]
    for name in values:
        variable = name.removesuffix(".start")
        if name not in known and (variable in flat.vectors or variable in flat.scalars):
            words = f"{flat.name} has no parameter '{name}'; {variable} is a variable, its start goes in "
            raise ModelError(words, Given("starts"), argument="parameters")
        if name not in known:
            words = f"{flat.name} has no parameter '{name}'{did_you_mean(name, known)}"
            raise ModelError(words, argument="parameters")
    flat.refuse_twice("parameters", values)
    return replace(flat, parameters=tuple(_with_value(p, remaining) for p in flat.parameters))


def _with_value(parameter: FlatParameter, values: Mapping[str, object]) -> FlatParameter:
    def numbers(name: str, shape: tuple[int, ...]) -> list[ca.SX]:
        place = f"parameters: {name}"
        found = elements_of(place, given(place, values[name], parameter.unit), shape)
        return [ca.SX(x) for x in found]

    own = parameter.name in values
    given_names = [name for name in (parameter.name, *parameter.elements) if name in values]
    if parameter.final and given_names:
        words = f"parameters: found a value for '{given_names[0]}', which is declared final, expected none; leave it out"
        raise ModelError(words, argument="parameters")
    elements = numbers(parameter.name, parameter.shape) if own else list(parameter.value)
    for index, name in enumerate(parameter.elements):
        if name in values and name != parameter.name:
            (elements[index],) = numbers(name, ())
    return replace(parameter, value=tuple(elements))


def parameter_table(flat: FlatModel, keep: frozenset[str] = frozenset()) -> ParameterTable:
    """Sort the parameters of a model out; `keep` names scalars that stay symbols come what may.

    Raises ModelError for parameters that are defined by each other, or that come out not finite.
    """
    symbols = {n: s for p in flat.parameters for n, s in zip(p.elements, p.symbol.elements(), strict=True)}
    bindings = {n: v for p in flat.parameters for n, v in zip(p.elements, p.value, strict=True)}
    folded = {n for p in flat.parameters if p.fold for n in p.elements}
    needs = {n: [] if v.is_constant() else [s.name() for s in ca.symvar(v)] for n, v in bindings.items()}
    for name, others in needs.items():
        foreign = [other for other in others if other not in bindings]
        if foreign:
            raise ModelError(
                f"{name}: found the variable {foreign[0]} in its value, expected parameters only; a parameter is constant, "
                "declare it Real if it is not"
            )
    order = _sorted(needs)
    for name in reversed(order):  # what decides a folded value is folded too
        if name in folded:
            folded.update(needs[name])
    # what follows from a parameter that stays a symbol is no number either
    loose = set(keep) | {n for p in flat.parameters if p.free for n in p.elements}
    for name in order:
        if name in loose or any(other in loose for other in needs[name]):
            loose.add(name)
    folded -= loose
    values: dict[str, float] = {}
    expressions: dict[str, ca.SX] = {}
    independent: set[str] = set()
    for name in order:
        binding = bindings[name]
        if binding.is_symbolic():
            values[name] = values[needs[name][0]]
        elif needs[name]:
            inside = ca.vertcat(*(symbols[n] for n in needs[name]))
            values[name] = float(
                ca.evalf(ca.substitute(binding, inside, ca.DM([values[n] for n in needs[name]])))
            )
        else:
            values[name] = float(binding)
        if not np.isfinite(values[name]):
            raise ModelError(f"{name} = {binding}: found {values[name]}, expected a finite number")
        if name in folded:
            expressions[name] = ca.SX(values[name])
        elif needs[name] and name not in keep:
            inner = [n for n in needs[name] if n in expressions]
            if inner and binding.is_symbolic():
                expressions[name] = expressions[inner[0]]
            else:
                old, new = (column([of[n] for n in inner]) for of in (symbols, expressions))
                expressions[name] = ca.substitute(binding, old, new) if inner else binding
        else:
            independent.add(name)
    _check_limits(flat, values)
    _check_requirements(flat, values, symbols)
    declared = (n for p in flat.parameters for n in p.elements if n in independent)
    return ParameterTable(tuple(declared), values, expressions, symbols)


def _check_limits(flat: FlatModel, values: Mapping[str, float]) -> None:
    """ModelError for a parameter outside of its min and max; one that is free is the optimiser's concern."""
    for parameter in flat.parameters:
        for place, name in enumerate(parameter.elements):
            for limit, word in ((parameter.min, "at least"), (parameter.max, "at most")):
                if limit is None or parameter.free or not limit[place].is_constant():
                    continue
                bound = float(limit[place])
                if values[name] < bound if word == "at least" else values[name] > bound:
                    raise ModelError(
                        f"{name}: value is {values[name]:g}, expected {word} {bound:g} ({parameter.description}); correct it"
                    )


def _check_requirements(flat: FlatModel, values: Mapping[str, float], symbols: Mapping[str, ca.SX]) -> None:
    """ModelError for parameters that a component cannot work with."""
    if not flat.requirements:
        return
    conditions = ca.vertcat(*(ca.SX(r.condition) for r in flat.requirements))
    names = [leaf.name() for leaf in ca.symvar(conditions)]
    foreign = [n for n in names if n not in values]
    if foreign:
        raise ModelError(f"require: found the variable {foreign[0]} in a condition, expected parameters only")
    function = ca.Function("conditions", [ca.vertcat(*(symbols[n] for n in names))], [conditions])
    for requirement, holds in zip(
        flat.requirements, np.array(function([values[n] for n in names])).ravel(), strict=True
    ):
        if not holds:
            here = sorted(s.name() for s in ca.symvar(ca.SX(requirement.condition)))
            found = ", ".join(f"{n} = {values[n]:g}" for n in here[:9])
            raise ModelError(
                f"{requirement.path or 'the model'} ({requirement.model}): found {found}; {requirement.message}"
            )


def _sorted(needs: Mapping[str, list[str]]) -> list[str]:
    """Names in an order in which each comes after those it needs."""
    order: dict[str, None] = {}
    for start in needs:
        stack, path = [start], []
        while stack:
            name = stack[-1]
            if name in order:
                stack.pop()
                continue
            missing = [n for n in needs[name] if n not in order]
            if not missing:
                order[name] = None
                stack.pop()
            elif name in path:
                raise ModelError(
                    f"parameters {', '.join(dict.fromkeys(path))} are defined by each other in a circle"
                )
            else:
                path.append(name)
                stack += missing
    return list(order)
