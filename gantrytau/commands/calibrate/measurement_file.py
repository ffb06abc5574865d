"""A file of measurements, and the robot calibrated with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from gantrytau import Model
from gantrytau.commands.calibrate.calibration_options import SPELLING
from gantrytau.commands.calibrate.file_lines import in_lines, read
from gantrytau.commands.printing.reporting import FAULT, CommandError, busy, fail

OF_GUIDEWAYS = "guideway"  # findings whose rows are those of a guideway


@dataclass(frozen=True)
class Measured:
    """A file of measurements: its lines (N,), and what stands in them."""

    file: Path
    data: Any
    lines: np.ndarray

    @staticmethod
    def read(file: Path, rails: Sequence[Path] = ()) -> "Measured":
        """CommandError for files that cannot be read."""
        data = read(file, rails)
        if len(data) and not data.finite.any():
            raise CommandError(
                f"{file}: found no line with numbers in all columns, expected the poses that were measured; fill in x, y "
                "and z"
            )
        return Measured(file, data, data.lines)

    def words(self, message: str, said: Sequence[Any]) -> str:
        """A message with lines in place of rows, and options in place of arguments."""
        rows = [one.rows for one in said if one.kind != OF_GUIDEWAYS]
        return SPELLING.words(in_lines(message, rows, self.lines) if rows else message)


def calibrated(robot: Model, measured: Measured, policy: dict[str, Any], json: bool) -> Any:
    """The calibration, whose findings name lines; leaves with a message for data that determine nothing."""
    from gantrytau_optimica import CalibrationError, calibrate

    try:
        with busy(f"calibrating {type(robot).__name__}"):
            found = calibrate(robot, measured.data, **policy)
    except CalibrationError as error:
        _refuse(error, measured, json)
    if not found.success:
        fail(
            f"{measured.file}: the search for parameters did not settle within {found.iterations} steps; look at the "
            "measurements, measure more poses, or try --robust or --start linear\nNothing was written",
            FAULT,
            json,
            kind="SolveError",
        )
    told = tuple(replace(f, message=measured.words(f.message, [f])) for f in found.findings)
    if policy["loss"] == "linear":
        _refuse_outliers(found.error, told, measured, json)
    return found.with_findings(told)


def _refuse_outliers(error: float, findings: Sequence[Any], measured: Measured, json: bool) -> None:
    """Leave with a message if gross errors pull at the parameters."""
    for finding in findings:
        if finding.kind == "outliers":
            fail(
                f"{measured.file}: {finding.message}; with them poses are missed by {error * 1e6:.4g} um in the mean\n"
                "Nothing was written",
                FAULT,
                json,
                kind="CalibrationError",
                finding=finding.kind,
                lines=measured.lines[finding.rows].tolist(),
            )


def _refuse(error: Any, measured: Measured, json: bool) -> NoReturn:
    message = measured.words(str(error), [error, *error.findings]).replace("Measurements: ", "", 1)
    others = [f for f in error.findings if f.kind != error.kind]
    more = "".join(f"\n  {f.kind}: {measured.words(f.message, [f])}" for f in others)
    rows = [] if error.kind == OF_GUIDEWAYS else measured.lines[error.rows].tolist()
    fail(
        f"{measured.file}: {message}{more}\nNothing was written",
        FAULT,
        json,
        kind=type(error).__name__,
        finding=error.kind,
        lines=rows,
    )
