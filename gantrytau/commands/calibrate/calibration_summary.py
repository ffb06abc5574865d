"""What `gantrytau calibrate` prints of a calibration."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import typer

from gantrytau.commands.calibrate.calibration_files import PARAMETERS
from gantrytau.commands.calibrate.measurement_file import MeasurementFile
from gantrytau.commands.printing.reporting import print_table
from gantrytau_optimica import Calibration
from gantrytau_optimica.calibration import (
    About,
    CalibrationVerdict,
    CrossValidation,
    parameter_rows,
    report_numbers,
)
from gantrytau_optimica.procedure import MeasuredPlan


def about(
    found: Calibration,
    measured: MeasurementFile,
    robot: str,
    plan: MeasuredPlan | None,
    verdict: CalibrationVerdict | None,
    notes: Sequence[str],
    checked: CrossValidation | None,
) -> About:
    """What a report says besides the calibration. robot: its name; checked: fits without each part of the poses in turn."""
    rods = getattr(found, "nominal_rods", None)  # robots on three rods do not turn their plate
    turned = rods is None or rods.turns or measured.data.R is not None
    of_tool = turned or (plan is not None and np.any(plan.target))  # laid over the plan t holds the target
    target = "the target that was measured, in the place of the tool; t of a frame holds its offset"
    facts = {"measurements": str(measured.path), **(plan.facts if plan else {})}
    return About(
        robot=robot,
        facts=facts | {"x, y, z": "the tool" if of_tool else target},
        good=verdict.good if verdict else None,
        verdict=" ".join(verdict.reasons) if verdict else "",
        notes=list(notes),
        lines=measured.lines,
        numbers=measured.data.numbers,
        validation=checked.errors if checked and checked.good.size else None,
    )


def summary(found: Calibration, measured: MeasurementFile, about: About) -> dict[str, Any]:
    """The calibration as a record for programs: that of the report, with lines of the file in place of rows."""
    numbers = report_numbers(found, about)
    for name in ("covariance", "verdict", "poses"):  # the report holds them
        del numbers[name]
    numbers["left_out_lines"] = measured.lines[numbers.pop("left_out_rows")]
    numbers["findings"] = [
        {"kind": f.kind, "lines": measured.lines[f.rows], "message": f.message} for f in found.findings
    ]
    return {"measurements": measured.path, **numbers}


def judgement(verdict: CalibrationVerdict) -> dict[str, Any]:
    """A verdict as a record for programs."""
    words = " ".join(verdict.reasons)
    record: dict[str, Any] = {
        "good": verdict.good,
        "validation_error_m": verdict.validation_error,
        "expected_error_m": verdict.expected_error,
        "wanted_m": verdict.wanted,
        "verdict": words,
    }
    return record if verdict.good else {**record, "error": words}


def show(found: Calibration, measured: MeasurementFile, about: About, files: list[str]) -> None:
    """Verdict, error, findings and parameters, readable in a terminal."""
    if about.verdict:
        typer.echo(f"{'Good' if about.good else 'NOT GOOD ENOUGH'}: {about.verdict}")
    good = np.isfinite(found.errors) & ~np.isin(found.held_out, found.left_out)
    errors = found.errors[good] * 1e6
    kept = "of the fit itself" if np.array_equal(found.held_out, found.rows) else "not fitted"
    typer.echo(
        f"{found.robot_name}: {len(found.names)} numbers identified from {len(found.rows)} poses of "
        f"{measured.path.name}, in {found.iterations} steps"
    )
    typer.echo(
        f"Error: {errors.mean():.4g} um in the mean of {len(errors)} poses {kept}, "
        f"95 % below {np.quantile(errors, 0.95):.4g} um, {errors.max():.4g} um at most"
    )
    if np.isfinite(found.angle_error):
        typer.echo(f"Angle error: {np.degrees(found.angle_error) * 1e3:.4g} mdeg in the mean")
    typer.echo(f"Noise of {found.noise * 1e6:.4g} um in each measured coordinate explains what is left")
    _show_validation(found, about)
    for note in about.notes:
        typer.echo(note)
    _show_motion(found)
    if not found.findings:
        typer.echo("Nothing doubtful was found in the measurements")
    for finding in found.findings:
        typer.echo(f"{finding.kind}: {finding.message}")
    rows = [
        (
            row.name,
            "-" if row.value is None else f"{row.value:.7f}",
            _deviation(row.name, row.deviation),
            "-" if row.change is None else f"{row.change:+.6f}",
        )
        for row in parameter_rows(found)
    ]
    print_table(("parameter (m, rad)", "value", "deviation, 1e-6", "from nominal"), rows)
    if not any(file.endswith(PARAMETERS) for file in files):
        typer.echo(
            f"No {PARAMETERS}: {found.robot_name} has no parameters for what was identified; the numbers are in "
            "the report"
        )


def _show_validation(found: Calibration, about: About) -> None:
    """Where all poses were fitted, how well fits without them foretell them."""
    if about.validation is None:
        return
    errors = np.delete(about.validation, found.left_out)
    errors = errors[np.isfinite(errors)] * 1e6
    typer.echo(
        f"Each fifth left out in turn: {errors.mean():.4g} um in the mean, {errors.max():.4g} um at most"
    )


def _show_motion(found: Calibration) -> None:
    motion = found.motion
    if motion is None:
        return
    rows = "; ".join(" ".join(f"{x:+.7f}" for x in row) for row in motion.rotation)
    shift = ", ".join(f"{x:.6f}" for x in motion.translation)
    typer.echo("From the frame of the measurements to the base of the robot, base = R measured + t:")
    typer.echo(f"  R = [{rows}], t = ({shift}) m")


def _deviation(name: str, deviation: float | None) -> str:
    if deviation is None:
        return "held" if "orientation" not in name else "-"
    return f"{deviation * 1e6:.3g}" if np.isfinite(deviation) else "not known"
