"""Columns of a CSV file, which are measured variables or inputs of a model, in its units."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from gantrytau import Columns, FlatModel, ModelError, Samples, did_you_mean
from gantrytau.border import Value, read_table


@dataclass(frozen=True, eq=False)
class Data:
    """The table of a file, and its times in s, None where there are none."""

    table: Columns
    times: np.ndarray | None

    @classmethod
    def read(cls, file: Path) -> Self:
        """The data in a file; ModelError where it cannot be read, naming the line."""
        table = Columns.read(file, "a row for each time")
        return cls(table, table.time)

    @property
    def names(self) -> list[str]:
        """Names of the columns beside time."""
        return [name for name in self.table.names if name != self.table.time_name]

    def part(self, begin: Any, stop: Any) -> "Data":
        """The rows from begin to stop, both in s, None where there is no limit."""
        if self.times is None:
            return self
        kept = np.ones(self.times.size, dtype=bool)
        for limit, sign in ((begin, 1.0), (stop, -1.0)):
            if isinstance(limit, (int, float)):
                kept &= sign * (self.times - limit) >= 0
        return Data(self.table.select(kept), self.times[kept])

    def measured(self, flat: FlatModel, place: str, asked: Any, deviation: Any) -> dict[str, Any]:
        """Samples of variables, or values alone without times; ModelError for names that are not there.

        asked: names, or {variable: column}; None takes every column that is a variable and no input.
        """
        pairs = _pairs(place, asked)
        known = _names(flat, inputs=False)
        if asked is None:
            pairs = {name: name for name in self.names if name in known}
            if not pairs:
                raise ModelError(
                    f"{place}: found no column of {self.table.path.name} that is a variable of the model "
                    f'({", ".join(self.names)}), expected measured = {{ x = "its column" }}'
                )
        found = {}
        for name, column in pairs.items():
            if name not in known:
                raise ModelError(f"{place}.measured: the model has no '{name}'{did_you_mean(name, known)}")
            found[name] = self._one(flat, f"{place}.measured", name, column)
        noise = _deviations(place, list(found), deviation)
        if self.times is None:
            if noise:
                times = np.arange(1.0, len(next(iter(found.values()))) + 1)
                return {n: Samples(times, values, deviation=noise.get(n)) for n, values in found.items()}
            return found
        return {n: Samples(self.times, values, deviation=noise.get(n)) for n, values in found.items()}

    def inputs(self, flat: FlatModel, place: str, held: list[str]) -> dict[str, Any]:
        """Samples of the inputs that columns are named after; held: those whose values hold until the next time."""
        known = _names(flat, inputs=True)
        for name in held:
            if name not in known:
                raise ModelError(f"{place}.held: the model has no input '{name}'{did_you_mean(name, known)}")
        found: dict[str, Any] = {}
        for name in self.names:
            if name in known:
                values = self._one(flat, place, name, name)
                kind = "constant" if name in held else "linear"
                found[name] = values if self.times is None else Samples(self.times, values, kind=kind)
        return found

    def _one(self, flat: FlatModel, place: str, name: str, column: str) -> np.ndarray:
        """A column for a variable; ModelError for one that is not there, or has a unit of something else."""
        unit = next(v.unit for v in flat.variables if name in (v.name, *v.elements))
        try:
            return self.table.column(column, *([unit] if unit else ()), filled=True)
        except ModelError as error:
            raise ModelError(f"{place}: {error}") from None


def _names(flat: FlatModel, inputs: bool) -> list[str]:
    """The scalars that are known from outside, or all others."""
    if inputs:
        return list(flat.inputs)
    return [n for v in flat.variables for n in v.elements if n not in flat.inputs]


def _pairs(place: str, asked: Any) -> dict[str, str]:
    """Columns by the variables that they measure."""
    names = asked if isinstance(asked, list) else [asked] if asked is not None else []
    pairs = dict(asked if isinstance(asked, dict) else zip(names, names, strict=True))
    if all(isinstance(name, str) for name in (*pairs, *pairs.values())):
        return pairs
    raise ModelError(
        f'{place}.measured: found {asked!r}, expected names, as ["x", "y"], or {{ x = "its column" }}'
    )


def _deviations(place: str, names: list[str], deviation: Any) -> dict[str, float]:
    """Standard deviations by name; none, or one for each."""
    if deviation is None:
        return {}
    found: dict[str, Any] = deviation if isinstance(deviation, dict) else dict.fromkeys(names, deviation)
    keys = dict.fromkeys(names, Value("1", above=0.0))
    return read_table(f"{place}.deviation", found, keys, needed=tuple(names))
