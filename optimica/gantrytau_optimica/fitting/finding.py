"""Something noticed of data or of a fit, as a record with rows and words."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gantrytau.describing.record import Record

SHOWN = 8  # rows, or ranges of them, that a message lists


@dataclass(frozen=True)
class Finding(Record):
    """Something noticed: kind, such as "duplicates" or "millimetres"; rows from 0; a sentence."""

    kind: str
    rows: np.ndarray = field(repr=False)
    message: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.message}"


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
