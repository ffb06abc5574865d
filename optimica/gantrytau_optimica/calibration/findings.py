"""What measurements have wrong with them: findings, and the error for data that cannot be used."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gantrytau import GantryTauError

SHOWN = 8  # rows that a message lists


@dataclass(frozen=True)
class Finding:
    """Something noticed: kind, such as "duplicates" or "millimetres"; rows from 0; a sentence."""

    kind: str
    rows: np.ndarray = field(repr=False)
    message: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.message}"


class CalibrationError(GantryTauError):
    """Measurements that determine no robot, or not this one.

    kind: the kind of the finding; rows: the rows concerned, from 0; findings: everything else that was noticed.
    """

    def __init__(self, message: str, *, kind: str = "", rows: Sequence[int] | np.ndarray = (), findings=()):
        super().__init__(message)
        self.kind = kind
        self.rows = np.asarray(rows, dtype=int)
        self.findings: tuple[Finding, ...] = tuple(findings)


def rows_in_words(rows: Sequence[int] | np.ndarray) -> str:
    """Rows for a message: "row 3", "rows 3, 4 and 9", "rows 0 to 99", or the first few of many."""
    rows = [int(row) for row in rows]
    if len(rows) == 1:
        return f"row {rows[0]}"
    if len(rows) > 2 and rows == list(range(rows[0], rows[-1] + 1)):
        return f"rows {rows[0]} to {rows[-1]}"
    if len(rows) <= SHOWN:
        return f"rows {', '.join(map(str, rows[:-1]))} and {rows[-1]}"
    return f"rows {', '.join(map(str, rows[:SHOWN]))} and {len(rows) - SHOWN} more"
