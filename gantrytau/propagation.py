"""Orientation and the like are passed on along a spanning tree of the connectors, not solved for.

Modelica breaks loops of orientation by overconstrained equation operators; here a propagated quantity is
an expression from the start. The tree takes the branches inside components first, then connections.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gantrytau.errors import StructureError
from gantrytau.instantiation import Instance
from gantrytau.model import Connector
from gantrytau.statements import Branch, Connection, Root
from gantrytau.symbols import scalars


@dataclass(frozen=True, eq=False)
class _Edge:
    a: str
    b: str
    forward: Mapping[str, Any] | None  # None: a connection, all quantities are equal
    backward: Mapping[str, Any] | None


def propagate(
    instance: Instance,
    connections: Iterable[tuple[str, Connection]],
    branches: Iterable[Branch],
    roots: Iterable[Root],
) -> dict[str, ca.SX]:
    """Expressions of all propagated scalars by name, free of propagated symbols.

    Raises StructureError when a loop of branches and connections closes on different values.
    """
    nodes = {path: c for path, c, _ in instance.connectors if _propagated(c)}
    if not nodes:
        return {}
    edges = [_Edge(instance.path(b.a), instance.path(b.b), b.forward, b.backward) for b in branches]
    for _, connection in connections:
        if isinstance(connection.a, Connector) and _propagated(connection.a):
            edges.append(_Edge(instance.path(connection.a), instance.path(connection.b), None, None))
    tree, closing = _spanning_tree(nodes, edges, [instance.path(r.connector) for r in roots])
    values: dict[str, ca.SX] = {}

    def settle(path: str, given: Mapping[str, Any]) -> None:
        for name, declaration in _propagated(nodes[path]).items():
            symbol = getattr(nodes[path], name)
            value = ca.SX(given[name]) if name in given else ca.SX(declaration.start)
            leaves = [leaf for leaf in ca.symvar(value) if leaf.name() in values]
            here = value
            if leaves:
                known = ca.vertcat(*(values[leaf.name()] for leaf in leaves))
                here = ca.substitute(value, ca.vertcat(*leaves), known)
            for element, expression in zip(scalars(symbol), scalars(here), strict=True):
                found = instance.symbols.find(element)
                assert found is not None
                values[found.name] = expression

    given_roots = {instance.path(r.connector): r.values for r in roots}
    for path, edge in _from_the_roots(nodes, tree, given_roots):
        if edge is None:
            settle(path, given_roots.get(path, {}))
        elif edge.forward is None or edge.backward is None:
            source = nodes[edge.a if path == edge.b else edge.b]
            settle(path, {name: getattr(source, name) for name in _propagated(source)})
        else:
            settle(path, edge.forward if path == edge.b else edge.backward)
    for edge in closing:
        _check_closes(instance, nodes, edge, values)
    return values


def _propagated(connector: Connector) -> dict[str, Any]:
    return {n: m for n, m in type(connector).members().items() if getattr(m, "kind", "") == "propagated"}


def _spanning_tree(
    nodes: Iterable[str], edges: list[_Edge], roots: list[str]
) -> tuple[list[_Edge], list[_Edge]]:
    group = {path: path for path in nodes}

    def find(path: str) -> str:
        while group[path] != path:
            group[path] = group[group[path]]
            path = group[path]
        return path

    for path in roots[1:]:  # several roots hang on one virtual root
        group[find(path)] = find(roots[0])
    tree, closing = [], []
    for edge in edges:
        a, b = find(edge.a), find(edge.b)
        (closing if a == b else tree).append(edge)
        group[a] = b
    return tree, closing


def _from_the_roots(nodes: Iterable[str], tree: list[_Edge], roots: Mapping[str, Any]):
    """Pairs (connector, edge by which it is reached), each after the one it is reached from."""
    neighbours: dict[str, list[tuple[str, _Edge]]] = {path: [] for path in nodes}
    for edge in tree:
        neighbours[edge.a].append((edge.b, edge))
        neighbours[edge.b].append((edge.a, edge))
    seen: set[str] = set()
    for start in (*roots, *nodes):
        if start in seen:
            continue
        queue: list[tuple[str, _Edge | None]] = [(start, None)]
        seen.add(start)
        for path, edge in queue:
            yield path, edge
            for other, way in neighbours[path]:
                if other not in seen and other not in roots:
                    seen.add(other)
                    queue.append((other, way))


def _check_closes(
    instance: Instance, nodes: Mapping[str, Any], edge: _Edge, values: Mapping[str, ca.SX]
) -> None:
    for name in _propagated(nodes[edge.a]):
        pairs = zip(scalars(getattr(nodes[edge.a], name)), scalars(getattr(nodes[edge.b], name)), strict=True)
        for a, b in pairs:
            left, right = (instance.symbols.find(x) for x in (a, b))
            assert left is not None
            assert right is not None
            if not ca.is_equal(values[left.name], values[right.name], 20):
                raise StructureError(
                    f"connect({edge.a}, {edge.b}) closes a loop of rigid parts and joints: "
                    f"{left.name} is already "
                    f"{values[left.name]} on one side and {values[right.name]} on the other; "
                    "release one rotation of the loop with a joint that carries no torque"
                )
