"""Writes an instantiated model out as one flat list of variables, parameters and scalar equations."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.errors import ModelError, in_words, told
from gantrytau.flattening.connections import connection_equations
from gantrytau.flattening.flat_model import FlatModel, FlatParameter, FlatVariable
from gantrytau.flattening.instantiation import Instance, Leaf, Placed, instantiate, prefer_of
from gantrytau.flattening.instants import expressed, read_events, with_expressions, with_starts
from gantrytau.flattening.loop_closures import Closure
from gantrytau.flattening.propagation import Spread, Tree, spanning_tree
from gantrytau.language.declarations import Parameter, evaluate
from gantrytau.language.events import Sampling, Sticking
from gantrytau.language.model import Model
from gantrytau.language.rods import rods_of
from gantrytau.language.statements import Branch, Connection, Equation, Requirement, Root, equality
from gantrytau.language.symbols import scalars, split_derivative, time, writing


def flatten(model: Model) -> FlatModel:
    """The model written out as variables, parameters and equations; ModelError with the path of a fault."""
    return write_out(instantiate(model))


@dataclass
class _Stated:
    """What the components of a model yield, by kind."""

    equations: list[Equation] = field(default_factory=list)
    initial: list[Equation] = field(default_factory=list)
    connections: list[tuple[str, Connection]] = field(default_factory=list)
    ways: list[tuple[str, str, int, Branch | Root]] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    events: list[tuple[str, str, int, Sampling | Sticking]] = field(default_factory=list)


def _stated(instance: Instance) -> _Stated:
    found = _Stated()
    for path, component in instance.components:
        name = type(component).__name__
        for number, statement in _statements(component.equations, path, name):
            if isinstance(statement, Connection):
                found.connections.append((path, statement))
            elif isinstance(statement, Requirement):
                found.requirements.append(replace(statement, path=path, model=name))
            elif isinstance(statement, (Sampling, Sticking)):
                found.events.append((path, name, number, statement))
            elif isinstance(statement, (Branch, Root)):
                found.ways.append((path, name, number, statement))
            else:
                found.equations += equality(statement, path, name, number)
        for number, statement in _statements(component.initial_equations, path, name):
            found.initial += equality(statement, path, name, number)
    return found


def write_out(instance: Instance) -> FlatModel:
    """The flat record of an instantiated model."""
    with writing(instance.symbols):
        stated = _stated(instance)
        equations, connections = stated.equations, stated.connections
        statements = [way for *_, way in stated.ways]
        tree = spanning_tree(
            instance,
            connections,
            [way for way in statements if isinstance(way, Branch)],
            [way for way in statements if isinstance(way, Root)],
        )
        equations += _of_the_ways(stated.ways, tree)
        equations += _bindings(instance)
        joined = [c for c in connections if id(c[1]) not in tree.repeated]
        closures = [Closure(instance, k, c, loop) for k, (c, loop) in enumerate(tree.closing)]
        equations += connection_equations(instance, joined, closures)
        equations += [e for closure in closures for e in closure.equations]
        spread = Spread(instance, tree)
        written = spread.substituted(equations)
        written_initial = spread.substituted(stated.initial)
        events = read_events(stated.events, instance.symbols)
        written_events = spread.substituted(expressed(events, instance.symbols))
        sampled, frictions = with_expressions(events, written_events)
        everything = (*written, *written_initial, *written_events)
        _refuse_nan(everything)
        spread.refuse_undefined(everything)
        absent = _absent(statements, tree)
        _refuse_absent(everything, absent)
        _refuse_starts(instance, absent)
        placed = [p for p in instance.quantities if not absent.keys() & set(p.elements)]
        kinds = {p.name: "parameter" if _is_parameter(p) else p.declaration.kind for p in placed}
        parameters = tuple(_parameter(p) for p in placed if kinds[p.name] == "parameter")
        variables = tuple(_variable(p) for p in placed if kinds[p.name] not in ("parameter", "propagated"))
        variables = with_starts(variables, events)
        passed = tuple(_variable(p) for p in placed if kinds[p.name] == "propagated")
    return FlatModel(
        name=type(instance.root).__name__,
        time=time,
        variables=(*variables, *(v for closure in closures for v in closure.variables)),
        parameters=parameters,
        equations=written,
        initial_equations=written_initial,
        derivatives={n: s.sx for n, s in instance.symbols.by_name.items() if s.order > 0},
        propagated=tuple(v for v in passed if v.elements[0] in spread.definitions),
        definitions=spread.definitions,
        rates=spread.rates,
        loops=tuple(loop for _, loop in tree.closing),
        inputs=_free_inputs(instance, equations),
        absent=absent,
        requirements=(*stated.requirements, *events.requirements),
        sampled=sampled,
        frictions=frictions,
        rods=rods_of(instance.root),
    )


def _of_the_ways(ways: list[tuple[str, str, int, Branch | Root]], tree: Tree) -> list[Equation]:
    """Equations of the branches and roots that describe themselves by coordinates, or are cut."""
    found: list[Equation] = []
    for path, name, number, way in ways:
        used = id(way) in tree.used
        statements = way.equations if used else way.otherwise if isinstance(way, Branch) else ()
        for statement in statements:
            found += equality(statement, path, name, number)
    return found


def _absent(statements: list[Branch | Root], tree: Tree) -> dict[str, str]:
    """Names of coordinates that are not needed, and why."""
    found: dict[str, str] = {}
    for way in statements:
        if way.coordinates is not None and id(way) not in tree.used:
            why = (
                "loops are opened here, so the joint has no coordinates of its own"
                if isinstance(way, Branch)
                else "the orientation follows from the joints between the body and the world"
            )
            found.update((s.name(), why) for s in scalars(way.coordinates))
    return found


def _refuse_absent(equations: Iterable[Equation], absent: Mapping[str, str]) -> None:
    for equation in equations if absent else ():
        for leaf in ca.symvar(equation.residual):
            if split_derivative(leaf.name())[0] in absent:
                name = split_derivative(leaf.name())[0]
                raise ModelError(
                    f"{equation.name}: found {name}, which does not exist: {absent[name]}; use the orientation R "
                    "or angular velocity w of a frame instead"
                )


def _refuse_starts(instance: Instance, absent: Mapping[str, str]) -> None:
    """Start values of coordinates that do not exist would be lost silently."""
    for placed in instance.quantities:
        start = placed.attributes.get("start")
        changed = start is not None and start.value is not placed.declaration.start
        if placed.elements[0] in absent and changed:
            raise ModelError(
                f"{placed.name}: found a start value, but it does not exist: {absent[placed.elements[0]]}; give start "
                "values to the coordinates of those joints"
            )


def _is_parameter(placed: Placed) -> bool:
    return isinstance(placed.declaration, Parameter)


def _statements(generate: Callable[[], Iterable[Any]], path: str, model: str) -> Iterator[tuple[int, Any]]:
    """Numbered statements of a component; an error on the way is told with the place where it happened."""
    within, number, end = path or "the model", 0, object()
    generator: Iterator[Any] = told(f"{within} ({model}), equation 1", lambda: iter(generate()), within)
    while True:
        place = f"{within} ({model}), equation {number + 1}"
        statement = told(place, lambda: next(generator, end), within)
        if statement is end:
            return
        number += not isinstance(statement, Requirement)
        yield number, statement


def _refuse_nan(equations: Iterable[Equation]) -> None:
    """Functions of the module math turn a symbol into nan without a word."""
    equations = tuple(equations)
    if equations and re.search(r"\bnan\b", str(ca.vertcat(*(e.residual for e in equations)))):
        for equation in equations:
            if re.search(r"\bnan\b", equation.text):
                raise ModelError(
                    f"{equation.name}: found nan in `{equation.text[:100]}`, expected symbols and "
                    "finite numbers; "
                    "functions of the module math do not work on symbols, use those of gantrytau or casadi"
                )


def _bindings(instance: Instance) -> list[Equation]:
    """`phi=0.5` as a modification of a variable is the equation phi == 0.5."""
    found: list[Equation] = []
    for placed in instance.quantities:
        if "value" in placed.attributes and not _is_parameter(placed):
            value = expression(placed, "value")
            for row, (left, right) in enumerate(zip(scalars(placed.symbol), value, strict=True)):
                found.append(
                    Equation(left, right, placed.name, "binding", 1, row if len(value) > 1 else None)
                )
    return found


def _free_inputs(instance: Instance, equations: Iterable[Equation]) -> tuple[str, ...]:
    """Inputs that stay known from outside: not bound, not connected, not set by an enclosing component."""
    owners = {n: p.path for p in instance.quantities if p.declaration.kind == "input" for n in p.elements}
    for equation in equations:
        for side in (equation.left, equation.right):
            symbol = instance.symbols.find(side)
            if symbol is not None and symbol.name in owners and equation.path != owners[symbol.name]:
                inside = owners[symbol.name].startswith(equation.path) or equation.model in (
                    "binding",
                    "connection",
                )
                if inside:
                    del owners[symbol.name]
    return tuple(owners)


def expression(placed: Placed, attribute: str) -> tuple[ca.SX, ...]:
    """An attribute as one SX per scalar of a quantity; one number may stand for all starts or limits."""
    leaf: Leaf = placed.attributes[attribute]
    value = leaf.value.value if isinstance(leaf.value, Parameter) and not leaf.value.name else leaf.value
    try:
        value = evaluate(value, leaf.scope)
        found = ca.densify(ca.SX(_array(value)))
    except (RuntimeError, TypeError, NotImplementedError, AttributeError, ValueError) as error:
        why = "" if isinstance(error, NotImplementedError) else f": {in_words(error)}"
        raise ModelError(
            f"{placed.name}: {attribute} is {leaf.value!r}, expected a number, an array or an expression of "
            f"parameters{why}"
        ) from error
    size = len(placed.elements)
    if found.numel() == 1 and (size == 1 or attribute != "value"):
        elements = found.elements() * size
    elif found.numel() == size and (len(placed.shape) < 2 or found.shape == placed.shape):
        elements = found.elements()
    else:
        shape = () if found.numel() == 1 else found.shape if found.shape[1] != 1 else (found.shape[0],)
        raise ModelError(f"{placed.name}: {attribute} has shape {shape}, expected {placed.shape}")
    bad = [e for e in elements if e.is_constant() and not _allowed(float(e), attribute)]
    if bad:
        raise ModelError(f"{placed.name}: {attribute} is {bad[0]}, expected a finite number")
    return tuple(elements)


def _array(value: Any) -> Any:
    """A list of numbers, of rows of numbers, or of symbols as one array."""
    if not isinstance(value, (list, tuple)):
        return value
    if any(isinstance(item, (ca.SX, ca.DM)) for item in value):
        return ca.vertcat(*value)
    return ca.DM(np.asarray(value, dtype=float))


def _allowed(value: float, attribute: str) -> bool:
    infinite = value in (float("inf"), float("-inf"))
    return value == value and (attribute in ("min", "max") or not infinite)


def _variable(placed: Placed) -> FlatVariable:
    return FlatVariable(**_common(placed), prefer=prefer_of(placed.attributes))


def _common(placed: Placed) -> dict[str, Any]:
    attributes = placed.attributes
    limits = {key: expression(placed, key) for key in ("min", "max", "nominal") if key in attributes}
    return dict(
        name=placed.name,
        kind=placed.declaration.kind,
        shape=placed.shape,
        elements=tuple(placed.elements),
        symbol=placed.symbol,
        unit=attributes["unit"].value if "unit" in attributes else None,
        description=attributes["description"].value if "description" in attributes else "",
        start=expression(placed, "start") if "start" in attributes else None,
        fixed=bool(attributes["fixed"].value) if "fixed" in attributes else False,
        owner=placed.path,
        free=getattr(placed.declaration, "free", False),
        undetermined=attributes["undetermined"].value,
        **limits,
    )


def _parameter(placed: Placed) -> FlatParameter:
    if "value" not in placed.attributes:
        raise ModelError(
            f"{placed.name} ({placed.declaration.words()}) has no value, expected one; "
            f"give it where the component is declared, `{placed.name.split('.')[-1]}=...`"
        )
    declaration = placed.declaration
    assert isinstance(declaration, Parameter)
    return FlatParameter(**_common(placed), value=expression(placed, "value"), fold=declaration.fold)
