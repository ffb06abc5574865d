"""Writes an instantiated model out as one flat list of variables, parameters and scalar equations."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import casadi as ca

from gantrytau.border.refusal import told
from gantrytau.flattening.attributes import expression, fixed_elements, flat_parameter, flat_variable
from gantrytau.flattening.connections import connection_equations
from gantrytau.flattening.flat_checks import (
    refuse_absent,
    refuse_before,
    refuse_bound,
    refuse_nan,
    refuse_starts,
    refuse_tables,
)
from gantrytau.flattening.flat_model import FlatModel, FlatVariable, Sampled, StickSlip, When
from gantrytau.flattening.instantiation import Instance, Placed, instantiate
from gantrytau.flattening.instants import (
    Events,
    read_delays,
    read_events,
    read_laws,
    sides,
    with_sides,
    with_starts,
)
from gantrytau.flattening.loop_closures import Closure
from gantrytau.flattening.propagation import Spread, Tree, defining, inlined, spanning_tree
from gantrytau.flattening.transitions import read_transitions
from gantrytau.flattening.whens import read_whens, refuse_unassigned
from gantrytau.language.declarations import Parameter
from gantrytau.language.events import Lawful, Sampling, Sticking, Transition, WhenChain
from gantrytau.language.model import Model
from gantrytau.language.scalar_arithmetic import leaf_names
from gantrytau.language.self_description.appearance import Shape, shapes_of
from gantrytau.language.self_description.rods import rods_of
from gantrytau.language.statements import (
    Branch,
    Connection,
    Equation,
    OfTheTree,
    Requirement,
    Root,
    equality,
    place_of,
)
from gantrytau.language.symbols import Range, Symbols, scalars, time, writing
from gantrytau.progress import stage


def flatten(model: Model) -> FlatModel:
    """The model written out as variables, parameters and equations; ModelError with the path of a fault."""
    with stage("instantiation"):
        instance = instantiate(model)
    with stage("flattening"):
        return write_out(instance)


@dataclass
class _Stated:
    """What the components of a model yield, by kind."""

    equations: list[Equation] = field(default_factory=list)
    initial: list[Equation] = field(default_factory=list)
    connections: list[tuple[str, Connection]] = field(default_factory=list)
    ways: list[tuple[str, str, int, Branch | Root]] = field(default_factory=list)
    requirements: list[Requirement] = field(default_factory=list)
    events: list[tuple[str, str, int, Sampling | Sticking]] = field(default_factory=list)
    laws: list[tuple[str, str, int, Lawful]] = field(default_factory=list)
    whens: list[tuple[str, str, int, WhenChain]] = field(default_factory=list)
    transitions: list[tuple[str, str, int, Transition]] = field(default_factory=list)
    modes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    later: list[tuple[str, str, int, OfTheTree, bool]] = field(default_factory=list)

    def take(self, path: str, name: str, number: int, statement: Any, initial: bool = False) -> None:
        """Sort in a statement of a component."""
        if isinstance(statement, OfTheTree):
            self.later.append((path, name, number, statement, initial))
        elif initial:
            self.initial += equality(statement, path, name, number)
        elif isinstance(statement, Connection):
            self.connections.append((path, statement))
        elif isinstance(statement, Requirement):
            self.requirements.append(replace(statement, path=path, model=name))
        elif isinstance(statement, (Sampling, Sticking)):
            self.events.append((path, name, number, statement))
        elif isinstance(statement, Lawful):
            self.laws.append((path, name, number, statement))
        elif isinstance(statement, WhenChain):
            self.whens.append((path, name, number, statement))
        elif isinstance(statement, Transition):
            self.transitions.append((path, name, number, statement))
        elif isinstance(statement, (Branch, Root)):
            self.ways.append((path, name, number, statement))
        else:
            self.equations += equality(statement, path, name, number)

    def take_later(self, instance: Instance, tree: Tree) -> None:
        """Sort in what depends on the spanning tree."""
        for path, name, number, asked, initial in self.later:  # grows where a statement asks again
            found = partial(asked.statements, tree.answer(instance.path(asked.connector), asked.only_root))
            for _, statement in _statements(found, path, name, number):
                self.take(path, name, number, statement, initial)


def _stated(instance: Instance) -> _Stated:
    found = _Stated()
    for path, component in instance.components:
        name = type(component).__name__
        for number, statement in _statements(component.equations, path, name):
            found.take(path, name, number, statement)
        ranges = tuple(instance.symbols.ranges)
        for number, statement in _statements(component.initial_equations, path, name):
            found.take(path, name, number, statement, initial=True)
        instance.symbols.ranges[:] = ranges  # what is asked at the start alone is not watched
    found.initial += _fixed_starts(instance)
    samplings, chains, found.modes = read_transitions(found.transitions, instance)
    found.events += samplings
    found.whens += chains
    return found


def _tree_of(stated: _Stated, instance: Instance) -> Tree:
    """The spanning tree of the connectors; what depends on it joins the other statements."""
    branches = [way for *_, way in stated.ways if isinstance(way, Branch)]
    roots = [way for *_, way in stated.ways if isinstance(way, Root)]
    tree = spanning_tree(instance, stated.connections, branches, roots)
    stated.take_later(instance, tree)
    return tree


def write_out(instance: Instance) -> FlatModel:
    """The flat record of an instantiated model."""
    with writing(instance.symbols):
        stated = _stated(instance)
        equations, connections = stated.equations, stated.connections
        passed_on = defining(instance, tree := _tree_of(stated, instance), equations)
        used = {id(one) for one, _ in passed_on.values()}
        equations = [one for one in equations if id(one) not in used]
        equations += [*_of_the_ways(stated.ways, tree), *_bindings(instance)]
        joined = [c for c in connections if id(c[1]) not in tree.repeated]
        cut = (Closure(instance, k, c, loop) for k, (c, loop) in enumerate(tree.closing))
        closures = [closure for closure in cut if closure.equations]
        equations += connection_equations(instance, joined, closures)
        equations += [e for closure in closures for e in closure.equations]
        spread = Spread(instance, tree, passed_on)
        written, written_initial = spread.substituted(equations), spread.substituted(stated.initial)
        events, sampled, frictions, whens, right = _events(stated, instance, spread)
        everything = (*written, *written_initial, *right)
        names = leaf_names(e.residual for e in everything)
        refuse_before((*written, *written_initial), names)
        refuse_tables(everything)
        refuse_nan(everything)
        spread.refuse_undefined(everything, names)
        absent = _absent([way for *_, way in stated.ways], tree)
        refuse_absent(everything, names, absent)
        refuse_starts(instance, absent)
        placed = [p for p in instance.quantities if not absent.keys() & set(p.elements)]
        kinds = _kinds(placed, spread)
        parameters = tuple(flat_parameter(p) for p in placed if kinds[p.name] == "parameter")
        moving = (flat_variable(p) for p in placed if kinds[p.name] not in ("parameter", "propagated"))
        variables = with_starts(tuple(moving), events)
        delays, past, positive = read_delays(instance.symbols, spread, variables)
        discretes = _discretes(variables, whens, written)
        passed = tuple(flat_variable(p) for p in placed if kinds[p.name] == "propagated")
    return FlatModel(
        name=type(instance.root).__name__,
        time=time,
        variables=(*variables, *past, *(v for closure in closures for v in closure.variables)),
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
        requirements=(*stated.requirements, *events.requirements, *positive),
        sampled=sampled,
        frictions=frictions,
        whens=whens,
        discretes=discretes,
        before={n: s.sx for n in discretes if (s := instance.symbols.by_name.get(f"pre({n})"))},
        delays=delays,
        ranges=_ranges(instance.symbols, spread),
        **_said(instance, stated, sampled),
        shapes=_shapes(instance, absent),
    )


def _shapes(instance: Instance, absent: Mapping[str, str]) -> tuple[Shape, ...]:
    """What is seen of the components, but for what hangs on names that this model has no use for."""
    known = [name for p in instance.quantities for name in (p.name, *p.elements)]
    found = shapes_of(instance.components, known)
    gone = {p.name for p in instance.quantities if absent.keys() & set(p.elements)} | set(absent)
    return tuple(shape for shape in found if not gone & set(shape.names))


def _said(instance: Instance, stated: _Stated, sampled: Sequence[Sampled]) -> dict[str, Any]:
    """What the components say of themselves beside their equations."""
    laws = read_laws(stated.laws, instance.symbols, sampled)
    unchecked = frozenset(path for path, one in instance.components if not one.checks_units)
    return dict(
        rods=rods_of(instance.root),
        unchecked=unchecked,
        experiment=instance.root.annotated_experiment,
        laws=laws,
        modes=stated.modes,
    )


def _kinds(placed: Sequence[Placed], spread: Spread) -> dict[str, str]:
    kinds = {p.name: "parameter" if _is_parameter(p) else p.declaration.kind for p in placed}
    return kinds | {p.name: "propagated" for p in inlined(placed) if p.elements[0] in spread.definitions}


def _ranges(symbols: Symbols, spread: Spread) -> tuple[Range, ...]:
    """What has been noted in the equations, in the symbols of the flat model."""
    whole = [Equation(r.expression, ca.SX(0), "", "", 0) for r in symbols.ranges]
    written = spread.substituted(whole)
    return tuple(replace(r, expression=e.left) for r, e in zip(symbols.ranges, written, strict=True))


def _events(
    stated: _Stated, instance: Instance, spread: Spread
) -> tuple[Events, tuple[Sampled, ...], tuple[StickSlip, ...], tuple[When, ...], tuple[Equation, ...]]:
    """What happens at instants: as it is read, the records of it, and their expressions as right sides of equations."""
    events = read_events(stated.events, instance.symbols)
    held = spread.substituted(sides([*events.sampled, *events.frictions]))
    refuse_before(held, leaf_names(e.residual for e in held))
    whens = read_whens(stated.whens, instance.symbols, {s.name for s in events.sampled})
    written = (*held, *spread.substituted(sides(whens)))
    rest = iter(written)
    sampled, frictions = with_sides(events.sampled, rest), with_sides(events.frictions, rest)
    return events, sampled, frictions, with_sides(whens, rest), written


def _discretes(
    variables: Iterable[FlatVariable], whens: Sequence[When], equations: Iterable[Equation]
) -> tuple[str, ...]:
    """Names of the Discretes, scalars. ModelError for one that no when sets, or something else."""
    own = [v for v in variables if v.kind == "discrete"]
    names = tuple(n for v in own for n in v.elements)
    refuse_bound(own, equations)
    refuse_unassigned(names, whens)
    return names


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


def _is_parameter(placed: Placed) -> bool:
    return isinstance(placed.declaration, Parameter)


def _statements(
    generate: Callable[[], Iterable[Any]], path: str, model: str, number: int = 0
) -> Iterator[tuple[int, Any]]:
    """Numbered statements of a component; an error on the way is told with the place where it happened."""
    within, end = path or "the model", object()
    generator: Iterator[Any] = told(place_of(path, model, number + 1), lambda: iter(generate()), within)
    while True:
        statement = told(place_of(path, model, number + 1), lambda: next(generator, end), within)
        if statement is end:
            return
        number += not isinstance(statement, Requirement)
        yield number, statement


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


def _fixed_starts(instance: Instance) -> Iterator[Equation]:
    """Initial equations of the arrays of which some elements alone have fixed starts."""
    for placed in instance.quantities:
        fixed = [] if _is_parameter(placed) else fixed_elements(placed)
        if any(fixed) and not all(fixed):
            starts = expression(placed, "start") if "start" in placed.attributes else [ca.SX(0)] * len(fixed)
            for row, (left, right) in enumerate(zip(scalars(placed.symbol), starts, strict=True)):
                if fixed[row]:
                    yield Equation(left, right, placed.name, "fixed start", 1, row)


def _free_inputs(instance: Instance, equations: Iterable[Equation]) -> tuple[str, ...]:
    """Inputs that stay known from outside: not bound, not connected, not set by an enclosing component."""
    owners = {n: p.path for p in instance.quantities if p.declaration.kind == "input" for n in p.elements}
    for equation in equations:
        # a binding sets the variable on its left, and reads what is on its right
        for side in (equation.left,) if equation.model == "binding" else (equation.left, equation.right):
            symbol = instance.symbols.find(side)
            owner = owners.get(symbol.name, equation.path) if symbol is not None else equation.path
            if symbol is not None and owner != equation.path:
                around = not equation.path or owner.startswith((f"{equation.path}.", f"{equation.path}["))
                if around or equation.model in ("binding", "connection"):
                    del owners[symbol.name]
    return tuple(owners)
