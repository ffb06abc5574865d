"""Expressions that must be known before there are symbols: ranges, subscripts, sizes, arguments of some functions."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.references import nodes_of

SIZES: Mapping[str, int] = {"zeros": 0, "ones": 0, "fill": 1, "identity": 0, "linspace": 2}


Lookup = Callable[[Any, tree.Call], Any]  # the class of the function of a call in a class, or None


def shaping(item: Any, scope: Any, called: Lookup) -> Iterator[tree.Expression]:
    """The expressions in an equation or a value that must be known; called: the function of a call in a class."""
    for node in nodes_of(item):
        if isinstance(node, tree.RangeExpression):
            yield node
        elif isinstance(node, tree.ComponentReference):
            yield from (one for _, subscripts in node.parts for one in subscripts)
        elif isinstance(node, tree.Subscripted):
            yield from node.subscripts
        elif isinstance(node, tree.Call) and node.function.parts[-1][0] in SIZES:
            yield from node.arguments[SIZES[node.function.parts[-1][0]] :]
        elif isinstance(node, tree.Call) and (function := _function(scope, node, called)) is not None:
            inputs = {n: e for n, e in function.elements.items() if "input" in e.clause.prefixes}
            given = {**dict(zip(inputs, node.arguments, strict=False)), **dict(node.named)}
            every = _needs_numbers(function, called, set())
            whole = {n for n, e in inputs.items() if every or e.clause.type == "Integer"}
            yield from (e for n, e in given.items() if n in whole)


def _function(scope: Any, call: tree.Call, called: Lookup) -> Any:
    try:
        return called(scope, call)
    except ModelError:
        return None  # told where its value is asked for


def _needs_numbers(function: Any, called: Lookup, seen: set[int]) -> bool:
    """Whether it needs numbers: it is external, computes the length of a loop, or calls such a function."""
    if id(function) in seen:
        return False
    seen.add(id(function))
    body = function.definition.body
    if isinstance(body, tree.Composition) and body.external is not None:
        return body.external.language != "builtin"
    values = [(e.modifier.value, e.modifier.scope) for e in function.elements.values()]
    for item, scope in (*values, *((one.items, one.scope) for one in function.sections)):
        for node in nodes_of(item):
            if isinstance(node, tree.WhileLoop):
                return True
            inner = _function(scope, node, called) if isinstance(node, tree.Call) else None
            if inner is not None and _needs_numbers(inner, called, seen):
                return True
    return False
