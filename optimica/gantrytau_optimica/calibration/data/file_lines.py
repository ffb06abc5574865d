"""Rows of measurements, which count from 0, as lines of the file in which the user looks for them."""

import re
from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.fitting.finding import rows_in_words


def in_lines(message: str, said: Sequence[np.ndarray], lines: np.ndarray) -> str:
    """A message with lines in place of rows; said: the rows that it may speak of.

    A few rows that it does not name are added at its end.
    """
    words = {}
    for rows in said:
        if len(rows) and max(rows) < len(lines):
            words[rows_in_words(rows)] = _lines_in_words(lines[rows])
            others = np.setdiff1d(np.arange(len(lines)), rows)
            words[rows_in_words(rows, len(lines))] = (
                f"all but {_lines_in_words(lines[others])}"
                if rows_in_words(rows, len(lines)).startswith("all but")
                else _lines_in_words(lines[rows])
            )
    if not words:
        return message
    longest = sorted(words, key=len, reverse=True)
    pattern = re.compile(
        "|".join(rf"\b{re.escape(word)}(?!\d| more|, \d| and \d| to \d)" for word in longest)
    )
    spoken, count = pattern.subn(lambda found: words[found[0]], message)
    if not count and 0 < len(said[0]) < len(lines) / 4:
        spoken += f" ({words[rows_in_words(said[0])]})"
    return spoken


def _lines_in_words(lines: np.ndarray) -> str:
    return rows_in_words(lines).replace("row", "line", 1)
