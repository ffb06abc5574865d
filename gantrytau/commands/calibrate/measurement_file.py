"""A file of measurements, and the robot calibrated with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from gantrytau import Model
from gantrytau.commands.printing.reporting import FAULT, CommandError, busy, fail, refusing
from gantrytau.commands.printing.spelling import RUNNING, spelled
from gantrytau_optimica import CalibrationError, Finding, Measurements, calibrate, cross_validate
from gantrytau_optimica.calibration import CrossValidation, held_out

OF_GUIDEWAYS = "guideway"  # findings whose rows are those of a guideway


@dataclass(frozen=True, eq=False)
class MeasurementFile:
    """A file of measurements, and what of it is to be fitted."""

    path: Path
    data: Measurements

    @staticmethod
    def read(path: Path, rails: Sequence[Path] = ()) -> "MeasurementFile":
        """CommandError for files that cannot be read."""
        with refusing():
            data = Measurements.read(path, rails=list(rails) or None)
        if len(data) and not data.finite.any():
            raise CommandError(
                f"{path}: found no line with numbers in all columns, expected the poses that were measured; fill in x, y "
                "and z"
            )
        return MeasurementFile(path, data)

    @property
    def lines(self) -> np.ndarray:
        """The line of each row, (N,)."""
        return np.arange(len(self.data)) if self.data.lines is None else self.data.lines

    def of_file(self, one: Any) -> Any:
        """A finding or an error with lines in place of rows."""
        return one if one.kind == OF_GUIDEWAYS else one.in_lines(self.lines)

    def words(self, finding: Finding) -> str:
        """A finding with lines in place of rows, and options in place of arguments."""
        return RUNNING.get().sentence(self.of_file(finding).parts)


def calibrated(
    robot: Model, measured: MeasurementFile, policy: dict[str, Any], *, cross: bool, json: bool
) -> CrossValidation:
    """The calibration, whose findings name lines; leaves with a message for data that determine nothing.

    cross: fit all poses, and judge by fits without each fifth of them in turn.
    """
    try:
        with busy(f"calibrating {type(robot).__name__}"):
            if cross:
                others = {name: value for name, value in policy.items() if name != "holdout"}
                checked = cross_validate(robot, measured.data, **others)
            else:
                checked = held_out(calibrate(robot, measured.data, **policy))
    except CalibrationError as error:
        _refuse(error, measured, json)
    found = checked.calibration
    if not found.success:
        fail(
            f"{measured.path}: the search for parameters did not settle within {found.iterations} steps; look at the "
            "measurements, measure more poses, or try --robust or --start linear\nNothing was written",
            FAULT,
            json,
            kind="SolveError",
        )
    told = tuple(replace(f, sentence=measured.words(f)) for f in found.findings)
    if policy["loss"] == "linear":
        _refuse_outliers(float(found.error), told, measured, json)
    return replace(checked, calibration=found.with_findings(told))


def _refuse_outliers(
    error: float, findings: Sequence[Finding], measured: MeasurementFile, json: bool
) -> None:
    """Leave with a message if gross errors pull at the parameters."""
    for finding in findings:
        if finding.kind == "outliers":
            fail(
                f"{measured.path}: {finding.message}; with them poses are missed by {error * 1e6:.4g} um in the mean\n"
                "Nothing was written",
                FAULT,
                json,
                kind="CalibrationError",
                finding=finding.kind,
                lines=measured.lines[finding.rows],
            )


def _refuse(error: CalibrationError, measured: MeasurementFile, json: bool) -> NoReturn:
    message = spelled(measured.of_file(error))
    others = [f for f in error.findings if f.kind != error.kind]
    more = "".join(f"\n  {f.kind}: {measured.words(f)}" for f in others)
    rows = [] if error.kind == OF_GUIDEWAYS else measured.lines[error.rows]
    fail(
        f"{measured.path}: {message}{more}\nNothing was written",
        FAULT,
        json,
        kind=type(error).__name__,
        finding=error.kind,
        lines=rows,
    )
