"""Saving a result to the file that the command line names."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from gantrytau import GantryTauError, SolveError
from gantrytau.commands.arguments.display_option import of_file
from gantrytau.commands.printing.reporting import FAULT, INTERRUPTED, fail, writable
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Result
    from gantrytau_optimica import Optimum


def rehearse(file: Path | None) -> None:
    """Find out before the work whether its result can be saved; CommandError if not."""
    from gantrytau import Result

    if file is None:
        return
    trial = file.with_name(f".{file.stem}.trial{file.suffix}")
    with writable(file):
        try:
            Result([0.0], {"x": 0.0}).save(trial)
        except GantryTauError as error:
            raise type(error)(str(error).replace(str(trial), str(file))) from error
        finally:
            if trial.parent.is_dir():
                trial.unlink(missing_ok=True)


def save(result: "Result | Optimum", file: Path | None, display: Any = None) -> list[str]:
    """Write the result, if a file is named, a CSV file in units as `display` says; the files written."""
    if file is None:
        return []
    with writable(file):
        return [str(result.save(file, **of_file(display, file)))]


def stop(error: SolveError, spelling: Spelling, output: Path | None, json: bool) -> NoReturn:
    """Save what a simulation found until it stopped, say so, and leave."""
    pressed = error.interrupted
    message = str(error).partition(";")[0] if pressed else spelling.of(error)
    files: list[str] = []
    if output is not None and error.result is not None:
        files = save(error.result, output)
        message += f"\nWhat was computed until then is in {output}"
    elif pressed:
        message += "; with --output its result would have been saved"
    code = INTERRUPTED if pressed else FAULT
    fail(message, code, json, kind=type(error).__name__, time=error.time, files=files)
