"""Values of records: the members by name; and functions of each number in a record or an array."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import casadi as ca
import numpy as np


class RecordValue(dict[str, Any]):
    """The members of a record by name, which are asked for as those of a component; scope: the class of the record."""

    def __init__(self, members: Mapping[str, Any], scope: Any = None):
        super().__init__(members)
        self.scope = scope

    def names(self) -> list[str]:
        return [*self]

    def has(self, name: str) -> bool:
        return name in self

    def member(self, name: str) -> Any:
        return self[name]


def is_plain(value: Any) -> bool:
    """Whether a value is a number, a text, an expression or an array of these."""
    if isinstance(value, np.ndarray):
        return not value.size or is_plain(value.flat[0])
    return isinstance(value, (bool, int, float, str, ca.SX, np.number))


def boxed(value: Any) -> Any:
    """A value as an array of NumPy, a scalar without dimensions; NumPy itself would take a symbol apart."""
    if isinstance(value, np.ndarray):
        return value
    found = np.empty((), dtype=object)
    found[()] = value
    return found


def mapped(function: Callable[..., Any], *given: Any) -> Any:
    """A function of scalars, of each element of arrays and each member of records, which are alike."""
    if any(isinstance(one, np.ndarray) for one in given):
        return np.frompyfunc(partial(mapped, function), len(given), 1)(*map(boxed, given))
    if all(hasattr(one, "member") for one in given):
        names, scope = given[0].names(), given[0].scope
        return RecordValue({n: mapped(function, *(one.member(n) for one in given)) for n in names}, scope)
    return function(*given)


def scalars(value: Any) -> Iterator[Any]:
    """The numbers in an array or a record, or the value itself."""
    if isinstance(value, np.ndarray):
        for one in value.flat:
            yield from scalars(one)
    elif isinstance(value, RecordValue):
        for one in value.values():
            yield from scalars(one)
    else:
        yield value
