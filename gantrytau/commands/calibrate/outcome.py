"""The end of a calibration: parameters found, compared with what was wanted, written and told."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from gantrytau import Model
from gantrytau.commands.calibrate import calibration_files as results
from gantrytau.commands.calibrate import calibration_summary as wording
from gantrytau.commands.calibrate import calibration_verdict as verdict
from gantrytau.commands.calibrate import cross_validation as validation
from gantrytau.commands.calibrate.cross_validation import Validation
from gantrytau.commands.calibrate.measured_plan import Planned
from gantrytau.commands.calibrate.measurement_file import Measured, calibrated
from gantrytau.commands.printing.reporting import FAULT, as_json, note


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

    validate: fit all of few poses, as a plan asks for, and judge by fits without each fifth of them in turn.
    """
    planned, motion, notes = choice.planned, None, []
    if planned is not None:
        measured = planned.seen(measured)
        original = measured
        measured, motion = planned.placed(measured)
        if motion is not None:
            notes.append(wording.LAID_OVER)
        policy, words = planned.with_prior(policy)
        notes += words
        rest = _rest(planned, measured, json)
    else:
        original, rest = measured, None
    cross = validate and (planned is not None or len(measured.data) < validation.FEW)
    try:
        found, checked = _found(choice, measured, policy, cross, json)
    except typer.Exit:
        if rest is not None and original.data.finite.any():
            rest.write_first()
        raise
    expected = None if planned is None else planned.tool_error(measured, found, policy["orientation"])
    found = verdict.with_expectation(found, planned, expected)
    judged = {} if planned is None else verdict.verdict(found, checked, expected, planned)
    if rest is not None:
        rest.write()
    about = wording.about(found, measured, choice, judged, notes, checked, motion)
    written = results.write(found, folder, choice.name, measured.file, about)
    if json:
        numbers = wording.summary(found, measured, about, written)
        typer.echo(as_json({**numbers, **(rest.record if rest else {}), **judged, "notes": notes}))
    else:
        wording.show(found, measured, about, written, judged)
    if judged and not judged["good"]:
        raise typer.Exit(FAULT)


@dataclass
class Rest:
    """The poses of a plan that are missing; their program is written when what was measured turns out to be good data."""

    planned: Planned
    measured: Measured
    missing: list[int]

    @property
    def record(self) -> dict[str, Any]:
        """For programs."""
        return {"missing": self.missing, "program": str(self.planned.rest_program)}

    def write(self) -> None:
        """Write plan and program of what is missing."""
        self.planned.write_rest(self.measured)

    def write_first(self) -> None:
        """The same if there is none yet: what was measured could not be used."""
        if self.planned.rest_program.exists():
            note(f"{self.planned.rest_program} is still that of an earlier run")
        else:
            self.write()


def _rest(planned: Planned, measured: Measured, json: bool) -> Rest | None:
    missing = planned.missing(measured)
    if not missing:
        return None
    rest = Rest(planned, measured, missing)
    if not json:
        note(_missing(missing, str(planned.rest_program)))  # also when the others do not suffice
    return rest


def _found(
    choice: Choice, measured: Measured, policy: dict[str, Any], cross: bool, json: bool
) -> tuple[Any, Validation | None]:
    """The calibration, and how well it foretells poses that were not fitted, if there are enough of them."""
    if not cross:
        found = calibrated(choice.robot, measured, policy, json)
        return found, validation.held_out(found, len(measured.data))
    found = calibrated(choice.robot, measured, dict(policy, holdout=None), json)
    return found, validation.left_out_in_turn(found, choice.robot, measured, policy)


def _missing(numbers: list[int], program: str) -> str:
    shown = ", ".join(map(str, numbers[:12])) + (", ..." if len(numbers) > 12 else "")
    one = "A planned pose is not measured, number"
    which = one if len(numbers) == 1 else f"{len(numbers)} planned poses are not measured, numbers"
    return (
        f"{which} {shown} of poses.csv; the program of what is missing is {program}: measure, add the lines, and give the "
        "same command again"
    )
