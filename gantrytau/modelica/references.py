"""References in expressions."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from gantrytau.modelica import tree


def nodes_of(expression: Any) -> Iterator[tree.TreeNode]:
    """An expression and all that is in it; not the names of functions."""
    if isinstance(expression, tree.Call):
        yield expression
        yield from nodes_of((expression.arguments, expression.named))
    elif isinstance(expression, (tuple, list)):
        for one in expression:
            yield from nodes_of(one)
    elif isinstance(expression, tree.TreeNode):
        yield expression
        for name in type(expression).__slots__:
            yield from nodes_of(getattr(expression, name))


def dotted(e: Any) -> str:
    """The name of a reference without subscripts, with dots; "" for another expression."""
    named = isinstance(e, tree.ComponentReference) and not any(subscripts for _, subscripts in e.parts)
    return ".".join(name for name, _ in e.parts) if named else ""


def references(expression: Any) -> list[tree.ComponentReference]:
    """The references in an expression, but for names of functions."""
    return [one for one in nodes_of(expression) if isinstance(one, tree.ComponentReference)]


def connects_in(items: Iterable[Any]) -> tuple[Any, ...]:
    """The connections among equations, with the loops and conditions around them."""
    found = []
    for one in items:
        if isinstance(one, tree.ForLoop):
            found.append(replace(one, items=connects_in(one.items)))
        elif isinstance(one, tree.Branching) and one.word == "if":
            branches = tuple((test, connects_in(inner)) for test, inner in one.branches)
            kept = replace(one, branches=branches, otherwise=connects_in(one.otherwise or ()))
            found += [kept] if any(isinstance(n, tree.ConnectEquation) for n in nodes_of(kept)) else []
        elif isinstance(one, tree.ConnectEquation):
            found.append(one)
    return tuple(found)
