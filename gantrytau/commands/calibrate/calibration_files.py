"""What is kept of a calibration: the report, and the parameters in a file for `--set`. Written whole or not at all."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gantrytau import parameter_text
from gantrytau.commands.printing.reporting import CommandError
from gantrytau_optimica import Calibration
from gantrytau_optimica.calibration import About, calibrated_geometry, frame_words, write_report

PARAMETERS = "calibrated.toml"
REPORT = "report.html"


def folder_beside(file: Path) -> Path:
    """Where the results of a file go if no other folder is named."""
    return file.with_name(f"{file.stem}-calibrated")


def rehearse(folder: Path) -> None:
    """CommandError if results cannot be written into a folder."""
    if folder.exists() and not folder.is_dir():
        raise CommandError(f"--output {folder}: found a file, expected a folder; name another place")
    above = next(place for place in (folder.absolute(), *folder.absolute().parents) if place.is_dir())
    if not os.access(above, os.W_OK | os.X_OK):
        raise CommandError(
            f"--output {folder}: no files can be written in {above}; name another place with --output"
        )


@contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """A folder to write to, whose files take their places in `folder` at the end, or vanish on an error."""
    partial = folder.absolute().with_name(f".{folder.absolute().name}.{os.getpid()}")
    try:
        partial.mkdir(parents=True)
        yield partial
        folder.mkdir(exist_ok=True)
        for file in sorted(partial.iterdir()):
            os.replace(file, folder / file.name)
    except OSError as error:
        raise CommandError(
            f"Cannot write into {folder}: {error.strerror}; name another place with --output"
        ) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def write(found: Calibration, folder: Path, robot: str, source: Path, about: About) -> list[str]:
    """Report and parameters; the files written. robot: as the command line names it; source: the measurements; about: what
    the report says besides.
    """
    with whole(folder) as partial:
        write_report(found, partial / REPORT, about)
        robot_values = calibrated_geometry(found)
        if robot_values is not None:
            heading = _heading(found, robot, source, folder / PARAMETERS, about.verdict)
            (partial / PARAMETERS).write_text(parameter_text(robot_values, robot, heading), encoding="utf-8")
        names = sorted(file.name for file in partial.iterdir())
    if robot_values is None:
        (folder / PARAMETERS).unlink(missing_ok=True)  # of an earlier model, which these results are not
    return [str(folder / name) for name in names]


def _heading(found: Calibration, robot: str, source: Path, file: Path, verdict: str) -> str:
    said = verdict or f"{found.error * 1e6:.4g} um in the mean of {len(found.held_out)} poses."
    return (
        f"Calibrated with {source.name}: lengths and offsets in m.\n"
        f"{said}\n"
        f"Frame: {frame_words(found.frame, found.motion)}.\n"
        f"{_frame_table(found)}"
        f"On the command line: gantrytau simulate '{robot}' --set {file.name}\n"
        f'In Python: robot.modified(tomllib.loads(Path("{file.name}").read_text()))'
    )


def _frame_table(found: Calibration) -> str:
    """R and t as a table of TOML, which stays a comment, as no robot has such parameters; nothing where there are none."""
    if "frame.R" not in found.parameters:
        return ""
    R, t = (found.parameters[name].tolist() for name in ("frame.R", "frame.t"))
    return f"[frame]\nR = {R}\nt = {t}\n"
