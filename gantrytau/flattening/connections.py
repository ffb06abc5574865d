"""Connections become equations: potentials are equal, flows sum to zero (Modelica specification 3.6, 9.2)."""

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import Any

import casadi as ca

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.flattening.instantiation import Instance
from gantrytau.flattening.loop_closures import Closure
from gantrytau.language.declarations import Quantity
from gantrytau.language.model import Connector
from gantrytau.language.scalar_arithmetic import negative, plus
from gantrytau.language.statements import Connection, Equation, equality
from gantrytau.language.symbols import scalars

# a connector seen from outside its component has sign +1, from inside -1: what flows in there leaves here
Face = tuple[str, int]


def connection_equations(
    instance: Instance, connections: Iterable[tuple[str, Connection]], closures: Sequence[Closure] = ()
) -> list[Equation]:
    """Equations of all connections, and zero flow for the connectors that stay unconnected.

    connections: pairs of the path of the component that states it, and the statement; closures: those
    of them that close loops: what they carry enters the sums of the flows at their two ends.
    """
    members = {path: connector for path, connector, _ in instance.connectors}
    owners = {path: owner for path, _, owner in instance.connectors}
    parent: dict[Face, Face] = {(path, 1): (path, 1) for path in members}
    equations: list[Equation] = []

    def find(face: Face) -> Face:
        parent.setdefault(face, face)
        while parent[face] != face:
            parent[face] = parent[parent[face]]
            face = parent[face]
        return face

    closing = {id(closure.connection): closure for closure in closures}
    carried: list[tuple[Face, int, Closure]] = []
    for number, (where, connection) in enumerate(connections, start=1):
        if not isinstance(connection.a, Connector):
            equations += equality(connection.a == connection.b, where, "connection", number)
            continue
        for pair in _nested(connection):
            faces: list[Face] = []
            for end in (pair.a, pair.b):
                path = _path(instance, end, where)
                faces.append((path, -1 if owners[path] == where else 1))
            _check_same(pair, faces, where)
            if id(pair) in closing:
                carried += [(f, sign, closing[id(pair)]) for f, sign in zip(faces, (1, -1), strict=True)]
            else:
                parent[find(faces[0])] = find(faces[1])
    into: dict[Face, list[tuple[int, Closure]]] = {}
    for face, sign, closure in carried:
        into.setdefault(find(face), []).append((sign, closure))
    sets: dict[Face, list[Face]] = {}
    for face in list(parent):
        sets.setdefault(find(face), []).append(face)
    for key, faces in sets.items():
        equations += _set_equations([(members[path], path, sign) for path, sign in faces], into.get(key, []))
    return equations


def _nested(connection: Connection) -> Iterable[Connection]:
    """The connection and those of the connectors inside the two."""
    yield connection
    for name in type(connection.a).members():
        ends = [getattr(end, name, None) for end in (connection.a, connection.b)]
        inside = [end if isinstance(end, tuple) else (end,) for end in ends]
        for a, b in zip(*inside, strict=False):
            if isinstance(a, Connector) and isinstance(b, Connector):
                yield from _nested(Connection(a, b))


def _path(instance: Instance, end: Any, where: str) -> str:
    try:
        return instance.path(end)
    except KeyError:
        raise ModelError(
            f"{where or 'the model'}: connect() was given a {type(end).__name__} that is not part of this model, expected "
            "a connector reached through self"
        ) from None


def _check_same(connection: Connection, faces: list[Face], where: str) -> None:
    a, b = (set(type(end).members()) for end in (connection.a, connection.b))
    if a != b:
        kinds = [
            f"{path} ({type(end).__name__})"
            for (path, _), end in zip(faces, (connection.a, connection.b), strict=True)
        ]
        missing = sorted(a ^ b)[0]
        raise ModelError(
            f"{where or 'the model'}: connect({kinds[0]}, {kinds[1]}) joins different connectors: '{missing}' is in one of "
            f"them only; connect connectors of the same class{did_you_mean(missing, sorted(a & b))}"
        )

    for name, member in type(connection.a).members().items():
        flows = {getattr(m, "kind", "") == "flow" for m in (member, type(connection.b).members()[name])}
        sizes = [
            getattr(end, name).shape for end in (connection.a, connection.b) if isinstance(member, Quantity)
        ]
        if len(flows) > 1 or len(set(sizes)) > 1:
            what = "a flow in one of them only" if len(flows) > 1 else "of two sizes"
            raise ModelError(
                f"{where or 'the model'}: connect({faces[0][0]}, {faces[1][0]}) joins different connectors: '{name}' is "
                f"{what}; connect connectors of the same class"
            )


def _set_equations(
    members: list[tuple[Connector, str, int]], closures: list[tuple[int, Closure]]
) -> list[Equation]:
    first = members[0][0]
    where = " - ".join(path for _, path, _ in members)
    equations: list[Equation] = []
    quantities = ((n, m) for n, m in type(first).members().items() if isinstance(m, Quantity))
    for number, (name, declaration) in enumerate(quantities, start=1):
        columns = [scalars(getattr(connector, name)) for connector, _, _ in members]
        signs = [sign for _, _, sign in members]
        for row in range(len(columns[0])):
            element = row if len(columns[0]) > 1 else None
            if declaration.kind == "flow":
                terms = [(s, column[row]) for s, column in zip(signs, columns, strict=True)]
                terms += [(sign, closure.flow(name, row)) for sign, closure in closures]
                total = reduce(plus, (x if s > 0 else negative(x) for s, x in terms))
                equations.append(Equation(total, ca.SX(0), where, "connection", number, element))
            elif declaration.kind != "propagated":
                equations += [
                    Equation(columns[0][row], column[row], where, "connection", number, element)
                    for column in columns[1:]
                ]
    return equations
