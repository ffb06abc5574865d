"""The end of a calibration: parameters found, compared with what was wanted, written and told."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from gantrytau.commands.calibrate import results, wording
from gantrytau.commands.calibrate.measured import Measured, calibrated
from gantrytau.commands.calibrate.planned import Planned
from gantrytau.commands.reporting import FAULT, as_json, note
from gantrytau.model import Model

FOLDS = 5


@dataclass(frozen=True)
class Choice:
    """The robot with its nominal values, its name on the command line, and the plan by which it is measured, or None."""

    robot: Model
    name: str
    planned: Planned | None


def finish(
    choice: Choice, measured: Measured, policy: dict[str, Any], folder: Path, *, validate: bool, json: bool
) -> None:
    """Calibrate, write and print; leaves with exit code 1 where the error is larger than wanted.

    validate: for a plan, which asks for few poses, fit all of them, and judge by fits without each fifth of them in turn.
    """
    planned, rest, told = choice.planned, {}, []
    if planned is not None:
        measured, words = planned.placed(measured)
        told += [f"frame: {words}"] if words else []
        missing = planned.missing(measured)
        if missing:
            rest = {"missing": missing, "program": str(planned.write_rest(measured))}
            told.append(_missing(missing, rest["program"]))
            if not json:
                note(told.pop())  # also when the rest does not suffice
    found, error, validated = _found(choice, measured, policy, validate and planned is not None, json)
    written = results.write(found, folder, choice.name, measured.file)
    verdict = {} if planned is None else _verdict(float(error), validated, planned)
    if json:
        numbers = wording.summary(found, measured, choice.name, written)
        typer.echo(as_json({**numbers, **rest, **verdict, "notes": told}))
    else:
        wording.show(found, measured, written, told, verdict)
    if verdict and not verdict["good"]:
        raise typer.Exit(FAULT)


def _found(
    choice: Choice, measured: Measured, policy: dict[str, Any], cross: bool, json: bool
) -> tuple[Any, float, bool]:
    """The calibration, its error, and whether that is of poses that were not fitted, if there are enough of them."""
    if not cross:
        found = calibrated(choice.robot, measured, policy, json)
        return found, found.error, policy["holdout"] is not None
    found = calibrated(choice.robot, measured, dict(policy, holdout=None), json)
    error = cross_validated(choice.robot, measured, policy)
    return (found, found.error, False) if error is None else (found, error, True)


def cross_validated(robot: Model, measured: Measured, policy: dict[str, Any]) -> float | None:
    """Mean error of poses foretold by fits without them, each fifth left out in turn, m; None if there are too few."""
    from gantrytau_optimica import CalibrationError, calibrate

    errors = []
    for fold in range(FOLDS):
        rows = np.arange(fold, len(measured.data), FOLDS)
        try:
            errors.append(calibrate(robot, measured.data, **dict(policy, holdout=rows)).errors)
        except CalibrationError:
            return None
    found = np.concatenate(errors)
    return float(found[np.isfinite(found)].mean())


def _missing(numbers: list[int], program: str) -> str:
    shown = ", ".join(map(str, numbers[:12])) + (", ..." if len(numbers) > 12 else "")
    one = "A planned pose is not measured, number"
    which = one if len(numbers) == 1 else f"{len(numbers)} planned poses are not measured, numbers"
    return (
        f"{which} {shown} of poses.csv; the program of what is missing is {program}: measure, add the lines, and give the "
        "same command again"
    )


def _verdict(error: float, validated: bool, planned: Planned) -> dict[str, Any]:
    """Whether the error is as small as wanted; validated: whether it is of poses that were not fitted."""
    wanted = planned.cell.wanted
    good = bool(error <= wanted)
    which = "poses that were not fitted" if validated else "the fitted poses, as none were left to validate"
    words = f"{error * 1e6:.4g} um in the mean of {which}, {wanted * 1e6:.4g} um were wanted"
    if not good:
        words += "; look at the findings, measure the poses that are missing, or plan again with more of them"
    found: dict[str, Any] = {
        "good": good,
        "validation_error_m": error if validated else None,
        "wanted_m": wanted,
        "verdict": words,
    }
    return found if good else {**found, "error": words}
