"""A system of components: which output drives which input, what drives the rest, and whether all that fits."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gantrytau.border.dimensions import BASE, dimension
from gantrytau.border.refusal import Given, ModelError, Sentence, did_you_mean
from gantrytau_fmu.systems.component import Component, Scalar, dotted, numeric
from gantrytau_fmu.systems.drives import Drive, drives_of, numbers_of, without_units, wrong

SHOWN, FEW = 6, 5  # names that a message lists, and with their values
KILOGRAM_FIRST = ("kg", "m", "s", "A", "K", "mol", "cd")  # the order of FMI

Place = tuple[str, str]  # component and scalar


class UnconnectedInputs(UserWarning):
    """Inputs of a system that nothing drives: they keep their start values."""


@dataclass(frozen=True)
class SystemConnection:
    """An output and the input that it drives, both by name: input = factor * output + offset.

    convert: afterwards convert between units of the same dimension, as SSP wants unless it is suppressed.
    """

    source: str
    target: str
    factor: float = 1.0
    offset: float = 0.0
    convert: bool = True


@dataclass(frozen=True)
class SignalLink:
    """A scalar output that drives a scalar input: input = factor * output + offset, units converted."""

    source: Place
    target: Place
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class ConnectedSystem:
    """Components, what drives their inputs, and their start values by component and scalar."""

    components: Mapping[str, Component]
    links: tuple[SignalLink, ...]
    drives: Mapping[Place, Drive]
    start: Mapping[str, Mapping[str, float | str]]


def build_system(
    components: Mapping[str, Component],
    connections: Sequence[SystemConnection | tuple[str, str]],
    start: Mapping[str, Any],
    inputs: Mapping[str, Any],
    span: tuple[float, float],
) -> ConnectedSystem:
    """The system, checked; span: begin and stop in s, which samples have to cover.

    Raises ModelError for unknown names, inputs that are driven twice, types and units that do not fit, start values
    that cannot be set, and signals that are none.
    """
    links = [link for connection in connections for link in _links(components, connection)]
    drives = _drives(components, inputs, span)
    taken: dict[Place, str] = {}
    for target, by in [
        *((link.target, dotted(*link.source)) for link in links),
        *((place, "inputs") for place in drives),
    ]:
        if target in taken:
            raise ModelError(
                f"{dotted(*target)} is driven by {taken[target]} and by {by}, expected one of them; "
                "leave the other one out"
            )
        taken[target] = by
    return ConnectedSystem(components, tuple(links), drives, _starts(components, start))


def unconnected(system: ConnectedSystem) -> dict[str, str]:
    """Inputs that are numbers and that nothing drives, whose start nobody chose, by dotted name: the values they keep."""
    driven = {link.target for link in system.links} | set(system.drives)
    return {
        dotted(owner, name): _shown(component.scalars[name].start)
        for owner, component in system.components.items()
        for name in component.of("input")
        if (owner, name) not in driven and name not in system.start[owner]
    }


def _shown(start: str | None) -> str:
    """A start value of a file, shortly: "0.0" as 0, truth values as they are."""
    try:
        return f"{float(start or 0):g}"
    except ValueError:
        return str(start)


def warn_of(inputs: Mapping[str, str], stacklevel: int) -> None:
    """An UnconnectedInputs with the first of these names and values; nothing if there are none."""
    if not inputs:
        return
    few = [f"{name} = {value}" for name, value in list(inputs.items())[:FEW]]
    more = f" and {len(inputs) - FEW} more" if len(inputs) > FEW else ""
    one = len(inputs) == 1
    sentence = Sentence(
        f"nothing drives {'1 input, which keeps its value' if one else f'{len(inputs)} inputs, which keep their values'}: "
        f"{', '.join(few)}{more}; give {'it' if one else 'them'} with ",
        Given("inputs"),
        " or ",
        Given("start"),
    )
    warnings.warn(sentence, UnconnectedInputs, stacklevel=stacklevel + 1)


def locate(components: Mapping[str, Component], name: str, causality: str = "") -> list[Place]:
    """The scalars that a dotted name stands for; ModelError for an unknown component or variable.

    causality: of the variables that its message proposes, "" for all.
    """
    if not isinstance(name, str):
        raise ModelError(f"found {name!r}, expected a name as 'component.variable'")
    owners = [owner for owner in components if name.startswith(dotted(owner, ""))]
    if not owners:
        choice = list(components)
        raise ModelError(
            f"'{name}' begins with no component of the system{did_you_mean(name.partition('.')[0], choice)}"
        )
    owner = max(owners, key=len)
    return [(owner, scalar) for scalar in components[owner].expand(name[len(dotted(owner, "")) :], causality)]


def _links(
    components: Mapping[str, Component], connection: SystemConnection | tuple[str, str]
) -> list[SignalLink]:
    if not isinstance(connection, SystemConnection):
        if not (isinstance(connection, (tuple, list)) and len(connection) == 2):
            raise ModelError(f"connection {connection!r}: expected an output and an input, ('a.y', 'b.u')")
        connection = SystemConnection(*connection)
    words = f"connection {connection.source} -> {connection.target}"
    try:
        sources = locate(components, connection.source, "output")
        targets = locate(components, connection.target, "input")
    except ModelError as error:
        raise ModelError(f"{words}: {error}") from error
    if len(sources) != len(targets):
        raise ModelError(
            f"{words}: found {len(sources)} and {len(targets)} elements, expected equally many; "
            "connect elements by their names, as 'a.y[0]'"
        )
    return [
        _link(components, words, source, target, connection)
        for source, target in zip(sources, targets, strict=True)
    ]


def _link(
    components: Mapping[str, Component],
    words: str,
    source: Place,
    target: Place,
    connection: SystemConnection,
) -> SignalLink:
    start, end = (components[owner].scalars[name] for owner, name in (source, target))
    if end.causality != "input" or start.causality == "input":
        raise ModelError(
            f"{words}: found {start.causality} -> {end.causality}, expected an output and the input it drives"
            + ("; turn them round" if start.causality == "input" and end.causality == "output" else "")
        )
    allowed = {"real": ("real", "integer"), "integer": ("integer",), "boolean": ("boolean",)}
    if start.kind not in allowed.get(end.kind, ()):
        raise ModelError(
            f"{words}: found {start.type} -> {end.type}, expected the same type, "
            "or a whole number that drives a real one; connect other variables"
        )
    scaled = connection.factor != 1.0 or connection.offset != 0.0
    if end.kind == "boolean" and scaled:
        raise ModelError(f"{words}: a linear transformation of a Boolean has no meaning; leave it out")
    factor, offset = connection.factor, connection.offset
    if connection.convert and end.kind == "real":
        ratio, shift = _conversion(words, components[source[0]], start, components[target[0]], end)
        factor, offset = ratio * factor, ratio * offset + shift
    return SignalLink(source, target, factor, offset)


def _conversion(
    words: str, giver: Component, start: Scalar, taker: Component, end: Scalar
) -> tuple[float, float]:
    """Factor and offset between the units of both ends; ModelError if their dimensions differ."""
    if not start.unit or not end.unit or start.unit == end.unit:
        return 1.0, 0.0
    first, second = unit_of(giver, start.unit), unit_of(taker, end.unit)
    if first is None or second is None or first[0] != second[0]:
        raise ModelError(
            f"{words}: found the units '{start.unit}' and '{end.unit}', expected the same dimension; "
            "connect other variables, or correct the unit where it is declared"
        )
    return first[1] / second[1], (first[2] - second[2]) / second[1]


def unit_of(component: Component, unit: str) -> tuple[tuple[int, ...], float, float] | None:
    """Exponents, factor and offset of a unit as its file defines it, else as the toolkit reads it."""
    if unit in component.units:
        return component.units[unit]
    try:
        powers = dict(zip(BASE, dimension(unit), strict=True))
    except ModelError:
        return None
    return tuple(int(powers[base]) for base in KILOGRAM_FIRST), 1.0, 0.0


def _starts(
    components: Mapping[str, Component], start: Mapping[str, Any]
) -> dict[str, dict[str, float | str]]:
    found: dict[str, dict[str, float | str]] = {name: {} for name in components}
    for name, value in start.items():
        places = _places_to_start(components, name, value)
        scalars = [components[owner].scalars[scalar] for owner, scalar in places]
        if len(scalars) == 1 and scalars[0].kind == "text":
            if not isinstance(value, str):
                raise wrong("start", name, f"found {value!r}, expected a text")
            values: Sequence[float | str] = [value]
        else:
            value = without_units("start", name, value, scalars[0].unit)
            values = numbers_of("start", name, value, len(places))
        for (owner, scalar), known, number in zip(places, scalars, values, strict=True):
            if not known.has_start:
                raise wrong("start", dotted(owner, scalar), _calculated(components[owner], known))
            _check_start(dotted(owner, scalar), known, number)
            found[owner][scalar] = number
    return found


def _places_to_start(components: Mapping[str, Component], name: str, value: Any) -> list[Place]:
    """The scalars that a name of `start` stands for; ModelError with the name and what to write instead."""
    try:
        return locate(components, name)
    except ModelError as error:
        short = name.removesuffix(".start") if isinstance(name, str) else name
        if short == name:
            raise wrong("start", name, str(error)) from error
        try:
            locate(components, short)
        except ModelError:
            raise wrong("start", name, str(error)) from error
        raise wrong("start", name, f"found no such variable; in an FMU it is called {short!r}") from None


def _calculated(component: Component, scalar: Scalar) -> str:
    """That a variable cannot be set, and which can."""
    free = [
        name
        for name, known in component.scalars.items()
        if known.has_start and known.causality in ("output", "local") and numeric(known)
    ]
    more = ", ..." if len(free) > SHOWN else ""
    words = f"such as {', '.join(free[:SHOWN])}{more}" if free else "of which this FMU has none"
    return (
        f"a {scalar.variability} {scalar.causality} that is calculated, "
        f"expected a parameter, an input, or a state or other variable with a start value, {words}"
    )


def _check_start(path: str, scalar: Scalar, value: float | str) -> None:
    if not (numeric(scalar) or scalar.kind == "text") or scalar.causality == "structuralParameter":
        raise wrong("start", path, f"a {scalar.causality} of type {scalar.type} cannot be set here")
    if isinstance(value, str):
        return
    if scalar.kind == "integer" and value != round(value):
        raise wrong("start", path, f"found {value!r}, expected a whole number")
    low, high = scalar.min, scalar.max
    if (low is not None and value < low) or (high is not None and value > high):
        sides = (("at least", low), ("at most", high))
        limits = " and ".join(f"{words} {side:.9g}" for words, side in sides if side is not None)
        unit = f" {scalar.unit}" if scalar.unit not in ("", "1") else ""
        expected = f"expected {limits}{unit}, as its FMU says; choose such a value"
        raise wrong("start", path, f"found {value:.9g}, {expected}")


def _drives(
    components: Mapping[str, Component], inputs: Mapping[str, Any], span: tuple[float, float]
) -> dict[Place, Drive]:
    found: dict[Place, Drive] = {}
    for name, value in inputs.items():
        try:
            places = locate(components, name, "input")
        except ModelError as error:
            raise wrong("inputs", name, str(error)) from error
        for owner, scalar in places:
            causality = components[owner].scalars[scalar].causality
            if causality != "input" or not numeric(components[owner].scalars[scalar]):
                expected = f"found {_article(causality)}, expected an input that is a number; parameters are set with "
                raise wrong("inputs", name, expected, Given("start"))
        value = without_units("inputs", name, value, components[places[0][0]].scalars[places[0][1]].unit)
        drives = drives_of("inputs", name, value, len(places), span)
        found.update(zip(places, drives, strict=True))
    return found


def _article(word: str) -> str:
    return f"{'an' if word[0] in 'aeiou' else 'a'} {word}"
