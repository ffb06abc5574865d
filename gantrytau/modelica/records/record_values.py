"""Values of records: the members by name."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np


class RecordValue(dict[str, Any]):
    """The members of a record by name; scope: the class of the record."""

    def __init__(self, members: Mapping[str, Any], scope: Any = None):
        super().__init__(members)
        self.scope = scope


def record_value(value: Any) -> RecordValue:
    """A record, or a component that is one, as the values of its members."""
    if isinstance(value, RecordValue):
        return value
    scope = getattr(getattr(value, "structure", None), "scope", None)
    return RecordValue({n: value.member(n) for n in value.names()}, scope)


def is_plain(value: Any) -> bool:
    """Whether a value is a number, a text, an expression or an array of these."""
    return isinstance(value, (bool, int, float, str, ca.SX, np.ndarray, np.number))
