"""What is set at instants, as words around expressions, for every format of equations."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import casadi as ca

from gantrytau.flattening.flat_model import Delay, FlatModel, Sampled, SampledLaw, StickSlip, When
from gantrytau.writing.graph import Graph, Node
from gantrytau.writing.sections import symbol_names
from gantrytau.writing.subexpressions import located, written
from gantrytau.writing.syntax import Syntax


@dataclass(frozen=True)
class Mention:
    """A variable among words, by its name."""

    name: str


@dataclass(frozen=True, eq=False)
class Truth:
    """A condition among words."""

    expression: ca.SX


Piece = str | Mention | Truth | ca.SX


@dataclass(frozen=True, eq=False)
class AtInstants:
    """One statement on instants: what it says, a note on when and where, and the names that it sets."""

    place: str
    says: tuple[Piece, ...]
    note: tuple[Piece, ...]
    sets: tuple[str, ...]
    label: str = field(default="")

    @property
    def expressions(self) -> tuple[ca.SX, ...]:
        """What is computed in it."""
        found = (p.expression if isinstance(p, Truth) else p for p in (*self.says, *self.note))
        return tuple(e for e in found if isinstance(e, ca.SX))

    @property
    def names(self) -> tuple[str, ...]:
        """All names in it: those that it sets, and those that it reads; `x` for `pre(x)`."""
        said = [p.name for p in (*self.says, *self.note) if isinstance(p, Mention)]
        return tuple(map(without_pre, dict.fromkeys((*said, *symbol_names(self.expressions)))))


def without_pre(name: str) -> str:
    """`x` for `pre(x)`, its value just before an instant."""
    return name[4:-1] if name.startswith("pre(") else name


def at_instants(flat: FlatModel) -> tuple[AtInstants, ...]:
    """All statements on instants of a model: sampled, friction that sticks, whens, delays."""
    return (
        *map(_sampled, flat.sampled),
        *map(_law, flat.laws),
        *map(_friction, flat.frictions),
        *map(_when, flat.whens),
        *map(_delayed, flat.delays),
    )


def line_written(
    one: AtInstants, syntax: Syntax, plain: Callable[[str], str] = str, formula: str = "{}"
) -> tuple[tuple[tuple[str, str], ...], str, str]:
    """Common subexpressions of a statement as (name, expression), the statement, and its note.

    plain: writes pieces of text; formula: what stands around the others.
    """
    graph, parts = Graph(), (one.says, one.note)
    with located(one.label):
        nodes = {id(p): _node(graph, p) for part in parts for p in part if isinstance(p, ca.SX | Truth)}
        text = written(nodes.values(), syntax)
    found = dict(zip(nodes, text.expressions, strict=True))

    def said(piece: Piece) -> str:
        if isinstance(piece, str):
            return plain(piece)
        return formula.format(
            (syntax.symbol(piece.name) if isinstance(piece, Mention) else found[id(piece)]).text
        )

    says, note = ("".join(map(said, part)) for part in parts)
    return text.definitions, says, note


def _node(graph: Graph, piece: ca.SX | Truth) -> Node:
    if isinstance(piece, ca.SX):
        return graph.read([piece])[0]
    (node,) = graph.read([piece.expression])
    truth = node.operation == "select" and [a.value for a in node.arguments[1:]] == [1.0, 0.0]
    return node.arguments[0] if truth else node


def _sampled(one: Sampled) -> AtInstants:
    place = one.path or "the model"
    says = ("sampled: ", Mention(one.name), " = ", one.expression)
    return AtInstants(place, says, ("every ", one.period, f" s, from {place}"), (one.name,), one.name)


def _law(one: SampledLaw) -> AtInstants:
    place = one.path or "the model"
    says = (
        "law: a function of Python sets ",
        *_mentioned(one.found),
        " instead, from ",
        *_mentioned(one.given),
    )
    return AtInstants(place, says, (f"from {place}",), one.found, one.label)


def _mentioned(names: Iterable[str]) -> list[Piece]:
    return [piece for name in names for piece in (", ", Mention(name))][1:]


def _friction(one: StickSlip) -> AtInstants:
    place = one.path or "the model"
    law = ca.sign(ca.SX.sym(one.speed)) * one.coulomb + one.smooth
    rest = ("; at rest as ", Mention(one.speed), " = 0 needs, up to ", one.breakaway)
    says = ("friction: ", Mention(one.force), " = ", law, *rest)
    return AtInstants(place, says, (f"from {place}",), (one.force,), one.force)


def _when(one: When) -> AtInstants:
    place = one.path or "the model"
    pairs = (*one.reinits, *one.assignments)
    done = _joined([(Mention(n), " := ", value) for n, value in pairs])
    if one.message:
        done += (", terminate: " if done else "terminate: ", one.message)
    word = "when " if one.after < 0 else "elsewhen "
    says = (word, Truth(one.condition), ": ", *done)
    return AtInstants(place, says, (f"from {place}",), tuple(n for n, _ in pairs), one.label)


def _delayed(one: Delay) -> AtInstants:
    says = ("delayed: ", Mention(one.name), " = ", one.expression, ", ", one.time, " s ago")
    return AtInstants("", says, (), (one.name,), one.name)


def _joined(groups: Iterable[tuple[Piece, ...]]) -> tuple[Piece, ...]:
    """Groups of pieces with commas between them."""
    found: tuple[Piece, ...] = ()
    for group in groups:
        found += (", ", *group) if found else group
    return found
