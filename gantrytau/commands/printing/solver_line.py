"""A line on the terminal that follows a solver."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def live(name: str, quiet: bool) -> Iterator[Callable[..., None] | None]:
    """A line on the terminal that follows the solver; none where nobody would see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    line = _Line(f"translating and building {name}")
    with Console(file=sys.stderr).status(line):

        def progress(iteration: int, objective: float, stage: str = "") -> None:
            place = f"{stage}, " if stage else ""
            line.words = f"{name}: {place}iteration {iteration}, objective {objective:.6g}"

        yield progress


class _Line:
    """Words and the seconds that it takes already, which go on while nothing is reported."""

    def __init__(self, words: str):
        self.words, self.begin = words, time.perf_counter()

    def __rich__(self) -> Any:
        from rich.text import Text

        return Text(f"{self.words}, {time.perf_counter() - self.begin:.1f} s")
