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
    """The number n of `while i < n and ...` with the subscript i, at least 1, that rises by 1; None for another loop."""
    left, found = [item.condition], None
    every = [s for node in references([item.condition, item.items]) for _, s in node.parts]
    subscripts = [one.parts for one in references(every)]
    for test in left:
        if isinstance(test, tree.Binary) and test.operator == "and":
            left += [test.left, test.right]
        elif isinstance(test, tree.Binary) and test.operator in ("<", "<="):
            limit = reader.value(test.right)
            rises = any(
                isinstance(one, tree.Assignment)
                and one.targets == (test.left,)
                and isinstance(one.value, tree.Binary)
                and (one.value.operator, one.value.left) == ("+", test.left)
                and one.value.right == tree.Number(0, "1")
                for one in item.items
            )
            parts = cast(tree.ComponentReference, test.left).parts if rises else ()
            found = int(limit) if parts in subscripts and values.is_number(limit) else found
    return found


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
