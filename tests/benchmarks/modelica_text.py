"""Modelica text: parsing beside pymoca, a parser of the same language in Python."""

import sys
from collections.abc import Iterator
from pathlib import Path

from pymoca import parser as pymoca

from gantrytau.modelica import SourceText, parse
from tests.benchmarks.table import Row, at_least, at_most, in_turn, print_table

FOLDER = Path(__file__).parents[1] / "modelica"
FILES = ("drive.mo", "functions.mo", "motions.mo")  # what pymoca reads as well
ROUNDS = 5


def rows() -> Iterator[Row]:
    """Times of parsing."""
    texts = [SourceText.read(FOLDER / name) for name in FILES]
    programs = {
        "ours": lambda: [parse(text) for text in texts],
        "pymoca": lambda: [pymoca.parse(text.text, bypass_cache=True) for text in texts],
    }
    times = in_turn(programs, ROUNDS)
    yield at_most("Modelica text: parsing of a file", 1e3 * times["ours"] / len(texts), 15.0, "ms")
    yield at_least("Modelica text: time of pymoca, ours 1", round(times["pymoca"] / times["ours"], 1), 10.0)


if __name__ == "__main__":
    sys.exit(print_table("Modelica text", [rows()]))
