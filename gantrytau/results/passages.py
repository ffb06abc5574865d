"""Limits of variables, `min` and `max`, that a result passes: which, when and how far."""

from dataclasses import dataclass

import numpy as np

from gantrytau.results.series import Series

PASSED = 1e-6  # of a limit, or of the largest value where it is 0: less is the give of an end stop
HALVINGS = 40  # of the time between two rows


@dataclass(frozen=True)
class PassedLimit:
    """A limit, "min" or "max", that a variable passes; time: first passing, s; worst: the value farthest beyond it."""

    name: str
    side: str
    limit: float
    time: float
    worst: float

    @property
    def beyond(self) -> float:
        """By how much the limit is passed."""
        return abs(self.worst - self.limit)


def passages(result: Series) -> list[PassedLimit]:
    """The limits that the variables of a result pass, by time."""
    found = []
    for name, ends in result.limits.items():
        if name not in result.names:
            continue
        values = result[name]
        for side, limit in zip(("min", "max"), ends, strict=True):
            beyond = limit - values if side == "min" else values - limit
            size = max(abs(limit), float(np.max(np.abs(values), initial=0.0)))
            rows = np.flatnonzero(beyond > PASSED * size) if np.isfinite(limit) else beyond[:0]
            if rows.size:
                when = _when(result, name, limit, int(rows[0]))
                found.append(PassedLimit(name, side, limit, when, float(values[np.argmax(beyond)])))
    return sorted(found, key=lambda one: (one.time, one.name))


def _when(result: Series, name: str, limit: float, row: int) -> float:
    """When a limit is passed before a row of a result, s."""
    t = result.time
    if row == 0 or t[row - 1] == t[row]:
        return float(t[row])
    low, high = float(t[row - 1]), float(t[row])
    sign = np.sign(result[name][row] - limit)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if sign * (result.at(middle, name) - limit) > 0 else (middle, high)
    return high
