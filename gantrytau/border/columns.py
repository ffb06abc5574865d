"""Tables in CSV files, as programs and spreadsheets write them: cells, columns by name, and their units.

Cells are separated by commas, or by semicolons or tabs, where decimals may then have a comma. Empty lines, lines that begin
with `#` and the line `sep=;` of a spreadsheet are no rows. The header is the first line, or the last comment above the
numbers, as NumPy writes it. A heading may have a unit in brackets, `x [mm]`; without one its column is in SI.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import Scale, known_scale, scale

SEPARATORS = (";", "\t", ",")
TIMES = ("time", "t", "timestamp")
_HEADING = re.compile(r"(?P<name>.*?\S)(?P<space>\s*)(?:\[(?P<square>[^\[\]]+)\]|\((?P<round>[^()]+)\))")


@dataclass(frozen=True, eq=False)
class Columns:
    """A CSV file with a header: names of the columns, and their numbers in SI, (n,) each, by `column`.

    path: the file; header: headings as they stand; lines: (n,) of the rows in the file, from 1.
    """

    path: Path
    header: tuple[str, ...]
    lines: np.ndarray
    rows: list[list[str]]
    separator: str

    @classmethod
    def read(cls, path: str | PathLike[str], rows: str = "one line for each row") -> Self:
        """The table of a file, of one row at least; rows: what a row is, for messages.

        Raises ModelError, with the line, for what cannot be read as text, and rows that are not as long as the header.
        """
        path = Path(path)
        lines, separator = read_cells(path)
        kept = [(line, row) for line, row in lines if not _is_comment(row[0])]
        above = [row for line, row in lines if kept and line < kept[0][0]]
        if above and all(is_number(cell, separator) for cell in kept[0][1]):
            kept.insert(0, (0, [above[-1][0].lstrip("# "), *above[-1][1:]]))
        if len(kept) < 2:
            raise ModelError(f"{path}: found {len(kept)} lines, expected a header and {rows}")
        header = tuple(cell.strip() for cell in kept[0][1])
        if all(is_number(name, separator) for name in header):
            raise ModelError(
                f"{path}: found numbers in the first line, expected the names of the columns; add them"
            )
        for line, row in kept[1:]:
            check_cells(path, line, row, len(header), separator)
        numbers = np.array([line for line, _ in kept[1:]], dtype=int)
        return cls(path, header, numbers, [row for _, row in kept[1:]], separator)

    def __repr__(self) -> str:
        return f"<Columns of {self.path.name}: {', '.join(self.header)}; {len(self)} rows>"

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, without units."""
        return tuple(name for name, _ in self._headings)

    @cached_property
    def _headings(self) -> list[tuple[str, str | None]]:
        return [split_heading(heading) for heading in self.header]

    def unit(self, name: str) -> str | None:
        """The unit of a column as it is written, None without one."""
        return self._headings[self._index(name)][1]

    def column(
        self, name: str, *units: str, filled: bool = False, si: bool = True, place: int | None = None
    ) -> np.ndarray:
        """Numbers of a column in SI, (n,), NaN for empty cells.

        units: SI units of what it may measure, none for anything; filled: empty cells and what is not finite are refused;
        si: False leaves the numbers in the unit of the heading; place: its index, where names do not tell columns apart.
        Raises ModelError, with the line, for a column that is missing or stands twice, a unit of something else, and a cell
        that is no number.
        """
        place = self._index(name) if place is None else place
        unit = self._scale(place, units) if si else None
        cells = [row[place] for row in self.rows]
        try:
            found = np.array(cells, dtype=float)
        except ValueError:
            found = np.array([self._number(k, name, cell) for k, cell in enumerate(cells)], dtype=float)
        bad = np.flatnonzero(~np.isfinite(found))
        if filled and bad.size:
            told = f"'{cells[bad[0]].strip()}'" if cells[bad[0]].strip() else "an empty cell"
            raise ModelError(
                f"{self.path}: line {self.lines[bad[0]]}, column {name}: found {told}, expected a number"
            )
        return found if unit is None else np.asarray(unit.si(found))

    def texts(self, name: str) -> list[str]:
        """The cells of a column as they stand, without blanks around them."""
        place = self._index(name)
        return [row[place].strip() for row in self.rows]

    def select(self, rows: np.ndarray) -> Self:
        """The table with some rows, by indices or a mask (n,)."""
        kept = np.arange(len(self))[rows]
        return replace(self, lines=self.lines[kept], rows=[self.rows[k] for k in kept])

    @cached_property
    def time_name(self) -> str | None:
        """The name of the first column that is called `time`, `t` or `timestamp`; None without one."""
        return next((name for name in self.names if name.lower() in TIMES), None)

    @cached_property
    def time(self) -> np.ndarray | None:
        """Times in s, (n,), None without a column of them."""
        return None if self.time_name is None else self.column(self.time_name, "s", filled=True)

    def _index(self, name: str) -> int:
        count = self.names.count(name)
        if not count:
            raise ModelError(f"{self.path}: found no column '{name}'{did_you_mean(name, self.names)}")
        if count > 1:
            raise ModelError(f"{self.path}: found {count} columns '{name}', expected different names")
        return self.names.index(name)

    def _scale(self, place: int, units: Sequence[str]) -> Scale | None:
        name, text = self._headings[place]
        if text is None:
            return None
        try:
            found = scale(text)
        except ModelError as error:
            raise ModelError(f"{self.path}: column '{self.header[place]}': {error}") from None
        if units and not any(found.measures(unit) for unit in units):
            known_scale(f"{self.path}: column {name}", text, units[0])
        return found

    def _number(self, row: int, column: str, cell: str) -> float:
        return number_of(self.path, self.lines[row], column, cell, self.separator)


