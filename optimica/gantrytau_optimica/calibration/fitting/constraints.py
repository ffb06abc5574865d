"""Equations and limits that identified parameters are to keep, as `calibrate(..., constraints=...)` says them.

"arms[0].length": 2.05                                     held at a value, vectors too
"arms[0].length": (2.0, 2.1)                               between limits
"arms[1].links[0].length": "arms[1].links[1].length"       equal, vectors too
"|arms[0].direction|": 1.0  or  (0.99, 1.01)               of the Euclidean length of a vector
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import instance
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record

AT_LIMIT = 1e-7  # m, 1 or squares of these: nearer to a limit than this it is active


@dataclass(frozen=True)
class ParameterConstraint(Record):
    """low <= sum of squares, or value less other value, of parameters <= high. places: their indices; others: of those that
    are taken from them, or none; squared: whether of squares.
    """

    places: tuple[int, ...]
    others: tuple[int, ...]
    low: np.ndarray
    high: np.ndarray
    squared: bool = False

    def expression(self, x: Any) -> ca.MX:
        """What is limited, of the parameters x."""
        here = ca.vertcat(*[x[k] for k in self.places])
        if self.squared:
            return ca.sumsqr(here)
        return here - ca.vertcat(*[x[k] for k in self.others]) if self.others else here


def read_constraints(given: Any, names: Sequence[str]) -> list[ParameterConstraint]:
    """The constraints on parameters of these names. ModelError for names that are not identified and no constraints."""
    instance("calibrate", "constraints", given, Mapping, "a dict as {'|arms[0].direction|': 1.0}, by names")
    return [_read(key, value, names) for key, value in given.items()]


def _read(key: str, value: Any, names: Sequence[str]) -> ParameterConstraint:
    squared = key.startswith("|") and key.endswith("|")
    places = _places(key.strip("|") if squared else key, names)
    if isinstance(value, str):
        others = _places(value, names)
        if squared or len(others) != len(places):
            raise _refused(f"'{key}': '{value}', expected two names of parameters or of vectors")
        return ParameterConstraint(places, others, np.zeros(len(places)), np.zeros(len(places)))
    try:
        low, high = value if isinstance(value, tuple) else (value, value)
        shape = () if squared else (len(places),)
        low, high = (np.array(np.broadcast_to(np.asarray(x, dtype=float), shape)) for x in (low, high))
    except (TypeError, ValueError):
        low = high = np.array(np.nan)
    if not np.all(low <= high) or (squared and not np.all(low >= 0)):
        raise _refused(
            f"'{key}': {value!r}, expected a value, limits (least, most), or the name of what it equals"
        )
    if squared:
        low, high = np.array([low**2]), np.array([high**2])
    return ParameterConstraint(places, (), low, high, squared)


def _places(name: str, names: Sequence[str]) -> tuple[int, ...]:
    found = tuple(k for k, n in enumerate(names) if n == name or n.rpartition("[")[0] == name)
    if not found:
        known = sorted({*names, *(n.rpartition("[")[0] for n in names if n.endswith("]"))})
        raise _refused(f"'{name}' is not identified{did_you_mean(name, known)}")
    return found


def _refused(message: str) -> ModelError:
    return ModelError(message, place="calibrate: constraints", argument="constraints")
