"""Columns of a CSV file, which are measured variables or inputs of a model, in its units."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import FlatModel, ModelError, Samples, did_you_mean

TIME = "time"


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns of a file (n,) by name, units of those that tell them, and times in s, None where there are none."""

    file: Path
    values: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    times: np.ndarray | None

    def part(self, begin: Any, stop: Any) -> "Columns":
        """The rows from begin to stop, both in s, None where there is no limit."""
        if self.times is None:
            return self
        kept = np.ones(self.times.size, dtype=bool)
        for limit, sign in ((begin, 1.0), (stop, -1.0)):
            if isinstance(limit, (int, float)):
                kept &= sign * (self.times - limit) >= 0
        return replace(
            self, values={name: column[kept] for name, column in self.values.items()}, times=self.times[kept]
        )

    def measured(self, flat: FlatModel, place: str, asked: Any, deviation: Any) -> dict[str, Any]:
        """Samples of variables, or values alone without times; ModelError for names that are not there.

        asked: names, or {variable: column}; None takes every column that is a variable and no input.
        """
        pairs = _pairs(place, asked)
        known = _names(flat, inputs=False)
        if asked is None:
            pairs = {name: name for name in self.values if name in known}
            if not pairs:
                raise ModelError(
                    f"{place}: found no column of {self.file.name} that is a variable of the model "
                    f'({", ".join(self.values)}), expected measured = {{ x = "its column" }}'
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
        for name in self.values:
            if name in known:
                values = self._one(flat, place, name, name)
                kind = "constant" if name in held else "linear"
                found[name] = values if self.times is None else Samples(self.times, values, kind=kind)
        return found

    def _one(self, flat: FlatModel, place: str, name: str, column: str) -> np.ndarray:
        """A column for a variable; ModelError for one that is not there, or in another unit than the variable."""
        if column not in self.values:
            raise ModelError(
                f"{place}: {self.file.name} has no column '{column}'{did_you_mean(column, self.values)}"
            )
        unit = next(v.unit for v in flat.variables if name in (v.name, *v.elements))
        told = self.units.get(column, "")
        if told and unit and told != unit:
            raise ModelError(
                f"{place}: column '{column}' of {self.file.name} is in {told}, expected {unit}, the unit of {name}; "
                "convert the column, and write its unit"
            )
        return self.values[column]


def _names(flat: FlatModel, inputs: bool) -> list[str]:
    """The scalars that are known from outside, or all others."""
    if inputs:
        return list(flat.inputs)
    return [n for v in flat.variables for n in v.elements if n not in flat.inputs]


def _pairs(place: str, asked: Any) -> dict[str, str]:
    if isinstance(asked, str):
        return {asked: asked}
    if isinstance(asked, list) and all(isinstance(name, str) for name in asked):
        return {name: name for name in asked}
    if isinstance(asked, dict) and all(isinstance(column, str) for column in asked.values()):
        return dict(asked)
    if asked is None:
        return {}
    raise ModelError(
        f'{place}.measured: found {asked!r}, expected names, as ["x", "y"], or {{ x = "its column" }}'
    )


def _deviations(place: str, names: list[str], deviation: Any) -> dict[str, float]:
    """Standard deviations by name; none, or one for each."""
    if deviation is None:
        return {}
    found: dict[str, Any] = deviation if isinstance(deviation, dict) else dict.fromkeys(names, deviation)
    for name, value in found.items():
        if name not in names:
            raise ModelError(
                f"{place}.deviation: '{name}' is not among the measured{did_you_mean(name, names)}"
            )
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < np.inf:
            raise ModelError(f"{place}.deviation: found {value!r}, expected a number above 0, in SI")
    for name in names:
        if name not in found:
            raise ModelError(f"{place}.deviation: found none of {name}, expected one for each, or for none")
    return {name: float(value) for name, value in found.items()}


def read_columns(file: Path) -> Columns:
    """A CSV file with a header; `x [m]` is x in m. ModelError where it cannot be read, naming the line."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as opened:
            rows = [(k, row) for k, row in enumerate(csv.reader(opened), 1) if any(c.strip() for c in row)]
    except FileNotFoundError:
        raise ModelError(f"{file}: there is no such file; check data = ...") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ModelError(f"{file}: cannot be read as CSV ({error})") from error
    if len(rows) < 2:
        raise ModelError(f"{file}: found {len(rows)} rows, expected a header and a row for each time")
    heads = [head.strip() for head in rows[0][1]]
    names = [head.rpartition(" [")[0] or head for head in heads]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(f"{file}: found two columns '{name}', expected different names")
    table = np.array([_row(file, line, row, names) for line, row in rows[1:]])
    units = {name: head[len(name) + 2 : -1] for name, head in zip(names, heads, strict=True) if head != name}
    values = dict(zip(names, table.T, strict=True))
    if TIME in units and units[TIME] != "s":
        raise ModelError(f"{file}: the times are in {units[TIME]}, expected s; convert them")
    return Columns(file, values, units, values.pop(TIME, None))


def _row(file: Path, line: int, row: list[str], names: list[str]) -> list[float]:
    if len(row) != len(names):
        raise ModelError(f"{file}, line {line}: found {len(row)} values, expected {len(names)}; repair it")
    numbers = []
    for name, cell in zip(names, row, strict=True):
        try:
            numbers.append(float(cell))
        except ValueError:
            raise ModelError(
                f"{file}, line {line}, column '{name}': found '{cell}', expected a number"
            ) from None
    return numbers
