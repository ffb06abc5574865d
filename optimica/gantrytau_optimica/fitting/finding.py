"""Something noticed of data or of a fit: kind, rows, and a sentence that is put together when it is printed."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record

SHOWN = 8  # rows, or ranges of them, that a message lists


@dataclass(frozen=True, eq=False)
class DataRows:
    """Rows of data in a sentence, "rows 3 and 4", or the lines of the file in which they stand.

    of: how many rows there are, where "all but row 3" may be said; lines: of all rows, (N,).
    """

    rows: Sequence[int] | np.ndarray
    of: int | None = None
    lines: np.ndarray | None = None

    def __str__(self) -> str:
        text = rows_in_words(self.rows, self.of)
        if self.lines is None:
            return text
        but = "all but " if text.startswith("all but") else ""
        rows = np.setdiff1d(np.arange(len(self.lines)), self.rows) if but else np.asarray(self.rows)
        return but + rows_in_words(self.lines[rows]).replace("row", "line", 1)


Part = str | Given | DataRows


@dataclass(frozen=True)
class Finding(Record):
    """Something noticed: kind, such as "duplicates" or "millimetres"; rows from 0; a sentence, or its parts."""

    kind: str
    rows: np.ndarray = field(repr=False)
    sentence: str | Sequence[Part]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The sentence in parts: text, rows, and arguments of the called function."""
        return (self.sentence,) if isinstance(self.sentence, str) else tuple(self.sentence)

    @property
    def message(self) -> str:
        """The sentence."""
        return "".join(map(str, self.parts))

    def in_lines(self, lines: np.ndarray) -> Self:
        """This finding with lines of a file, (N,) for all rows, in place of rows."""
        return replace(self, sentence=in_lines(self.parts, self.rows, lines))

    def __str__(self) -> str:
        return f"{self.kind}: {self.message}"

    def __repr__(self) -> str:
        return f"Finding(kind={self.kind!r}, message={self.message!r})"


def in_lines(parts: Sequence[Part], rows: np.ndarray, lines: np.ndarray) -> list[Part]:
    """A sentence with lines in place of rows; a few rows that it does not name are added at its end."""
    named = any(isinstance(part, DataRows) for part in parts)
    found = [replace(part, lines=lines) if isinstance(part, DataRows) else part for part in parts]
    few = not named and 0 < len(rows) < len(lines) / 4
    return [*found, " (", DataRows(rows, lines=lines), ")"] if few else found


def rows_in_words(rows: Sequence[int] | np.ndarray, of: int | None = None) -> str:
    """Rows for a message: "row 3", "rows 3, 4 and 9", "rows 3 to 8, 12 and 20 to 31", or the first few of many.

    of: how many rows there are; where most of them are meant, "all but row 3" is said if that is shorter.
    """
    rows = np.unique(np.asarray(rows, dtype=int))
    ranges = _ranges(rows)
    if of is not None and len(rows) < of < 2 * len(rows):
        others = np.setdiff1d(np.arange(of), rows)
        if len(_ranges(others)) < len(ranges):
            return f"all but {rows_in_words(others)}"
    if len(ranges) > SHOWN:
        shown = SHOWN - 1 if len(ranges) == SHOWN + 1 else SHOWN
        left = len(rows) - sum(last - first + 1 for first, last in ranges[:shown])
        return f"rows {', '.join(map(_range_in_words, ranges[:shown]))} and {left} more"
    words = [_range_in_words(each) for each in ranges]
    listed = f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)
    return f"{'row' if len(rows) == 1 else 'rows'} {listed}"


def _range_in_words(ends: tuple[int, int]) -> str:
    return str(ends[0]) if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def _ranges(rows: np.ndarray) -> list[tuple[int, int]]:
    """First and last of rising rows that follow each other; two of them are no range."""
    starts = np.flatnonzero(np.diff(rows, prepend=rows[:1] - 2) > 1)
    found: list[tuple[int, int]] = []
    for part in np.split(rows, starts[1:]) if len(rows) else []:
        ends = [(int(row), int(row)) for row in part] if len(part) < 3 else [(int(part[0]), int(part[-1]))]
        found += ends
    return found


def agreeing(rows: Sequence[int] | np.ndarray, verb: str) -> str:
    """A verb for rows, "repeat", in the singular where it is one row."""
    one = {"are": "is", "they are": "it is", "go": "goes"}
    return verb if len(rows) != 1 else one.get(verb, f"{verb}s")


def length_text(length: float) -> str:
    """A length in micrometres or millimetres, whichever reads better."""
    return f"{length * 1e6:.3g} um" if length < 1e-3 else f"{length * 1e3:.3g} mm"