def read_cells(path: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """The lines of a CSV file that are not empty, each with its number, from 1, and its cells; and the separator of cells.

    ModelError for what cannot be read as text.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            first = next((line for line in file if line.strip() and not _is_comment(line)), "")
            told = re.fullmatch(r'"?sep=(.)"?\s*', first)
            separator = told[1] if told else next((one for one in SEPARATORS if one in first), ",")
            file.seek(0)
            reader = csv.reader(file, delimiter=separator)
            rows = [(reader.line_num, row) for row in reader if "".join(row).strip()]
    except OSError as error:
        raise ModelError(f"{path}: found no file to read ({error.strerror}), expected a CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ModelError(
            f"{path}: cannot be read as text ({error}); save it as CSV with the encoding UTF-8"
        ) from None
    return rows[1:] if told else rows, separator


def split_heading(heading: str) -> tuple[str, str | None]:
    """Name and unit of a heading: "phi [deg]" or "q1 (mm)"; None without one, as of "r[0]", "der(m)" and "x (filtered)"."""
    found = _HEADING.fullmatch(heading.strip())
    if found is None:
        return heading.strip(), None
    text = (found["square"] or found["round"]).strip()
    sure = bool(
        found["space"] and found["square"]
    )  # in any other place it is a unit only if there is such a unit
    if not sure and ((found["round"] and not found["space"]) or text.isdigit() or not _is_unit(text)):
        return heading.strip(), None
    return found["name"], text


def _is_unit(text: str) -> bool:
    try:
        scale(text)
    except ModelError:
        return False
    return True


def _is_comment(text: str) -> bool:
    return text.lstrip().startswith("#")


def check_cells(path: Path, line: int, row: list[str], count: int, separator: str) -> None:
    """ModelError for a line that has not as many cells as the header."""
    if len(row) != count:
        commas = separator == "," and len(row) > count
        remedy = "; where decimals have commas, separate cells by semicolons" if commas else ""
        raise ModelError(f"{path}: line {line} has {len(row)} cells, expected {count} as the header{remedy}")


def number_of(path: Path, line: int, column: str, cell: str, separator: str) -> float:
    """The number in a cell, NaN for an empty one; ModelError for a text that is no number."""
    text = cell.strip()
    try:
        return float(text if separator == "," else text.replace(",", ".")) if text else np.nan
    except ValueError:
        decimals = "" if separator == "," else ", or a comma"
        raise ModelError(
            f"{path}: line {line}, column {column}: found {text!r}, expected a number, with a point{decimals} before "
            "decimals and nothing between thousands"
        ) from None


def is_number(text: str, separator: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(text if separator == "," else text.replace(",", "."))
    except ValueError:
        return False
    return True
