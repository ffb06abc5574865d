"""Expressions that must be known before there are symbols: ranges, subscripts, sizes, arguments of some functions."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.references import called_function, inner_items, nodes_of, references

SIZES: Mapping[str, int] = {"zeros": 0, "ones": 0, "fill": 1, "identity": 0, "linspace": 2}


def ask(
    structure: Any, item: tree.EquationOrStatement, scope: Any, local: frozenset[str] = frozenset()
) -> None:
    """Fold the parameters of an instance that must be known in an equation or statement of a class."""
    if isinstance(item, tree.ForLoop):
        for name, over in item.iterators:
            _ask_names(structure, over, scope, local)
            local |= {name}
    elif isinstance(item, tree.Branching) and item.word == "if":
        for test, _ in item.branches:
            _ask_names(structure, test, scope, local)
    elif not isinstance(item, tree.Branching):
        ask_for_shapes(structure, item, scope, local)
        return
    for one in inner_items(item):
        ask(structure, one, scope, local)


def ask_for_shapes(structure: Any, item: Any, scope: Any, local: frozenset[str] = frozenset()) -> None:
    """Fold the parameters in ranges, subscripts, sizes and arguments of an expression."""
    for one in shaping(item, scope, structure):
        before = set(structure.read)
        try:
            _ask_names(structure, one, scope, local)
        except ModelError:  # a value that an initial equation gives, or a fault told where it is computed
            structure.read.intersection_update(before)


def is_known(structure: Any, reference: tree.ComponentReference) -> bool:
    """Whether a reference leads to a parameter or constant, or to a record of such."""
    if not structure.has(reference.parts[0][0]):
        return reference.parts[0][0] != "time"
    one = structure.component(reference)
    if one is None or one.primitive is not None:
        return one is None or one.is_parameter
    here = one.sample
    return here is None or here.scope.definition.kind != "record" or _is_constant(here)


def _is_constant(structure: Any) -> bool:
    """Whether all in a record are parameters and constants."""
    each = structure.members.values()
    return all(m.is_parameter if m.primitive else all(map(_is_constant, m.children)) for m in each)


def _ask_names(structure: Any, expression: Any, scope: Any, local: frozenset[str]) -> None:
    """Fold the parameters in an expression, unless a variable stands in it, too."""
    found = [one for one in references(expression) if one.parts[0][0] not in local]
    if all(is_known(structure, one) for one in found):
        for one in (one for one in found if structure.has(one.parts[0][0])):
            whole = tuple((name, ()) for name, _ in one.parts)
            structure.interpreter(scope).value(tree.ComponentReference(one.at, whole))


def shaping(item: Any, scope: Any, structure: Any) -> Iterator[tree.Expression]:
    """The expressions that must be known in an equation or a value of a class."""
    for node in nodes_of(item):
        if isinstance(node, tree.RangeExpression):
            yield node
        elif isinstance(node, tree.ComponentReference):
            yield from (one for _, subscripts in node.parts for one in subscripts)
        elif isinstance(node, tree.Subscripted):
            yield from node.subscripts
        elif isinstance(node, tree.Call) and node.function.parts[-1][0] in SIZES:
            yield from node.arguments[SIZES[node.function.parts[-1][0]] :]
        elif isinstance(node, tree.Call) and (function := _function(node, scope, structure)):
            inputs = {n: e for n, e in function.elements.items() if "input" in e.clause.prefixes}
            given = {**dict(zip(inputs, node.arguments, strict=False)), **dict(node.named)}
            every = _needs_numbers(function, structure, set())
            whole = {n for n, e in inputs.items() if every or e.clause.type == "Integer"}
            yield from (e for n, e in given.items() if n in whole)


def _function(call: tree.Call, scope: Any, structure: Any) -> Any:
    """The class of the function that is called in a class; None for one of the language."""
    with suppress(ModelError):  # told where its value is asked for
        return called_function(call, structure.interpreter(scope))[1]


def _needs_numbers(function: Any, structure: Any, seen: set[int]) -> bool:
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
            inner = _function(node, scope, structure) if isinstance(node, tree.Call) else None
            if isinstance(node, tree.WhileLoop) or (inner and _needs_numbers(inner, structure, seen)):
                return True
    return False
