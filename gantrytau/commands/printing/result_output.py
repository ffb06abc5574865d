"""A result on the command line: saved to the file that is named, as a record, and its ends as a table."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from gantrytau import GantryTauError, Result, SolveError
from gantrytau.commands.arguments.display_option import of_file, of_table
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    CommandError,
    fail,
    print_table,
    writable,
)
from gantrytau.commands.printing.spelling import spelled

if TYPE_CHECKING:
    from gantrytau_optimica import Optimum

ENDS = ("start", "end", "least", "greatest")


def rehearse(file: Path | None) -> None:
    """Find out before the work whether its result can be saved; CommandError if not."""
    if file is None:
        return
    with writable(file):
        trial = file.with_name(f".{file.stem}.trial{file.suffix}")
        try:
            Result([0.0], {"x": 0.0}).save(trial)
        except GantryTauError as error:
            place = f"{file}: " if error.place else ""
            raise CommandError(f"{place}{error.words(str)}") from error
        finally:
            if trial.parent.is_dir():
                trial.unlink(missing_ok=True)


def save(result: "Result | Optimum", file: Path | None, display: Any = None) -> list[str]:
    """Write the result, if a file is named, a CSV file in units as `display` says; the files written."""
    if file is None:
        return []
    with writable(file):
        return [str(result.save(file, **of_file(display, file)))]


def stop(error: SolveError, output: Path | None, json: bool) -> NoReturn:
    """Save what a simulation found until it stopped, say so, and leave."""
    pressed = error.interrupted
    message = spelled(error)
    message = message.partition(";")[0] if pressed else message
    files: list[str] = []
    if output is not None and error.result is not None:
        files = save(error.result, output)
        message += f"\nWhat was computed until then is in {output}"
    elif pressed:
        message += "; with --output its result would have been saved"
    code = INTERRUPTED if pressed else FAULT
    fail(message, code, json, kind=type(error).__name__, time=error.time, files=files)


def record(result: Result) -> dict[str, Any]:
    """Times and last values of a result, for programs."""
    return {
        "time": {"start": result.time[0], "stop": result.time[-1], "points": len(result.time)},
        "ended": result.ended,
        "final": {name: result.final(name) for name in result.names},
    }


def print_ends(title: str, result: Result, names: Sequence[str], heading: str, units: Any = None) -> None:
    """What a result is, and where variables begin and end, as a table in units as `units` says."""
    count = len(result.names)
    typer.echo(
        f"{title}: {result.time[0]:g} s to {result.time[-1]:g} s, {len(result.time)} points, "
        f"{count} variable{'' if count == 1 else 's'}"
        + ("" if result.ended == "stop" else f", ended: {result.ended}")
    )
    rows = [
        (name, *(f"{x:.6g}" for x in (values[0], values[-1], values.min(), values.max())), unit)
        for name, (values, unit) in of_table(result, names, units).items()
    ]
    if rows:
        print_table((heading, *ENDS, "unit"), rows, right=(1, 2, 3, 4))
