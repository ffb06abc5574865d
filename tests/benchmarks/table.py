"""Rows of the bench table."""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Row:
    """One figure: what, measured, target, and whether it is met (None: no target)."""

    figure: str
    measured: str
    target: str
    met: bool | None


def at_most(figure: str, value: float, limit: float, unit: str = "") -> Row:
    """A row whose figure must not exceed a limit."""
    space = f" {unit}" if unit else ""
    return Row(figure, f"{value:.4g}{space}", f"<= {limit:g}{space}", bool(value <= limit))


def at_least(figure: str, value: float, limit: float) -> Row:
    """A row whose figure must reach a limit."""
    return Row(figure, f"{value:g}", f">= {limit:g}", bool(value >= limit))


def shown(figure: str, value: str) -> Row:
    """A row without a target."""
    return Row(figure, value, "", None)


def in_turn(programs: dict[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Median wall time in s of each program, run in turn so that a drifting machine hits all alike."""
    times: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(rounds):
        for name, program in programs.items():
            begin = time.perf_counter()
            program()
            times[name].append(time.perf_counter() - begin)
    return {name: statistics.median(found) for name, found in times.items()}


def started(programs: dict[str, tuple[str, ...]], rounds: int) -> dict[str, float]:
    """Median processor time in s of Python with each list of arguments, in turn, after a first run.

    The first run keeps the modules as byte code: PYTHONDONTWRITEBYTECODE would have each run compile all sources.
    """
    with tempfile.TemporaryDirectory() as folder:
        kept = {**os.environ, "PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": ""}

        def seconds(arguments: tuple[str, ...]) -> float:
            before = os.times()
            subprocess.run([sys.executable, *arguments], env=kept, stdout=subprocess.DEVNULL, check=True)
            after = os.times()
            return after.children_user + after.children_system - before.children_user - before.children_system

        runs = [[seconds(one) for one in programs.values()] for _ in range(rounds + 1)][1:]
    return {
        name: statistics.median(found) for name, found in zip(programs, zip(*runs, strict=True), strict=True)
    }


def peak_memory() -> float:
    """Peak memory of this process in GB; ru_maxrss of Linux begins with that of the parent process."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(re.findall(r"VmHWM:\s*(\d+) kB", status.read_text())[0]) * 1024 / 1e9
    import resource  # of macOS, in bytes; there is none on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e9


WIDTH = 140  # of the table where the output is no terminal
COLUMNS = (64, 50, 14, 4)  # figure, measured, target, met


def print_table(title: str, parts: Iterable[Iterable[Row]]) -> int:
    """Measure all rows and print each as it comes; 1 if a target is missed."""
    screen = Console()
    if not screen.is_terminal:
        screen = Console(width=WIDTH)
    screen.print(_line(title, "measured", "target", "met"), style="bold")
    missed = []
    for part in parts:
        for row in part:
            verdict = "" if row.met is None else "yes" if row.met else "NO"
            screen.print(_line(row.figure, row.measured, row.target, verdict))
            missed += [row.figure] if row.met is False else []
    screen.print(f"Missed: {'; '.join(missed)}" if missed else "All targets are met.")
    return int(bool(missed))


def _line(*cells: str) -> Table:
    """One line of the table, whose columns stand under each other though it grows."""
    line = Table.grid(padding=(0, 1), expand=False)
    for k, width in enumerate(COLUMNS):
        line.add_column(width=width, justify="right" if k else "left")
    line.add_row(*cells)
    return line
