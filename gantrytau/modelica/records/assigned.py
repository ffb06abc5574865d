"""What assignments and branches of an algorithm make of a value: an element or a member changed, one of two chosen."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter
from gantrytau.modelica.records.record_values import RecordValue


def chosen_value(test: Any, then: Any, otherwise: Any, name: str) -> Any:
    """The value of a variable behind an `if` whose test varies; None where it has none in one of the branches."""
    if then is otherwise:
        return then
    if then is None or otherwise is None:
        return None  # not yet known in one branch: told where it is asked for
    if isinstance(then, np.ndarray) and np.shape(then) == np.shape(otherwise):
        return np.frompyfunc(partial(chosen_value, test, name=name), 2, 1)(then, otherwise)
    if isinstance(then, RecordValue):
        each = {n: chosen_value(test, one, otherwise[n], n) for n, one in then.items()}
        return RecordValue(each, then.scope)
    return values.chosen(test, then, otherwise, smooth=False)


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
    if rest or not isinstance(old, np.ndarray):
        raise ModelError("found an element of no array of a known size assigned, expected an array")
    found = old.copy()
    places = tuple(reader.places(one, size) for one, size in zip(subscripts, old.shape, strict=True))
    many = [place if isinstance(place, list) else [place] for place in places]
    shape = tuple(len(place) for place in places if isinstance(place, list))
    if np.shape(new if isinstance(new, np.ndarray) else 0) != shape:
        raise ModelError(f"found {values.size_words(new)} assigned to {list(shape)}, expected one size")
    flat = iter(new.flat) if isinstance(new, np.ndarray) else iter([new])
    for index in np.ndindex(*map(len, many)):
        found[tuple(axis[k] for axis, k in zip(many, index, strict=True))] = next(flat)
    return found
