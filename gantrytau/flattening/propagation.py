"""Orientation and the like are passed on along a spanning tree of the connectors, not solved for.

Modelica breaks loops of orientation by overconstrained equation operators; here a propagated quantity is
an expression from the start. The tree takes the unbreakable branches inside components first, then the
connections, then branches that may be cut. A connection that is left over closes a loop.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, StructureError
from gantrytau.flattening.flat_checks import first_with
from gantrytau.flattening.flat_model import Loop
from gantrytau.flattening.instantiation import Instance, Placed
from gantrytau.language.model import Connector, Model
from gantrytau.language.scalar_arithmetic import leaf_names
from gantrytau.language.statements import Branch, Connection, Equation, Root
from gantrytau.language.symbols import scalars, split_derivative


@dataclass(frozen=True, eq=False)
class _Edge:
    a: str
    b: str
    branch: Branch | None  # None: a connection, all quantities are equal
    connection: tuple[str, Connection] | None = None


@dataclass(frozen=True, eq=False)
class Tree:
    """How propagated quantities reach every connector.

    reached: (connector, edge, root) in an order in which each comes after the one it is reached from;
    used: ids of the branches and roots whose coordinates exist; closing: connections that close loops.
    """

    nodes: Mapping[str, Any]
    reached: tuple[tuple[str, _Edge | None, Root | None], ...]
    used: frozenset[int]
    closing: tuple[tuple[tuple[str, Connection], Loop], ...]
    repeated: frozenset[int]  # ids of connections that say what others say

    def answer(self, path: str, only_root: bool) -> bool:
        """Whether a connector is a root, or, unless only_root, nearer to the root than the other end of its branch."""
        edges = {reached: edge for reached, edge, _ in self.reached}
        edge = edges.get(path)
        return path in edges and edge is None if only_root else edge is None or edge.branch is None


def spanning_tree(
    instance: Instance,
    connections: Iterable[tuple[str, Connection]],
    branches: Sequence[Branch],
    roots: Sequence[Root],
) -> Tree:
    """The spanning tree over all connectors with propagated quantities."""
    nodes = {path: c for path, c, _ in instance.connectors if propagated(c)}
    firm = [_Edge(instance.path(b.a), instance.path(b.b), b) for b in branches if b.coordinates is None]
    loose = [_Edge(instance.path(b.a), instance.path(b.b), b) for b in branches if b.coordinates is not None]
    joins = [
        _Edge(instance.path(c.a), instance.path(c.b), None, (where, c))
        for where, c in connections
        if isinstance(c.a, Connector)
        and propagated(c.a)
        and id(c.a) in instance.paths
        and id(c.b) in instance.paths
    ]
    group, together = _Groups(), _Groups()
    at = {instance.path(r.connector): r for r in roots if not r.optional}
    for path in list(at)[1:]:  # several roots hang on one virtual root
        group.join(path, next(iter(at)))
    tree: list[_Edge] = []
    closing: list[_Edge] = []
    repeated: set[int] = set()
    for edge in (*firm, *joins, *loose):
        if edge.connection is not None and not together.join(edge.a, edge.b):
            repeated.add(id(edge.connection[1]))
        elif group.join(edge.a, edge.b):
            tree.append(edge)
        elif edge.connection is not None or edge in firm:
            closing.append(edge)
    for candidate in sorted(roots, key=lambda one: one.priority or 0):
        path = instance.path(candidate.connector)
        if candidate.optional and not (at and group.find(path) == group.find(next(iter(at)))):
            at[path] = candidate
            group.join(path, next(iter(at)))
    reached = tuple(_from_the_roots(tree, at))
    used = {id(e.branch) for e in tree if e.branch} | {id(r) for r in at.values()}
    way = {path: edge for path, edge, _ in reached}
    loops = []
    for edge in closing:
        if edge.connection is None:
            raise ModelError(
                f"{edge.a} and {edge.b}: rigid ways inside of components close a loop, expected a connection in "
                "each loop; let one of the components connect its parts"
            )
        loops.append((edge.connection, Loop(edge.a, edge.b, _round(instance, edge, way))))
    return Tree(nodes, reached, frozenset(used), tuple(loops), frozenset(repeated))


class _Groups:
    """Sets of names that grow together."""

    def __init__(self) -> None:
        self.parent: dict[str, str] = {}

    def find(self, name: str) -> str:
        while (above := self.parent.setdefault(name, name)) != name:
            self.parent[name] = self.parent.get(above, above)
            name = above
        return name

    def join(self, a: str, b: str) -> bool:
        """Whether the two were apart before."""
        a, b = self.find(a), self.find(b)
        self.parent[a] = b
        return a != b


def propagated(connector: Connector) -> dict[str, Any]:
    """The propagated quantities that a connector declares, also in records, by name."""
    found: dict[str, Any] = {}
    for name, member in type(connector).members().items():
        inner = type(member).members() if isinstance(member, Model) else {}
        found |= {name: member} | {f"{name}.{n}": m for n, m in inner.items()}
    return {n: m for n, m in found.items() if getattr(m, "kind", "") == "propagated"}


def symbol_of(connector: Any, name: str) -> Any:
    """The symbol of a quantity of a connector, or of a record in it."""
    return reduce(getattr, name.split("."), connector)


# scalar name -> an equation, and the side of it that says what the scalar is
Definitions = Mapping[str, tuple[Equation, ca.SX]]


class _Defining:
    """Chooses among equations with a lone symbol on one side those that define it.

    unreached: scalars of connectors to which the tree has not come yet; found: the definitions, each behind those it needs.
    """

    def __init__(self, instance: Instance, equations: Sequence[Equation], unreached: set[str]):
        self.found: dict[str, tuple[Equation, ca.SX]] = {}
        self.unreached, self._used, self._busy = unreached, set[int](), set[str]()
        self.inlined = dict.fromkeys(n for p in inlined(instance.quantities) for n in p.elements)
        self._lone: dict[str, list[tuple[Equation, ca.SX]]] = {}
        for one in equations:
            for side, other in ((one.left, one.right), (one.right, one.left)):
                symbol = instance.symbols.find(side)
                if (
                    symbol is not None
                    and not symbol.order
                    and (symbol.kind == "propagated" or symbol.name in self.inlined)
                ):
                    self._lone.setdefault(symbol.name, []).append((one, other))

    def define(self, name: str, needed: bool = False) -> bool:
        """Whether a scalar has a definition from known quantities; needed: the definition may hold variables, too."""
        self._busy.add(name)
        for one, side in self._lone.get(name, ()) if name not in self.found else ():
            leaves = dict.fromkeys(split_derivative(leaf)[0] for leaf in leaf_names([side]))
            if id(one) in self._used or name in leaves or not self.unreached.isdisjoint(leaves):
                continue
            inside = [n for n in leaves if n in self.inlined]
            open_ones = [n for n in inside if n in self._busy or not self.define(n)]
            if needed or not open_ones:
                for n in open_ones:
                    del self.inlined[n]
                self._used.add(id(one))
                self.found[name] = one, side
                break
        self._busy.discard(name)
        return name in self.found


def inlined(quantities: Iterable[Placed]) -> Iterator[Placed]:
    """The quantities that an equation may define."""
    for one in quantities:
        fixed = one.attributes.get("fixed")
        if (
            getattr(one.declaration, "inlined", False)
            and not (fixed and np.any(fixed.value))
            and "value" not in one.attributes
        ):
            yield one


def defining(instance: Instance, tree: Tree, equations: Sequence[Equation]) -> Definitions:
    """What equations say of quantities that are passed on by branches and roots without values, and of inlined variables.

    On the side that defines a quantity of a connector stand quantities only of connectors that are nearer to the root.
    """
    names = {
        p: [(n, s.name()) for n in propagated(c) for s in scalars(symbol_of(c, n))]
        for p, c in tree.nodes.items()
    }
    those = _Defining(instance, equations, {name for each in names.values() for _, name in each})
    for path, edge, root in tree.reached:
        given = _given(path, tree.nodes[path], edge, root, tree)
        for whole, name in names[path]:
            if whole not in given:
                those.define(name, needed=True)
            those.unreached.discard(name)
    for name in [*those.inlined]:
        if name in those.inlined:
            those.define(name)
    elements = [p.elements for p in inlined(instance.quantities)]
    partly = {n for each in elements if not those.found.keys() >= {*each} for n in each}
    return {name: one for name, one in those.found.items() if name not in partly}


def _from_the_roots(
    tree: Iterable[_Edge], roots: Mapping[str, Root]
) -> Iterator[tuple[str, _Edge | None, Root | None]]:
    neighbours: dict[str, list[tuple[str, _Edge]]] = {}
    for edge in tree:
        neighbours.setdefault(edge.a, []).append((edge.b, edge))
        neighbours.setdefault(edge.b, []).append((edge.a, edge))
    queue: list[tuple[str, _Edge | None, Root | None]] = [(path, None, r) for path, r in roots.items()]
    seen = set(roots)
    for path, edge, here in queue:
        yield path, edge, here
        for other, way in neighbours.get(path, ()):
            if other not in seen:
                seen.add(other)
                queue.append((other, way, None))


def _round(instance: Instance, closing: _Edge, way: Mapping[str, _Edge | None]) -> tuple[str, ...]:
    """Components on the way from one end of a closing connection through the tree to the other."""
    owners = {path: owner for path, _, owner in instance.connectors}

    def up(path: str) -> list[str]:
        found = [path]
        while (edge := way.get(found[-1])) is not None:
            found.append(edge.a if edge.b == found[-1] else edge.b)
        return found

    one, two = up(closing.a), up(closing.b)
    while len(one) > 1 and len(two) > 1 and one[-2:] == two[-2:]:
        one.pop()
        two.pop()
    paths = [*one, *reversed(two[:-1] if one[-1] == two[-1] else two)]
    return tuple(dict.fromkeys(owners[path] for path in paths if owners[path]))


def propagate(
    instance: Instance, tree: Tree, stated: Definitions
) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
    """What propagated scalars are: those equal to a number or another symbol, and the expressions of the others.

    Both by name, in an order in which each comes after those it needs. Quantities that no root reaches
    are in neither.
    """
    plain: dict[str, ca.SX] = {}
    defined: dict[str, ca.SX] = {}
    nodes = {s.name() for c in tree.nodes.values() for n in propagated(c) for s in scalars(symbol_of(c, n))}
    others = iter([*((name, side) for name, (_, side) in stated.items()), ("", ca.SX(0))])

    def add(name: str, element: ca.SX) -> None:
        (plain if element.is_constant() or element.is_symbolic() else defined)[name] = element

    def add_others(until: str) -> None:
        for name, side in others:
            if name == until:
                return
            if name not in nodes:
                add(name, _without(plain, [side])[0])

    for path, edge, root in tree.reached:
        connector = tree.nodes[path]
        given = _given(path, connector, edge, root, tree)
        for name, declaration in propagated(connector).items():
            symbols = scalars(symbol_of(connector, name))
            own = [stated[s.name()][1] for s in symbols if s.name() in stated]
            value = given.get(name, declaration.start)
            if value is None and len(own) < len(symbols):
                where = "at this root" if edge is None else f"from {edge.a if path == edge.b else edge.b}"
                raise ModelError(
                    f"{path}: found no equation that says what {name} is {where}, expected one with {name} alone on a "
                    "side, and on the other side what is nearer to the root"
                )
            elements = own if len(own) == len(symbols) else scalars(value)
            if len(elements) != len(symbols):
                raise ModelError(
                    f"{path}: {name} is given with shape {ca.SX(value).shape}, expected {symbol_of(connector, name).shape}"
                )
            if elements is own:
                for symbol in symbols:
                    add_others(until=symbol.name())
            for symbol, element in zip(symbols, _without(plain, elements), strict=True):
                add(symbol.name(), element)
    add_others(until="")
    return plain, defined


def _without(plain: Mapping[str, ca.SX], elements: list[ca.SX]) -> list[ca.SX]:
    """Scalars with those of these names replaced."""
    if all(element.is_symbolic() or element.is_constant() for element in elements):
        return [plain.get(e.name(), e) if e.is_symbolic() else e for e in elements]
    value = ca.vertcat(*elements)
    leaves = [leaf for leaf in ca.symvar(value) if leaf.name() in plain]
    known = ca.vertcat(*(plain[leaf.name()] for leaf in leaves))
    return ca.substitute(value, ca.vertcat(*leaves), known).elements() if leaves else elements


def _given(path: str, connector: Any, edge: _Edge | None, root: Root | None, tree: Tree):
    """The propagated quantities of a connector in terms of the one it is reached from."""
    if root is not None or edge is None:
        return {} if root is None else root.values
    if edge.branch is None:
        source = tree.nodes[edge.a if path == edge.b else edge.b]
        return {name: symbol_of(source, name) for name in propagated(source)}
    given = edge.branch.forward if path == edge.b else edge.branch.backward
    missing = [name for name in propagated(connector) if name not in given and "." not in name]
    if missing:
        raise ModelError(
            f"branch({edge.a}, {edge.b}) says nothing of {missing[0]}, expected {', '.join(propagated(connector))} "
            "in forward and in backward"
        )
    return given


def _holder(connector: Any, name: str) -> Any:
    """The connector, or the record in it, that declares a quantity."""
    return reduce(getattr, name.split(".")[:-1], connector)


class Spread:
    """Propagated quantities of an instantiated model, and equations with the plain ones replaced.

    definitions: expressions by scalar name; rates: declared time derivatives of those that are not plain.
    """

    def __init__(self, instance: Instance, tree: Tree, stated: Definitions):
        self._symbols = instance.symbols
        self._plain, defined = propagate(instance, tree, stated)
        self._nodes = tree.nodes
        self.rates: dict[str, ca.SX] = {}
        for connector in tree.nodes.values():
            for name, declaration in propagated(connector).items():
                names = [s.name() for s in scalars(symbol_of(connector, name))]
                if declaration.rate is not None and any(n in defined for n in names):
                    rate = self._inserted(ca.densify(declaration.rate(_holder(connector, name)))).elements()
                    self.rates.update((n, r) for n, r in zip(names, rate, strict=True) if n in defined)
        self.definitions = {**self._plain, **defined}

    def _inserted(self, expression: ca.SX) -> ca.SX:
        """The expression with plain quantities and their derivatives replaced."""
        old, new = [], []
        for leaf in ca.symvar(expression):
            base, order = split_derivative(leaf.name())
            if base in self._plain:
                value = self._plain[base]
                for _ in range(order):
                    value = self._symbols.total_derivative(value)
                old.append(leaf)
                new.append(value)
        return ca.substitute(expression, ca.vertcat(*old), ca.vertcat(*new)) if old else expression

    def substituted(self, equations: Iterable[Equation]) -> tuple[Equation, ...]:
        """The equations with plain quantities replaced."""
        equations = tuple(equations)
        if not equations:
            return ()
        rated = [e.rate for e in equations if e.rate is not None]
        sides = [side for e in equations for side in (e.left, e.right)]
        found = self._inserted(ca.vertcat(*sides, *rated)).elements()
        rates = iter(found[len(sides) :])
        return tuple(
            replace(
                e, left=found[2 * i], right=found[2 * i + 1], rate=None if e.rate is None else next(rates)
            )
            for i, e in enumerate(equations)
        )

    def refuse_undefined(self, equations: Sequence[Equation], names: Iterable[str]) -> None:
        """StructureError for an orientation that something depends on and nothing determines; names: of all symbols."""
        everything = {
            s.name(): path
            for path, c in self._nodes.items()
            for n in propagated(c)
            for s in scalars(symbol_of(c, n))
        }
        undefined = everything.keys() - self.definitions.keys()
        if undefined and (
            found := first_with(equations, names, lambda n: split_derivative(n)[0] in undefined)
        ):
            raise StructureError(
                f"{everything[split_derivative(found[1])[0]]}: nothing determines the orientation of this frame, on which "
                f"{found[0].name} depends: its rotation is free. Connect it to the world through joints, or "
                "to a Body, which brings inertia and an orientation of its own"
            )
