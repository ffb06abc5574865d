"""Expandable connectors (Modelica 3.6, chapter 9.1.3): their members are those to which something is connected."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration.modifiers import NOTHING, Element
from gantrytau.modelica.references import connects_in

MOST_LEVELS = 20  # of expandable connectors in each other


class End(NamedTuple):
    """One side of a connection: the members of expandable connectors on the way, and what stands there in the end.

    way: pairs of a connector and a name; last: the component, None where it is not declared; bus: the instance, if it is an
    expandable connector; number: the subscript behind an undeclared name, 0 without one; above: sizes of the arrays of
    components that hold the last one.
    """

    way: list[tuple[Any, str]]
    last: Any
    bus: Any
    number: int
    above: tuple[int, ...] = ()


def is_expandable(structure: Any) -> bool:
    """Whether an instance is an expandable connector."""
    return "expandable" in structure.scope.definition.prefixes


def expand(root: Any) -> None:
    """Give the expandable connectors of an instance their members; ModelError where no connection says what one is."""
    for _ in range(MOST_LEVELS):
        every = [*_instances(root)]
        buses = [one for one in every if is_expandable(one)]
        if not buses or not _expanded(buses, [pair for one in every for pair in _connections(one)]):
            return
    raise ModelError(
        f"found expandable connectors in each other without an end, expected at most {MOST_LEVELS} levels"
    )


def _instances(structure: Any) -> Iterator[Any]:
    yield structure
    for one in structure.members.values():
        if one.primitive is None and one.present and not one.is_object and "outer" not in one.prefixes:
            for child in one.children:
                yield from _instances(child)


def _connections(structure: Any) -> Iterator[tuple[End, End]]:
    for section in structure.scope.sections if not is_expandable(structure) else ():
        if section.kind == "equation":
            for item, reader in _each(connects_in(section.items), structure.interpreter(section.scope)):
                a, b = (_end(one, structure, reader) for one in (item.a, item.b))
                if a is not None and b is not None:
                    yield a, b
                    for one, other in zip(_elements(a), _elements(b), strict=False):
                        yield End([], None, one, 0), End([], None, other, 0)


def _elements(end: End) -> list[Any]:
    """The expandable connectors of an array that is one side of a connection as a whole."""
    each = end.last.children if end.last is not None and end.bus is None else []
    return [one for one in each if is_expandable(one)]


def _each(items: Any, reader: Any) -> Iterator[tuple[Any, Any]]:
    """The connections in loops and conditions that are known."""
    for item in items:
        if isinstance(item, tree.ForLoop):
            for inner in reader.looped(item.iterators):
                yield from _each(item.items, inner)
        elif isinstance(item, tree.Branching):
            tests, last = reader.open_branches(item.branches, item.otherwise or ())
            for chosen in (*(then for _, then in tests), last):
                yield from _each(chosen, reader)
        else:
            yield item, reader


def _end(reference: Any, structure: Any, reader: Any) -> End | None:
    """What a side of a connection leads to; None for what is absent, or an array of components as a whole."""
    here, one, way, above = structure, None, [], ()
    for k, (name, subscripts) in enumerate(reference.parts):
        one = here.members.get(name)
        if is_expandable(here):
            way.append((here, name))
        if one is None:
            last = k + 1 == len(reference.parts)
            places = reader.places(subscripts[0], 10**6) if len(subscripts) == 1 else -1
            number = 1 + (places if isinstance(places, int) else max(places, default=-1))
            return End(way, None, None, number) if way and last else None
        if not one.present:
            return None
        if one.primitive is not None:
            return End(way, one, None, 0, above)
        every = (*subscripts, *[tree.Mark(0, ":")] * (len(one.shape) - len(subscripts)))
        places = [reader.places(*axis) for axis in zip(every, one.shape, strict=True)]
        many = tuple(len(place) for place in places if isinstance(place, list))
        if many and (k + 1 == len(reference.parts) or 0 in many):
            return End(way, one, None, 0, above)
        above, place = (*above, *many), 0
        for chosen, size in zip(places, one.shape, strict=True):
            place = place * size + (chosen if isinstance(chosen, int) else chosen[0])
        here = one.children[place]
    return End(way, one, here if is_expandable(here) and not above else None, 0, above)


def _expanded(buses: list[Any], connections: list[tuple[End, End]]) -> bool:
    """Whether any of the connectors got other members than it had."""
    group = {id(one): [one] for one in buses}
    used: dict[int, dict[str, Element | None]] = {id(one): {} for one in buses}
    sizes: dict[tuple[int, str], int] = {}

    def join(a: Any, b: Any) -> None:
        both = group[id(a)] if group[id(a)] is group[id(b)] else group[id(a)] + group[id(b)]
        for one in both:
            group[id(one)] = both

    for a, b in connections:
        if a.bus is not None and b.bus is not None:
            join(a.bus, b.bus)
        for end, other in ((a, b), (b, a)):
            for bus, name in end.way:
                known = used[id(bus)].get(name) or bus.scope.elements.get(name)
                new = known is None and other.last is not None
                made = _alike(other.last, name, other.above) if new else known
                used[id(bus)][name] = made
                sizes[id(bus), name] = max(sizes.get((id(bus), name), 0), end.number)
    for bus in buses:  # the outer ones first
        for mate in group[id(bus)]:
            for name in bus.members.keys() & mate.members.keys():
                for a, b in zip(bus.members[name].children, mate.members[name].children, strict=False):
                    if id(a) in group and id(b) in group:
                        join(a, b)
    changed = False
    for bus in buses:
        found: dict[str, Element] = {}
        for one in group[id(bus)]:
            for name, element in used[id(one)].items():
                size = max(sizes.get((id(each), name), 0) for each in group[id(bus)])
                mine = bus.scope.elements.get(name) or found.get(name) or element
                if mine is not None:
                    found[name] = _sized(mine, size) if size else mine
        if found.keys() != bus.scope.elements.keys() or any(
            found[n] is not e for n, e in bus.scope.elements.items()
        ):
            bus.scope = replace(bus.scope)
            vars(bus.scope)["elements"] = found
            vars(bus).pop("members", None)
            bus.prepare()
            changed = True
    return changed


def _alike(one: Any, name: str, above: tuple[int, ...]) -> Element:
    """The declaration of a member of the type of a component; above: sizes of the arrays of components that hold it."""
    clause, scope = one.clause
    sizes = tuple(tree.Number(clause.at, str(size)) for size in (*above, *one.shape))
    declared = tree.ComponentDeclaration(clause.at, None, None, name, sizes, None, None)
    words = tuple(word for word in clause.prefixes if word == "flow")
    made = replace(clause, prefixes=words, subscripts=(), components=(declared,), constraint=None)
    return Element(made, declared, scope, NOTHING, protected=True)


def _sized(element: Element, size: int) -> Element:
    """The same as an array of so many."""
    wanted = (tree.Number(element.declaration.at, str(size)),)
    if element.declaration.subscripts == wanted:
        return element
    return replace(element, declaration=replace(element.declaration, subscripts=wanted))
