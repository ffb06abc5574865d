"""How well a calibration foretells poses that were not fitted."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import Model
from gantrytau.border.checks import whole
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.calibrate import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.diagnostics.fitted_numbers import mean_by_worth
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration


@dataclass(frozen=True, eq=False)
class CrossValidation(Record):
    """A calibration, and how far poses lie from where fits without them expect them.

    calibration: with all that was fitted, as of `calibrate`.
    errors: distances by row of the measurements, (N,) in m, NaN where a row was
    always fitted or not usable.
    """

    calibration: Any
    errors: np.ndarray

    @property
    def good(self) -> np.ndarray:
        """The errors without gross ones, which a robust loss leaves without weight, (n,) in m."""
        return self.errors[self._kept]

    @property
    def _kept(self) -> np.ndarray:
        rows = np.delete(np.arange(len(self.errors)), self.calibration.left_out)
        return rows[np.isfinite(self.errors[rows])]

    @property
    def error(self) -> float:
        """Their mean, m, of surer poses by as much more; NaN where no pose was left out of a fit."""
        return float(mean_by_worth(self.good, self.calibration.measurements.select(self._kept).certainty))

    def __repr__(self) -> str:
        count = f"{self.good.size} poses that were not fitted"
        return f"<CrossValidation: {self.error * 1e6:.3g} um in the mean of {count}>"


def held_out(calibration: Calibration | NamedCalibration) -> CrossValidation:
    """By the poses that `calibrate` held out; all NaN if it fitted all of them."""
    errors = np.full(len(calibration.measurements), np.nan)
    if not np.array_equal(calibration.held_out, calibration.rows):
        errors[calibration.held_out] = calibration.errors
    return CrossValidation(calibration, errors)


def cross_validate(
    robot: Model, measurements: Measurements, *, parts: int = 5, **policy: Any
) -> CrossValidation:
    """Fit all poses, and foretell each part of them by a fit of the others.

        checked = cross_validate(robot, Measurements.read("measured.csv"), parts=5)
        checked.calibration.parameters, checked.error

    parts: how many, from 2; row k of the usable ones belongs to part k modulo their number. policy: further keywords of
    `calibrate`, but for `holdout`. Errors are NaN where the other parts are too few to calibrate the robot; for all poses
    together CalibrationError and ModelError as of `calibrate`.
    """
    whole("cross_validate", "parts", parts, least=2)
    every = calibrate(robot, measurements, **policy, holdout=None)
    errors = np.full(len(measurements), np.nan)
    for part in range(parts):
        rows = every.rows[part::parts]
        try:
            fit = calibrate(robot, measurements, **policy, holdout=rows) if rows.size else None
        except CalibrationError:
            fit = None
        if fit is None:
            return CrossValidation(every, np.full(len(measurements), np.nan))
        errors[fit.held_out] = fit.errors
    return CrossValidation(every, errors)
