"""Saving a result to the file that the command line names."""

from pathlib import Path
from typing import TYPE_CHECKING

from gantrytau import GantryTauError
from gantrytau.commands.printing.reporting import writable

if TYPE_CHECKING:
    from gantrytau import Result


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


def save(result: "Result", file: Path | None) -> list[str]:
    """Write the result, if a file is named; the files written."""
    if file is None:
        return []
    with writable(file):
        return [str(result.save(file))]
