"""What assignments of an algorithm make of a value: an element or a member changed; and the length of its loops."""

from collections.abc import Sequence
from dataclasses import replace
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
    if not isinstance(old, np.ndarray):
        raise ModelError("found an element of no array of a known size assigned, expected an array")
    found = old.copy()
    axes = [*zip(subscripts, old.shape, strict=True)]
    readers = [replace(reader, end=size) for size in old.shape]
    varying = [r.value(s) if r.varies(s, n) else None for r, (s, n) in zip(readers, axes, strict=True)]
    every = zip(axes, varying, strict=True)
    places = [reader.places(*axis) if place is None else range(axis[1]) for axis, place in every]
    many = [[place] if isinstance(place, int) else place for place in places]
    shape = tuple(len(place) for place in places if isinstance(place, list))
    if values.all_sizes(new)[: len(shape) if rest else None] != shape:
        raise ModelError(f"found {values.size_words(new)} assigned to {list(shape)}, expected one size")
    for index in np.ndindex(*map(len, many)):
        at = tuple(axis[k] for axis, k in zip(many, index, strict=True))
        inner = tuple(k for k, place in zip(index, places, strict=True) if isinstance(place, list))
        one = with_part(old[at], ((parts[0][0], ()), *rest), new[inner] if shape else new, reader)
        for place, k in zip(varying, at, strict=True):
            one = one if place is None else values.chosen(changed(place, k + 1), old[at], one, False)
        found[at] = one
    first = tuple(axis[0] for axis in many)
    for place, size in zip(varying, old.shape, strict=True):
        if place is not None:  # beyond the array there is no number, which ends a run
            inside = values.binary("and", place > 0.5, place < size + 0.5)
            found[first] = values.chosen(inside, found[first], ca.sqrt(-1 - place**2), False)
    return found
