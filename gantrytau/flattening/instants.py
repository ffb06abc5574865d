"""What happens at instants, scalar by scalar: statements read into the records of the flat model, and their refusals."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.flattening.flat_model import Delay, FlatVariable, OnInstants, Sampled, SampledLaw, StickSlip
from gantrytau.flattening.propagation import Spread
from gantrytau.flattening.shapes import joined
from gantrytau.language.events import Lawful, Sampling, Sticking
from gantrytau.language.statements import Equation, Requirement, place_of
from gantrytau.language.symbols import Symbol, Symbols, scalars

Statement = TypeVar("Statement", bound=OnInstants)


@dataclass(eq=False)
class Events:
    """What the samplings and frictions of a model say, scalar by scalar."""

    sampled: list[Sampled] = field(default_factory=list)
    frictions: list[StickSlip] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    starts: dict[str, ca.SX] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)


def read_events(stated: Sequence[tuple[str, str, int, Sampling | Sticking]], symbols: Symbols) -> Events:
    """The records of statements (path, class, number, statement). ModelError for what cannot be one."""
    events = Events()
    for path, model, number, statement in stated:
        place = place_of(path, model, number)
        if isinstance(statement, Sampling):
            _read_sampling(events, statement, symbols, (path, model, place))
        else:
            _read_sticking(events, statement, symbols, (path, model, place))
    return events


def _read_sampling(events: Events, statement: Sampling, symbols: Symbols, where: tuple[str, str, str]):
    path, model, place = where
    names = [s.name for s in declared(statement.variable, symbols, place, "sampled", ("real", "output"))]
    shape = statement.variable.shape
    expressions = sized(statement.expression, shape, place, "the expression")
    period = _of_parameters(statement.period, (1, 1), symbols, place, "period")[0]
    if period.is_constant() and not 0 < float(period) < float("inf"):
        raise ModelError(f"{place}: found period={period}, expected a finite number above zero, in s")
    if not period.is_constant():
        events.requirements.append(
            Requirement(period > 0, "expected a sampling period above zero, in s", path, model)
        )
    if statement.start is not None:
        starts = _of_parameters(statement.start, shape, symbols, place, "start")
        events.starts.update(zip(names, starts, strict=True))
    for name, expression in zip(names, expressions, strict=True):
        _take(events, name, place)
        events.sampled.append(Sampled(name, expression, period, path, model))


def read_laws(
    stated: Sequence[tuple[str, str, int, Lawful]], symbols: Symbols, sampled: Sequence[Sampled]
) -> tuple[SampledLaw, ...]:
    """The laws of statements (path, class, number, statement); ModelError for what is not sampled."""
    found, known = [], {one.name for one in sampled}
    for path, model, number, one in stated:
        place = place_of(path, model, number)
        sets, reads = (
            tuple(s.name for x in side for s in declared(x, symbols, place, "by_law", ("real", "output")))
            for side in (one.found, one.given)
        )
        if odd := [name for name in (*sets, *reads) if name not in known]:
            raise ModelError(f"{place}: found {odd[0]} in by_law, expected sampled scalars; sample it")
        found.append(SampledLaw(sets, reads, one.law, path, model))
    return tuple(found)


def _read_sticking(events: Events, statement: Sticking, symbols: Symbols, where: tuple[str, str, str]):
    path, model, place = where
    force = _single(declared(statement.force, symbols, place, "the force", ("real", "output")), place)
    speed = _single(declared(statement.speed, symbols, place, "the speed", ("real", "output")), place)
    parts = {
        key: sized(getattr(statement, key), (1, 1), place, key)[0]
        for key in ("coulomb", "smooth", "breakaway")
    }
    _take(events, force, place)
    limits = (
        (parts["coulomb"], 0.0, "coulomb >= 0"),
        (parts["breakaway"], parts["coulomb"], "breakaway >= coulomb"),
    )
    for larger, smaller, words in limits:
        holds = larger >= smaller
        leaves = [symbols.find(leaf) for leaf in ca.symvar(holds)]
        if holds.is_constant() and not float(holds):
            raise ModelError(
                f"{place}: found {float(larger)} and {float(smaller)}, expected {words} in stick_slip; correct them"
            )
        if leaves and all(leaf is not None and leaf.kind == "parameter" for leaf in leaves):
            events.requirements.append(Requirement(holds, f"expected {words} in stick_slip", path, model))
    events.frictions.append(StickSlip(force, speed, **parts, path=path, model=model))


def _take(events: Events, name: str, place: str) -> None:
    if name in events.places:
        raise ModelError(f"{place}: found {name}, which {events.places[name]} gives already; leave one out")
    events.places[name] = place


def declared(variable: Any, symbols: Symbols, place: str, role: str, kinds: Sequence[str]) -> list[Symbol]:
    """The symbols of a declared variable."""
    elements = scalars(variable) if isinstance(variable, ca.SX) else []
    found = [symbol for element in elements if (symbol := symbols.find(element)) is not None]
    wrong = [s for s in found if s.kind not in kinds or s.order]
    if not found or len(found) != len(elements) or wrong:
        text = f"{wrong[0].name}, a derivative" if wrong and wrong[0].order else ""
        text = text or (
            f"{wrong[0].name}, declared as {wrong[0].kind}" if wrong else f"'{str(variable)[:80]}'"
        )
        raise ModelError(
            f"{place}: {role}: found {text}, expected a variable declared as Real or Output; declare one"
            + (" and equate it to the input" if wrong and wrong[0].kind == "input" else "")
        )
    return found


def _single(found: Sequence[Symbol], place: str) -> str:
    if len(found) > 1:
        raise ModelError(
            f"{place}: found {len(found)} elements in stick_slip, expected one; yield one for each element"
        )
    return found[0].name


def sized(value: Any, shape: tuple[int, int], place: str, role: str) -> list[ca.SX]:
    """An expression as scalars, column after column, of a wanted shape."""
    try:
        found = joined(value)
    except (NotImplementedError, RuntimeError, TypeError, ValueError) as error:
        raise ModelError(
            f"{place}: found {role} {value!r}, expected a number or an expression of symbols"
        ) from error
    if found.shape != shape:
        raise ModelError(f"{place}: {role} has shape {found.shape}, expected {shape}; correct it")
    return scalars(found)


def _of_parameters(
    value: Any, shape: tuple[int, int], symbols: Symbols, place: str, role: str
) -> list[ca.SX]:
    """Numbers or expressions of parameters; one number may stand for all."""
    whole = sized(value, (1, 1) if isinstance(value, (int, float)) else shape, place, role)
    for leaf in ca.symvar(ca.vertcat(*whole)):
        symbol = symbols.find(leaf)
        if symbol is None or symbol.kind != "parameter":
            raise ModelError(
                f"{place}: found {leaf.name()} in {role}, expected a number or an expression of parameters"
            )
    return whole * (shape[0] * shape[1] // len(whole))


def sides(statements: Sequence[OnInstants]) -> list[Equation]:
    """The expressions of statements on instants as right sides of equations, for checks and substitutions."""
    found = []
    for one in statements:
        for name, value in one.sides:
            label = one.label + (", its time" if name == "time" else "")
            found.append(Equation(ca.SX.sym(name), value, one.path, one.model, 0, label=label))
    return found


def with_sides(statements: Sequence[Statement], written: Iterator[Equation]) -> tuple[Statement, ...]:
    """The statements with the next right sides of `sides` as they were substituted."""

    def new(value: Any) -> Any:
        if isinstance(value, ca.SX):
            return next(written).right
        return tuple((n, next(written).right) for n, _ in value) if isinstance(value, tuple) else value

    return tuple(replace(x, **{f.name: new(getattr(x, f.name)) for f in fields(x)}) for x in statements)


def with_starts(variables: Sequence[FlatVariable], events: Events) -> tuple[FlatVariable, ...]:
    """Variables with the start values that samplings give; ModelError where they have another already."""
    if not events.starts:
        return tuple(variables)
    found = []
    for variable in variables:
        given = [n for n in variable.elements if n in events.starts]
        if given and variable.start is not None:
            raise ModelError(
                f"{events.places[given[0]]}: found start= and the start value of the declaration of {given[0]}, "
                "expected one of them; leave start= out"
            )
        starts = tuple(events.starts.get(n, ca.SX(0)) for n in variable.elements)
        found.append(replace(variable, start=starts) if given else variable)
    return tuple(found)


def read_delays(
    symbols: Symbols, spread: Spread, variables: Sequence[FlatVariable]
) -> tuple[tuple[Delay, ...], tuple[FlatVariable, ...], list[Requirement]]:
    """The delays, their variables, and what their times must satisfy; ModelError for a time that varies."""
    stated = list(symbols.delays.values())
    requirements = []
    for one in stated:
        for leaf in ca.symvar(one.time):
            symbol = symbols.find(leaf)
            if symbol is None or symbol.kind != "parameter":
                raise ModelError(
                    f"{one.name}: found {leaf.name()} in the time of a delay, expected a number or an expression of "
                    "parameters"
                )
        if not one.time.is_constant():
            words = f"expected a time above zero, in s, in {one.name}"
            requirements.append(Requirement(one.time > 0, words))
    bare = [Delay(one.name, one.expression, one.time) for one in stated]
    delays = with_sides(bare, iter(spread.substituted(sides(bare))))
    units = {name: v.unit for v in variables for name in v.elements}
    described = {name: v.description for v in variables for name in v.elements}
    found = [
        FlatVariable(
            name=one.name,
            kind="real",
            shape=(),
            elements=(one.name,),
            symbol=one.symbol,
            unit=units.get(str(one.expression)),
            description=f"{described.get(str(one.expression)) or one.expression}, {one.time} s ago"[:120],
        )
        for one in stated
    ]
    return delays, tuple(found), requirements
