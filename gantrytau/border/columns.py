"""Tables in CSV files, as programs and spreadsheets write them: cells, columns by name, and their units.

Cells are separated by commas, by semicolons or tabs, where decimals may then have a comma, or by blanks. Empty lines, lines
that begin with `#` and the line `sep=;` of a spreadsheet are no rows. The header is the first line, or the last above the
numbers where titles stand before it, or the last comment there, as NumPy writes it. A heading may have a unit in brackets,
`x [mm]`; without one its column is in SI.
"""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import Scale, known_scale, scale

SEPARATORS = (";", "\t", ",")
TIMES = ("time", "t", "timestamp")
HEAD = 20  # lines, among which names and the first numbers stand
_HEADING = re.compile(r"(?P<name>.*?\S)(?P<space>\s*)(?:\[(?P<square>[^\[\]]+)\]|\((?P<round>[^()]+)\))")
_SEP = re.compile(r'"?sep=(.)"?\s*')


@dataclass(frozen=True, eq=False)
class Columns:
    """A CSV file with a header: names of the columns, and their numbers in SI, (n,) each, by `column`.

    path: the file; header: headings as they stand; lines: (n,) of the rows in the file, from 1; text: of the file, with
    empty lines in place of the header and those above; numbers: values by the index of the column, (n,), of a file that
    NumPy can read at once, none of another.
    """

    path: Path
    header: tuple[str, ...]
    lines: np.ndarray
    separator: str
    text: str = field(repr=False)
    numbers: Mapping[int, np.ndarray]

    @classmethod
    def read(cls, path: str | PathLike[str], rows: str = "one line for each row") -> Self:
        """The table of a file, of one row at least; rows: what a row is, for messages.

        Raises ModelError, with the line, for what cannot be read as text, and rows that are not as long as the header.
        """
        try:
            content = Path(path).read_bytes()
        except OSError as error:
            raise ModelError(
                f"{path}: found no file to read ({error.strerror}), expected a CSV file"
            ) from None
        return cls.parse(content, path, rows)

    @classmethod
    def parse(cls, content: bytes, path: str | PathLike[str], rows: str = "one line for each row") -> Self:
        """The table of a file that has been read, for one inside of an archive; as `read`."""
        path = Path(path)
        try:
            text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
            names, end, separator = _head(text)
            header = tuple(cell.strip() for _, row in _rows([names], separator) for cell in row)
            text = text.replace(text[:end], "\n" * text.count("\n", 0, end), 1)
            lines, numbers = _plain(text, len(header), separator)
            if not numbers:
                found = list(_rows(_stream(text), separator))
                for line, row in found:
                    _check_length(path, line, row, len(header), separator)
                lines = np.array([line for line, _ in found], dtype=int)
        except (UnicodeDecodeError, csv.Error) as error:
            raise ModelError(
                f"{path}: cannot be read as text ({error}); save it as CSV with the encoding UTF-8"
            ) from None
        if not lines.size:
            raise ModelError(f"{path}: found {len(header[:1])} lines, expected a header and {rows}")
        if all(is_number(name, separator) for name in header):
            raise ModelError(
                f"{path}: found numbers in the first line, expected the names of the columns; add them"
            )
        return cls(path, header, lines, separator, text, numbers)

    def __repr__(self) -> str:
        return f"<Columns of {self.path.name}: {', '.join(self.header)}; {len(self)} rows>"

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, without units."""
        return tuple(name for name, _ in self._headings)

    @cached_property
    def _headings(self) -> list[tuple[str, str | None]]:
        return [split_heading(heading) for heading in self.header]

    @property
    def units(self) -> tuple[str | None, ...]:
        """Units of the columns as they are written, None without one."""
        return tuple(unit for _, unit in self._headings)

    def unit(self, name: str) -> str | None:
        """The unit of a column as it is written, None without one."""
        return self.units[self._index(name)]

    def si_unit(self, name: str) -> str:
        """The unit of the numbers of `column`, "" without one."""
        unit = self._scale(self._index(name), ())
        if unit is None:
            return ""
        return unit.text if unit.slope == 1 and not unit.zero else unit.coherent

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
        found = self.numbers.get(place)
        if found is None:
            cells = [row[place] for row in self.rows]
            try:
                found = np.array(cells, dtype=float)
            except ValueError:
                found = np.array([self._number(k, name, cell) for k, cell in enumerate(cells)], dtype=float)
        bad = np.flatnonzero(~np.isfinite(found))
        if filled and bad.size:
            cell = self.rows[bad[0]][place].strip()
            told = f"'{cell}'" if cell else "an empty cell"
            raise ModelError(
                f"{self.path}: line {self.lines[bad[0]]}, column {name}: found {told}, expected a number"
            )
        return found.copy() if unit is None else np.asarray(unit.si(found))

    def texts(self, name: str) -> list[str]:
        """The cells of a column as they stand, without blanks around them."""
        place = self._index(name)
        return [row[place].strip() for row in self.rows]

    def select(self, rows: np.ndarray) -> Self:
        """The table with some rows, by indices or a mask (n,)."""
        return replace(self, lines=self.lines[rows], numbers={k: x[rows] for k, x in self.numbers.items()})

    @cached_property
    def rows(self) -> list[list[str]]:
        """The cells of all rows as they stand."""
        found = dict(_rows(_stream(self.text), self.separator))
        return [found[line] for line in self.lines.tolist()]

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
        return _number_of(self.path, self.lines[row], column, cell, self.separator)


def _head(text: str) -> tuple[str, int, str]:
    """The line of names, where the rows behind it start, and the separator of cells."""
    named, comments, told, row, end = [], [], "", "", 0
    while end < len(text) and len(named) < HEAD:
        start, end = end, text.find("\n", end) + 1 or len(text)
        row = text[start:end].rstrip("\n")
        if is_number(re.split(r"[;\t,\s]", row.lstrip(";\t, "))[0].strip('"'), ","):
            break
        if found := _SEP.fullmatch(row.strip()):
            told = found[1]
        elif row.strip():
            (comments if _is_comment(row) else named).append((row, end))
        row = ""
    if named:
        names, stop = named[-1] if row else named[0]
    elif comments and row and row[0] not in SEPARATORS:
        names, stop = comments[-1][0].lstrip("# "), comments[-1][1]
    else:
        names, stop = row, end
    blanks = len(names.split()) == len(row.split()) > 1 and not any(one in row for one in SEPARATORS)
    separator = told or next((one for one in SEPARATORS if one in names), " " if blanks else ",")
    if named and named[0][0].count(separator) == names.count(separator):  # no titles above the names
        names, stop = named[0]
    return names, stop, separator


def _rows(lines: Iterable[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """The cells of lines that are neither empty nor comments, with the number of the line, from 1."""
    if separator == " ":
        lines = (line.strip() for line in lines)
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=separator == " ")
    for row in reader:
        if "".join(row).strip() and not _is_comment(row[0]):
            yield reader.line_num, row


def _plain(text: str, count: int, separator: str) -> tuple[np.ndarray, Mapping[int, np.ndarray]]:
    """Lines of the rows of a text, and values of its columns of numbers, by NumPy; none of what has to be looked at closer.

    That is a text with quotes, comments, empty rows, rows of other lengths, and columns of numbers with other texts in them.
    """
    none = np.zeros(0, dtype=int), {}
    above = next((k for k, letter in enumerate(text) if letter != "\n"), len(text))
    row = text[above : (text.find("\n", above) + 1 or len(text) + 1) - 1]
    cells = row.split(None if separator == " " else separator)
    if not row.strip() or '"' in text or "#" in text or len(cells) != count:
        return none
    if separator != ",":
        text = text.replace(",", ".")
    used = [k for k, cell in enumerate(cells) if not cell.strip() or is_number(cell, separator)]
    try:
        found = _loaded(text, separator, used, count)
    except ValueError:
        try:
            found = _loaded(_filled(text, separator), separator, used, count)
        except ValueError:
            return none
    if np.isnan(found).all(axis=1).any():
        return none
    lines = np.arange(above + 1, above + 1 + len(found))
    if text.count("\n") - above + (text[-1] != "\n") != len(found):
        lines = np.array([k for k, line in enumerate(_stream(text), 1) if line.strip()])
    return lines, dict(zip(used, found.T, strict=True))


def _stream(text: str) -> io.TextIOWrapper:
    """A text as a file; a StringIO takes four bytes a character."""
    return io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8", newline="\n")


def _loaded(text: str, separator: str, used: Sequence[int], count: int) -> np.ndarray:
    """Columns of a text, (n, len(used)); ValueError for what is no number, and rows of other lengths."""
    own = (line.count(separator) for line in _stream(text) if line.strip())
    if len(used) < count and (separator == " " or any(n != count - 1 for n in own)):
        raise ValueError
    columns = used if len(used) < count else None  # NumPy looks at lengths where it reads all
    delimiter = None if separator == " " else separator
    return np.loadtxt(_stream(text), delimiter=delimiter, usecols=columns, ndmin=2, comments=None)


def _filled(text: str, separator: str) -> str:
    """A text whose empty cells are NaN; there are none between blanks."""
    if separator == " ":
        raise ValueError
    text = f"\n{text}\n"
    for before, behind in ((separator, separator),) * 2 + (("\n", separator), (separator, "\n")):
        text = text.replace(before + behind, f"{before}nan{behind}")
    return text[1:-1]


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


def _check_length(path: Path, line: int, row: list[str], count: int, separator: str) -> None:
    """ModelError for a line that has not as many cells as the header."""
    if len(row) != count:
        commas = separator == "," and len(row) > count
        remedy = "; where decimals have commas, separate cells by semicolons" if commas else ""
        raise ModelError(f"{path}: line {line} has {len(row)} cells, expected {count} as the header{remedy}")


def _number_of(path: Path, line: int, column: str, cell: str, separator: str) -> float:
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
