"""How well poses are foretold by fits without them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import Model
from gantrytau.commands.calibrate.measurement_file import Measured

FOLDS = 5
FEW = 60  # poses, fewer than which are all fitted, and left out in turn


@dataclass(frozen=True, eq=False)
class Validation:
    """Distances of poses from where fits without them expect them, (N,) in m by row, NaN where there is none.

    left_out: rows with gross errors, which a robust loss leaves without weight.
    """

    errors: np.ndarray
    left_out: np.ndarray

    @property
    def error(self) -> float:
        """Their mean without gross errors, m."""
        errors = np.delete(self.errors, self.left_out)
        return float(errors[np.isfinite(errors)].mean())


def held_out(found: Any, count: int) -> Validation | None:
    """By the poses that a calibration held out; None if it fitted all of `count` rows."""
    if np.array_equal(found.held_out, found.rows):
        return None
    errors = np.full(count, np.nan)
    errors[found.held_out] = found.errors
    return Validation(errors, found.left_out)


def left_out_in_turn(
    found: Any, robot: Model, measured: Measured, policy: dict[str, Any]
) -> Validation | None:
    """By fits without each fifth of the poses in turn; None if the others are too few. found: of all poses."""
    from gantrytau_optimica import CalibrationError, calibrate

    errors = np.full(len(measured.data), np.nan)
    for fold in range(FOLDS):
        rows = found.rows[fold::FOLDS]
        if not rows.size:
            return None
        try:
            part = calibrate(robot, measured.data, **dict(policy, holdout=rows))
        except CalibrationError:
            return None
        errors[part.held_out] = part.errors
    return Validation(errors, found.left_out) if np.isfinite(errors).any() else None
