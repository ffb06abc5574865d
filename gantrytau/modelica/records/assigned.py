"""What assignments and branches of an algorithm make of a value: an element or a member changed, one of two chosen."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter, changed
from gantrytau.modelica.records.record_values import RecordValue
from gantrytau.modelica.references import references


def most_rounds(item: tree.WhileLoop, reader: Interpreter) -> int | None:
    """The most rounds of `while i < n and ...` or `while x > a[i + 1]`, i at least 1 and rising by 1; None for another loop.

    The first i is a subscript; behind the last element of the second a there is no number, which ends the loop.
    """
    steps = [i for i in item.items if isinstance(i, tree.Assignment) and isinstance(i.value, tree.Binary)]
    values_of = [(i.targets, cast(tree.Binary, i.value)) for i in steps]
    rising = [
        v.left for t, v in values_of if t == (v.left,) and (v.operator, v.right) == ("+", tree.Number(0, "1"))
    ]
    every = [s for node in references([item.condition, item.items]) for _, s in node.parts]
    left, found = [item.condition], []
    for test in left:
        if isinstance(test, tree.Binary) and test.operator == "and":
            left += [test.left, test.right]
        elif isinstance(test, tree.Binary) and test.operator in ("<", "<=") and test.left in rising:
            limit = reader.value(test.right)
            subscripts = [node.parts for node in references(every)]
            known = values.is_number(limit) and cast(tree.ComponentReference, test.left).parts in subscripts
            found += [int(limit)] if known else []
    for node in references(item.condition):
        name, places = node.parts[-1]
        for axis, place in enumerate(places):
            shifted = (
                isinstance(place, tree.Binary)
                and place.operator == "+"
                and isinstance(place.right, tree.Number)
            )
            if (cast(tree.Binary, place).left if shifted else place) in rising:
                whole = replace(node, parts=(*node.parts[:-1], (name, ())))
                found.append(values.all_sizes(reader.value(whole))[axis])
    return min(found, default=None)


def chosen_value(test: Any, then: Any, otherwise: Any) -> Any:
    """The value of a variable behind an `if` whose test varies; None where it has none in one of the branches."""
    if then is otherwise:
        return then
    if isinstance(then, list) and isinstance(otherwise, list):
        return [chosen_value(test, a, b) for a, b in zip(then, otherwise, strict=True)]
    if then is None or otherwise is None:
        return None  # not yet known in one branch: told where it is asked for
    if isinstance(then, np.ndarray) and np.shape(then) == np.shape(otherwise):
        return np.frompyfunc(partial(chosen_value, test), 2, 1)(then, otherwise)
    if isinstance(then, RecordValue):
        each = {n: chosen_value(test, one, otherwise[n]) for n, one in then.items()}
        return RecordValue(each, then.scope)
    return values.chosen(test, then, otherwise, smooth=False)


def value_before(value: Any) -> Any:
    """A value before an instant, that of a record member by member."""
    if isinstance(value, list):
        return list(map(value_before, value))
    if hasattr(value, "member"):
        return RecordValue({n: value_before(value.member(n)) for n in value.names()}, value.scope)
    return values.called("pre", [value], {})


def unassigned(value: Any) -> Any:
    """A value as it is before an assignment: None, also for each element of an array and each member of a record."""
    if isinstance(value, np.ndarray):
        return np.full(value.shape, None, dtype=object)
    if isinstance(value, list):
        return list(map(unassigned, value))
    if hasattr(value, "member"):
        return RecordValue({n: unassigned(value.member(n)) for n in value.names()}, value.scope)
    return None


def with_part(old: Any, parts: Sequence[Any], new: Any, reader: Interpreter) -> Any:
    """A value with another one where a reference points to."""
    subscripts, rest = parts[0][1], parts[1:]
    if len(parts) == 1 and not subscripts:
        return new
    if not subscripts:
        inner = parts[1][0]
        if not isinstance(old, RecordValue) or inner not in old:
            raise ModelError(f"found '{inner}' behind a dot, expected a member of a record")
        return RecordValue({**old, inner: with_part(old[inner], rest, new, reader)}, old.scope)
    if isinstance(old, list):
        return _with_component(old, parts, new, reader)
    if rest or not isinstance(old, np.ndarray):
        raise ModelError("found an element of no array of a known size assigned, expected an array")
    found = old.copy()
    axes = [*zip(subscripts, old.shape, strict=True)]
    readers = [replace(reader, end=size) for size in old.shape]
    varying = [r.value(s) if r.varies(s, n) else None for r, (s, n) in zip(readers, axes, strict=True)]
    every = zip(axes, varying, strict=True)
    places = [reader.places(*axis) if place is None else range(axis[1]) for axis, place in every]
    many = [[place] if isinstance(place, int) else place for place in places]
    shape = tuple(len(place) for place in places if isinstance(place, list))
    if np.shape(new if isinstance(new, np.ndarray) else 0) != shape:
        raise ModelError(f"found {values.size_words(new)} assigned to {list(shape)}, expected one size")
    for index in np.ndindex(*map(len, many)):
        at = tuple(axis[k] for axis, k in zip(many, index, strict=True))
        inner = tuple(k for k, place in zip(index, places, strict=True) if isinstance(place, list))
        one = new[inner] if shape else new
        for place, k in zip(varying, at, strict=True):
            one = one if place is None else chosen_value(changed(place, k + 1), old[at], one)
        found[at] = one
    first = tuple(axis[0] for axis in many)
    for place, size in zip(varying, old.shape, strict=True):
        if place is not None:  # beyond the array there is no number, which ends a run
            inside = values.binary("and", place > 0.5, place < size + 0.5)
            found[first] = chosen_value(inside, found[first], ca.sqrt(-1 - place**2))
    return found


def _with_component(old: list[Any], parts: Sequence[Any], new: Any, reader: Interpreter) -> list[Any]:
    """The same of a list of records."""
    (name, (first, *others)), found = parts[0], list(old)
    inner = ((name, tuple(others)), *parts[1:])
    places = replace(reader, end=len(old)).places(first, len(old))
    if isinstance(places, int):
        places, new = [places], [new]
    if not isinstance(new, (list, np.ndarray)) or len(new) != len(places):
        raise ModelError(f"found {values.size_words(new)} assigned to [{len(places)}], expected one size")
    for place, one in zip(places, new, strict=True):
        found[place] = with_part(old[place], inner, one, reader)
    return found
