"""Subexpressions that are written once and referred to by name.

An orientation at the end of a chain of joints is a small graph but, written out, a text that grows
exponentially with the chain. A subexpression is given a name if that saves enough nodes of text.
"""

from collections.abc import Collection, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.writing.graph import Graph, Node
from gantrytau.writing.syntax import Syntax, Written, ordered, write

SAVING = 7  # nodes; for readers, who see at once what a name stands for
SMALLEST = 6  # nodes; a sum of three is clearer than a name


@dataclass(frozen=True)
class Text:
    """Expressions written out.

    definitions: (name, expression) of what was named, each after those it needs; expressions: what was asked for.
    """

    definitions: tuple[tuple[str, str], ...]
    expressions: tuple[Written, ...]


def worth_a_name(roots: Iterable[Node], named: Collection[Node] = (), saving: int = SAVING) -> list[Node]:
    """The nodes below `roots` to be written apart, each after those it needs.

    named: nodes that have names already; saving: least number of nodes that a name has to save.
    """
    roots = list(roots)
    uses: dict[Node, int] = {}
    order = ordered(roots)
    for node in (*roots, *(a for n in order for a in n.arguments)):
        uses[node] = uses.get(node, 0) + 1
    size: dict[Node, int] = {}
    found: list[Node] = []
    for node in order:
        size[node] = 1 + sum(size[a] for a in node.arguments)
        saved = (uses[node] - 1) * size[node]
        if node in named:
            size[node] = 1
        elif not (node.leaf or node.boolean) and size[node] >= SMALLEST and saved >= saving:
            found.append(node)
            size[node] = 1
    return found


def written(
    roots: Iterable[Node],
    syntax: Syntax,
    named: Mapping[Node, Written] | None = None,
    saving: int = SAVING,
) -> Text:
    """`roots` in a language, with their shared subexpressions apart; `named` are written apart under these names.

    saving: least number of nodes that a name has to save. Raises ModelError for what the language cannot say.
    """
    roots = list(roots)
    names = dict(named or {})
    shared = worth_a_name(roots, names, saving)
    names |= {node: syntax.shared(number) for number, node in enumerate(shared, start=1)}
    found = write(roots, syntax, names)
    definitions = tuple((names[node].text, text.text) for node, text in found.items() if node in names)
    return Text(definitions, tuple(names.get(root) or found[root] for root in roots))


def written_at(place: str, expressions: Iterable[ca.SX], syntax: Syntax) -> Text:
    """Expressions in a language; a ModelError about them names the place where they stand."""
    with located(place):
        return written(Graph().read(expressions), syntax)


@contextmanager
def located(place: str):
    """Errors about expressions, which know no place, are told with it."""
    try:
        yield
    except ModelError as error:
        raise ModelError(f"{place}: {error}") from error
