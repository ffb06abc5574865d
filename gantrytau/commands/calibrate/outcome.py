"""The end of a calibration: parameters found, compared with what was wanted, written and told."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from gantrytau import Model, ModelError
from gantrytau.commands.calibrate import calibration_files, calibration_summary
from gantrytau.commands.calibrate.measurement_file import MeasurementFile, calibrated
from gantrytau.commands.printing.reporting import FAULT, answered, note, writable
from gantrytau.commands.printing.spelling import worded
from gantrytau_optimica.calibration import told_by_tool
from gantrytau_optimica.procedure import MeasuredPlan, PlannedCell, measured_plan

FEW = 60  # poses, fewer than which are all fitted, and left out in turn
LAID_OVER = (
    "frame: positions are in another frame than the plan; they were laid over the poses that it expects"
)

TARGET = "target: positions in the base of the robot are those of {}"


@dataclass(frozen=True, eq=False)
class NominalRobot:
    """The robot with its nominal values, its name on the command line, and the plan by which it is measured, or None."""

    model: Model
    name: str
    planned: PlannedCell | None


def finish(
    robot: NominalRobot,
    measured: MeasurementFile,
    policy: dict[str, Any],
    folder: Path,
    *,
    validate: bool,
    json: bool,
) -> None:
    """Calibrate, write and print; leaves with exit code 1 where the error is larger than wanted.

    validate: fit all of few poses, as a plan asks for, and judge by fits without each fifth of them in turn.
    """
    plan, notes = _laid_over(robot.planned, measured, policy["frame"]), []
    policy = dict(policy, frame=policy["frame"] or "fitted")
    if plan is not None:
        measured = replace(measured, data=plan.measurements)
        policy, notes = _as_planned(plan, policy)
        if plan.missing and not json:
            note(_missing(plan.missing, str(plan.rest_program)))  # also when the others do not suffice
    cross = validate and (plan is not None or len(measured.data) < FEW)
    try:
        checked = calibrated(robot.model, measured, policy, cross=cross, json=json)
    except typer.Exit:
        if plan is not None and measured.data.finite.any():
            _write_rest(plan, first=True)
        raise
    if plan is None:
        found, verdict = told_by_tool(checked.calibration), None
    else:
        found, verdict = plan.judged(checked, policy["orientation"])
        verdict = replace(verdict, reasons=tuple(map(worded, verdict.reasons)))
        _write_rest(plan)
    about = calibration_summary.about(
        found, measured, robot.name, plan, verdict, notes, checked if cross else None
    )
    files = calibration_files.write(found, folder, robot.name, measured.path, about)
    record = {**calibration_summary.summary(found, measured, about), "notes": notes}
    if plan is not None and verdict is not None:
        missing = {"missing": plan.missing, "program": plan.rest_program} if plan.missing else {}
        record |= missing | calibration_summary.judgement(verdict)
    answered(json, record, lambda: calibration_summary.show(found, measured, about, files), files)
    if verdict is not None and not verdict.good:
        raise typer.Exit(FAULT)


def _laid_over(planned: PlannedCell | None, measured: MeasurementFile, frame: Any) -> MeasuredPlan | None:
    """The measurements as those of the plan; its complaints with the file."""
    if planned is None:
        return None
    try:
        return measured_plan(planned, measured.data, frame)
    except ModelError as error:
        raise ModelError(*error.parts, ". Nothing was written", place=str(measured.path)) from error


def _as_planned(plan: MeasuredPlan, policy: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Keywords of `calibrate` with the prior of the plan's own simulations, unless another was given; words on it."""
    notes = [] if plan.motion is None else [LAID_OVER]
    policy, off = dict(policy, frame=plan.frame), f"{np.linalg.norm(plan.target) * 1e3:.4g} mm"
    if plan.taken_off:
        notes = [TARGET.format(f"the target, {off} from the tool, which were taken off")]
    elif np.any(plan.target):
        notes = [TARGET.format(f"the tool itself, not of the target {off} from it")]
    if policy["prior"] is not None or not plan.prior or policy["model"] is not None:
        return policy, notes
    told = ", ".join(f"{name}={value:g}" for name, value in plan.prior.items())
    return dict(policy, prior=plan.prior), [*notes, f"prior: {told}, as the plan expects"]


def _write_rest(plan: MeasuredPlan, *, first: bool = False) -> None:
    """Write the program of what is missing; first: only if there is none yet, as what was measured could not be used."""
    if not plan.missing:
        return
    if first and plan.rest_program.exists():
        note(f"{plan.rest_program} is still that of an earlier run")
        return
    with writable(plan.rest_program.parent / plan.rest_program.name):
        plan.write_rest()


def _missing(numbers: list[int], program: str) -> str:
    shown = ", ".join(map(str, numbers[:12])) + (", ..." if len(numbers) > 12 else "")
    one = "A planned pose is not measured, number"
    which = one if len(numbers) == 1 else f"{len(numbers)} planned poses are not measured, numbers"
    return (
        f"{which} {shown} of poses.csv; the program of what is missing is {program}: measure, add the lines, and give the "
        "same command again"
    )
