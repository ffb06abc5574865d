"""What the start values of a model say about the symbols of its reduced equations."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.border.refusal import InitializationError
from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.parameters import ParameterTable
from gantrytau.flattening.flat_model import FlatModel, FlatVariable


@dataclass(frozen=True, eq=False)
class StartValues:
    """Numbers of all symbols before they are consistent; started: given by somebody; fixed: must hold.

    chosen: of the started those that whoever uses the model gave, not its author: they are kept before the others.
    wished: values as they were given, where others are nearer to what is consistent.
    """

    values: Mapping[str, float]
    started: frozenset[str]
    fixed: frozenset[str]
    chosen: frozenset[str] = frozenset()
    wished: Mapping[str, float] | None = None


def start_values(flat: FlatModel, reduced: Reduced, symbols: list[str]) -> StartValues:
    """Start attributes carried over to the symbols of the reduced equations."""
    table, values = reduced.table, dict.fromkeys(symbols, 0.0)
    owners: dict[str, tuple[bool, bool, int]] = {}
    fixed: dict[str, str] = {}
    for variable in flat.variables:
        if variable.start is None:
            continue
        numbers = table.numbers(ca.vertcat(*variable.start))
        size = float(np.max(np.abs(numbers)))
        for name, number in zip(variable.elements, numbers, strict=True):
            _place(variable, name, float(number), size, reduced, values, owners, fixed)
    held = (*(s.name for s in flat.sampled), *flat.discretes)
    for name in held:  # not the start of an alias: only its own is held until the first instant
        values[name] = _own_start(flat, table, name)
    values.update(table.values)
    values[flat.time.name()] = 0.0
    chosen = frozenset(n for n, (_, by_author, _) in owners.items() if not by_author)
    return StartValues(values, frozenset(owners), frozenset(fixed), chosen)


def _own_start(flat: FlatModel, table: ParameterTable, name: str) -> float:
    variable = next(v for v in flat.variables if name in v.elements)
    if variable.start is None:
        return 0.0
    return table.number(variable.start[variable.elements.index(name)])


def contradicts(one: float, other: float, size: float) -> bool:
    """Whether two numbers of one quantity differ by more than rounding; size: of the terms or the vector they are of."""
    return abs(one - other) > 1e-9 * max(abs(one), abs(other), size)


def _place(
    variable: FlatVariable, name: str, number: float, size: float, reduced, values, owners, fixed
) -> None:
    alias, table = reduced.aliases[name], reduced.table
    size += abs(table.number(alias.offset))
    if alias.root is None:
        constant = table.number(alias.offset)
        if variable.fixed and contradicts(number, constant, size):
            raise InitializationError(
                f"{name}: found the fixed start {number:g}, but it is constant and equal to {constant:g}; leave it out"
            )
        return
    symbol, value = alias.symbol, table.number(alias.root_value(number))
    if variable.fixed and symbol in fixed and contradicts(values[symbol], value, size / abs(alias.factor)):
        raise InitializationError(
            f"{name}: fixed start {number:g} contradicts the fixed start of {fixed[symbol]}, of which it is an alias; "
            "release one with Start(...) instead of Fixed(...)"
        )
    rank = (not variable.fixed, not variable.chosen, name.count("."))
    if symbol not in owners or rank < owners[symbol]:
        owners[symbol] = rank
        values[symbol] = value
    if variable.fixed:
        fixed[symbol] = name
