"""Values of everything at a point that holds some of them: the rest is completed from the start values."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau.border.refusal import InitializationError, ModelError
from gantrytau.border.units import given as in_si
from gantrytau.compiler.parameters import with_values
from gantrytau.compiler.start.consistency import solve_levels
from gantrytau.compiler.start.consistent_start import consistent_start
from gantrytau.compiler.start.level import Level
from gantrytau.compiler.start.start_values import StartValues, contradicts
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import retranslate
from gantrytau.flattening.shapes import elements_of
from gantrytau.language.symbols import derivative_name, split_derivative

STEP = 0.3  # m or rad between stops on the way to given positions
MOST_STEPS = 40


def evaluate(dae: Translated, given: dict[str, Any]) -> dict[str, Any]:
    """See Dae.evaluate."""
    given = {name: in_si(name, value, dae.flat.unit(name)) for name, value in given.items()}
    scalars = given_scalars(dae, given)
    parameters = {n: v for n, v in scalars.items() if n in dae.table.symbols}
    if parameters:
        rest = {n: v for n, v in given.items() if not parameters.keys() & set(dae.expand(n))}
        return evaluate(retranslate(dae, with_values(dae.flat, parameters)), rest)
    values = dict(dae.start)
    held: set[str] = set()
    sizes = {n: float(np.max(np.abs(x))) for whole, x in given.items() for n in dae.expand(whole)}
    for name, number in scalars.items():
        if name == dae.flat.time.name():
            values[name] = number
            continue
        alias = dae.root(name)
        if alias is None:
            raise ModelError(f"{dae.name}: {name} is propagated, not a variable; give what it follows from")
        if alias.root is None:
            offset = dae.number(alias.offset)
            if contradicts(number, offset, sizes[name]):
                raise InitializationError(
                    f"{name}: found {number:g}, but it is constant and equal to {offset:g}"
                )
            continue
        symbol, value = alias.symbol, dae.number(alias.root_value(number))
        size = (sizes[name] + abs(dae.number(alias.offset))) / abs(alias.factor)
        if symbol in held and contradicts(values[symbol], value, size):
            raise InitializationError(
                f"{name}: found {number:g}, which contradicts another given value of the same quantity"
            )
        values[symbol] = value
        held.add(symbol)
    for share in _shares(dae, values, held):
        # on the way, so that mechanisms stay assembled as they are at the start
        way = {n: dae.start.get(n, values[n]) for n in held}
        near = {**values, **{n: begin + share * (values[n] - begin) for n, begin in way.items()}}
        try:
            reached = _complete(dae, near, frozenset(held))
        except InitializationError:
            break  # the straight way leads out of reach; the end need not be
        values |= {n: v for n, v in reached.items() if n not in held}
    found = _complete(dae, values, frozenset(held))
    return named_values(dae, found)


def _shares(dae: Translated, values: Mapping[str, float], held: set[str]) -> list[float]:
    """Intermediate points from the start to given positions: after each metre or radian of STEP."""
    places = [n for n in held if dae.indexed.orders.get(n, 0) > 1]
    free = sum(1 for n in dae.choice.states if dae.indexed.orders.get(n, 0) > 1)
    far = max((abs(values[n] - dae.start[n]) for n in places), default=0.0)
    # more positions than can be chosen are consistent at the end of the way only
    count = min(int(far / STEP) + 1, MOST_STEPS) if len(places) <= free else 1
    return [k / count for k in range(1, count)]


def _complete(dae: Translated, values: dict[str, float], held: frozenset[str]) -> dict[str, float]:
    guess = StartValues(values, dae.asked.started, frozenset())
    derivatives = [n for n in values if split_derivative(n)[0] in dae.known]
    try:
        return consistent_start(dae.flat, dae.reduced, dae.indexed, guess, held | set(derivatives))
    except InitializationError as error:
        free = tuple(n for n in dae.known if n not in held)
        still = held | (set(derivatives) - set(free))
        try:
            if not free:
                raise error
            return consistent_start(dae.flat, dae.reduced, dae.indexed, guess, frozenset(still), free)
        except InitializationError:
            return _jointly(dae, guess, frozenset(still), free, error)


def _jointly(
    dae: Translated,
    guess: StartValues,
    held: frozenset[str],
    free: tuple[str, ...],
    error: InitializationError,
) -> dict[str, float]:
    """All levels at once: what is held may belong to a later level than the positions that it decides."""
    orders = dae.indexed.orders
    late = [n for n in held if orders.get(n, 0) < max(orders.values(), default=0) and n in orders]
    if not late:
        raise error  # all that is held are positions, which have been tried
    whole = dae.indexed.whole
    level = Level(whole.residuals, whole.names, (*whole.unknowns, *free), whole.exact)
    try:
        found = solve_levels([level], guess.values, held=held, started=guess.started | held, title=dae.name)
    except InitializationError:
        raise error from None
    return found


def given_scalars(dae: Translated, given: Mapping[str, Any]) -> dict[str, float]:
    """Values by scalar name; ModelError for unknown names, wrong shapes and numbers that are not finite."""
    found: dict[str, float] = {}
    dae.flat.refuse_twice("given", given)
    for name, value in given.items():
        elements, value = dae.expand(name), in_si(name, value, dae.flat.unit(name))
        found.update(zip(elements, elements_of(name, value, dae.flat.shape(name)), strict=True))
    return found


def named_values(dae: Translated, values: Mapping[str, float]) -> dict[str, Any]:
    """Every variable, parameter and derivative by name, scalars as float and vectors as arrays."""
    names: list[str] = []
    groups: list[tuple[str, tuple[int, ...], list[str]]] = []
    for quantity in dae.flat.propagated:
        groups.append((quantity.name, quantity.shape, list(quantity.elements)))
    for variable in dae.flat.variables:
        for order in range(max(dae.indexed.orders.values(), default=0) + 1):
            elements = [derivative_name(n, order) for n in variable.elements]
            if all(_available(dae, n, order, values) for n in variable.elements):
                groups.append((derivative_name(variable.name, order), variable.shape, elements))
                names += elements
    names += dae.flat.definitions
    numbers = dict(zip(names, dae.numbers(names, values).tolist(), strict=True))
    for name, shape, elements in groups:
        if shape:
            numbers[name] = np.array([numbers[n] for n in elements]).reshape(shape, order="F")
    for parameter in dae.flat.parameters:
        numbers.update((n, dae.table.values[n]) for n in parameter.elements)
        if parameter.shape:
            whole = np.array([dae.table.values[n] for n in parameter.elements])
            numbers[parameter.name] = whole.reshape(parameter.shape, order="F")
    return numbers


def _available(dae: Translated, name: str, order: int, values: Mapping[str, float]) -> bool:
    alias = dae.reduced.aliases[name].shifted(order)
    return alias.root is None or alias.symbol in values
