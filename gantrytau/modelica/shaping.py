"""Expressions that must be known before there are symbols: ranges, subscripts, sizes, arguments of some functions."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.references import called_function, nodes_of, references

SIZES: Mapping[str, int] = {"zeros": 0, "ones": 0, "fill": 1, "identity": 0, "linspace": 2}


def ask(
    structure: Any, item: tree.EquationOrStatement, scope: Any, local: frozenset[str] = frozenset()
) -> None:
    """Fold the parameters of an instance that must be known in an equation or statement of a class."""
    inside: list[tree.EquationOrStatement] = []
    if isinstance(item, tree.ForLoop):
        for name, over in item.iterators:
            _ask_names(structure, over, scope, local)
            local |= {name}
        inside += item.items
    elif isinstance(item, tree.Branching):
        for test, items in item.branches:
            if item.word == "if":
                _ask_names(structure, test, scope, local)
            inside += items
        inside += item.otherwise or ()
    else:
        ask_for_shapes(structure, item, scope, local)
    for one in inside:
        ask(structure, one, scope, local)


def ask_for_shapes(structure: Any, item: Any, scope: Any, local: frozenset[str] = frozenset()) -> None:
    """Fold the parameters in ranges, subscripts, sizes and arguments of an expression."""
    for one in shaping(
        item, scope, lambda around, call: called_function(call, structure.interpreter(around))[1]
    ):
        before = set(structure.read)
        try:
            _ask_names(structure, one, scope, local)
        except ModelError:  # a value that an initial equation gives, or a fault told where it is computed
            structure.read.intersection_update(before)


def is_known(structure: Any, reference: tree.ComponentReference) -> bool:
    """Whether a reference leads to a parameter or constant, or to a record of such."""
    if not structure.has(reference.parts[0][0]):
        return reference.parts[0][0] != "time"
    here = structure
    for name, _ in reference.parts:
        one = here.members.get(name) if here is not None else None
        if one is None or one.primitive is not None:
            return one is None or one.is_parameter
        here = one.children[0] if one.children else None
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
