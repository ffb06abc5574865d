"""`Connections.branch`, `root` and `potentialRoot` as statements of the language, and `if` on their spanning tree."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.language.statements import Branch, OfTheTree, Root
from gantrytau.modelica import tree
from gantrytau.modelica.printer import expression_written
from gantrytau.modelica.references import function_name, nodes_of

ASKED = frozenset({"Connections.rooted", "Connections.isRoot", "rooted"})


def is_operator(call: tree.Call) -> bool:
    """Whether a call is one of `Connections.*`, or of `rooted` as older texts write it."""
    return call.function.parts[0][0] == "Connections" or function_name(call) in ASKED


def answered(call: tree.Call, reader: Any) -> bool:
    """The value of `isRoot` or `rooted`; ModelError outside of the conditions of equations."""
    found = reader.local.get(expression_written(call))
    if found is None:
        words = "expected it as a condition of 'if' among equations"
        raise ModelError(f"found {function_name(call)}(), whose value the connections determine, {words}")
    return found


def asking(
    conditions: Any, items: Any, reader: Any, stated: Callable[[Any, Any], Iterator[Any]]
) -> OfTheTree | None:
    """The statement that waits for the spanning tree where conditions ask for it; None where they do not."""
    calls = (
        one for one in nodes_of(conditions) if isinstance(one, tree.Call) and function_name(one) in ASKED
    )
    call = next((one for one in calls if expression_written(one) not in reader.local), None)
    if call is None:
        return None
    only_root, written = function_name(call).endswith("isRoot"), expression_written(call)
    return OfTheTree(
        _connector(call.arguments[0], reader),
        only_root,
        lambda answer: stated(items, reader.with_local(**{written: answer})),
    )


def way(call: tree.Call, reader: Any) -> Branch | Root:
    """A root or branch of the spanning tree; other equations say what is passed on there."""
    name, arguments = function_name(call), call.arguments
    if name == "Connections.branch":
        a, b = (_connector(one, reader) for one in arguments)
        return Branch(a, b, {}, {})
    if name == "Connections.root":
        return Root(_connector(arguments[0], reader), {})
    if name == "Connections.potentialRoot":
        given: Sequence[Any] = (*arguments[1:], *(one for _, one in call.named))
        return Root(_connector(arguments[0], reader), {}, priority=reader.value(given[0]) if given else 0)
    raise ModelError(f"found {name}() among equations, expected Connections.branch, root or potentialRoot")


def _connector(record: tree.Expression, reader: Any) -> Any:
    """The connector of a record."""
    if not isinstance(record, tree.ComponentReference) or len(record.parts) < 2:
        raise ModelError("found what is no record of a connector, expected one, as frame_a.R")
    return reader.value(replace(record, parts=record.parts[:-1])).instance
