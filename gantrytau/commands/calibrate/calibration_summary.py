"""What `gantrytau calibrate` prints of a calibration."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import typer

from gantrytau.commands.calibrate import calibration_files as results
from gantrytau.commands.calibrate.measurement_file import Measured

LAID_OVER = (
    "frame: positions are in another frame than the plan; they were laid over the poses that it expects"
)


def about(
    found: Any,
    measured: Measured,
    choice: Any,
    verdict: Mapping[str, Any],
    notes: Sequence[str],
    validation: Any,
    motion: Any,
) -> Any:
    """What a report says besides the calibration. choice: of the robot, with its plan or None; motion: into its frame."""
    from gantrytau_optimica.calibration.report.report import About, fits_all, frame_motion

    facts = {"measurements": str(measured.file)}
    if choice.planned is not None:
        cell, plan = choice.planned.cell, choice.planned.plan
        place = ", ".join(f"{x:.4g}" for x in np.asarray(plan.settings["device_r"], dtype=float))
        facts |= {
            "goal": f"{cell.wanted * 1e6:.4g} um, error of the tool in the mean over the workspace",
            "device": f"{plan.settings['device']} at ({place}) m",
            "nominal values": f"known by a tape measure to {cell.tape * 1e3:.3g} mm",
            "plan": str(choice.planned.folder),
        }
    turned = found.geometry.kind != "three" or measured.data.R is not None
    facts["x, y, z"] = (
        "the tool"
        if turned
        else "the target that was measured, in the place of the tool; t of a frame holds its offset"
    )
    return About(
        robot=choice.name,
        facts=facts,
        good=verdict.get("good"),
        verdict=verdict.get("verdict", ""),
        notes=list(notes),
        lines=measured.lines,
        numbers=measured.data.numbers,
        validation=None if validation is None or not fits_all(found) else validation.errors,
        motion=motion or frame_motion(found),
    )


def summary(found: Any, measured: Measured, about: Any, files: list[str]) -> dict[str, Any]:
    """The calibration as a record for programs: that of the report, with lines of the file in place of rows."""
    from gantrytau_optimica.calibration.report.report import report_numbers

    numbers = report_numbers(found, about)
    for name in ("covariance", "verdict", "poses"):  # the report holds them
        del numbers[name]
    numbers["left_out_lines"] = measured.lines[numbers.pop("left_out_rows")].tolist()
    numbers["findings"] = [
        {"kind": f.kind, "lines": measured.lines[f.rows].tolist(), "message": f.message}
        for f in found.findings
    ]
    return {"measurements": str(measured.file), **numbers, "files": files}


def show(found: Any, measured: Measured, about: Any, files: list[str], verdict: Mapping[str, Any]) -> None:
    """Verdict, error, findings and parameters, readable in a terminal."""
    if verdict:
        typer.echo(f"{'Good' if verdict['good'] else 'NOT GOOD ENOUGH'}: {verdict['verdict']}")
    good = np.isfinite(found.errors) & ~np.isin(found.held_out, found.left_out)
    errors = found.errors[good] * 1e6
    kept = "of the fit itself" if np.array_equal(found.held_out, found.rows) else "not fitted"
    typer.echo(
        f"{found.geometry.name}: {len(found.names)} numbers identified from {len(found.rows)} poses of "
        f"{measured.file.name}, in {found.iterations} steps"
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
    _show_motion(about.motion)
    if not found.findings:
        typer.echo("Nothing doubtful was found in the measurements")
    for finding in found.findings:
        typer.echo(f"{finding.kind}: {finding.message}")
    _show_parameters(found)
    for file in files:
        typer.echo(f"Written: {file}")
    if not any(file.endswith(results.PARAMETERS) for file in files):
        typer.echo(
            f"No {results.PARAMETERS}: {found.geometry.name} has no parameters for what was identified; the numbers are in "
            "the report"
        )


def _show_validation(found: Any, about: Any) -> None:
    """Where all poses were fitted, how well fits without them foretell them."""
    if about.validation is None:
        return
    errors = np.delete(about.validation, found.left_out)
    errors = errors[np.isfinite(errors)] * 1e6
    typer.echo(
        f"Each fifth left out in turn: {errors.mean():.4g} um in the mean, {errors.max():.4g} um at most"
    )


def _show_motion(motion: Any) -> None:
    if motion is None:
        return
    rows = "; ".join(" ".join(f"{x:+.7f}" for x in row) for row in motion.rotation)
    shift = ", ".join(f"{x:.6f}" for x in motion.translation)
    typer.echo("From the frame of the measurements to the base of the robot, base = R measured + t:")
    typer.echo(f"  R = [{rows}], t = ({shift}) m")


def _show_parameters(found: Any) -> None:
    """Each number with its deviation, and how far it is from the nominal one."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from gantrytau_optimica.calibration.report.report import nominal_values, scalars

    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("parameter (m, rad)", no_wrap=True)
    for heading in ("value", "deviation, 1e-6", "from nominal"):
        table.add_column(heading, justify="right", no_wrap=True)
    nominal, deviations = nominal_values(found), found.deviations
    values = scalars(found.parameters)
    for name, value in values.items():
        change = f"{value - nominal[name]:+.6f}" if name in nominal else "-"
        table.add_row(Text(name), f"{value:.7f}", _deviation(name, deviations), change)
    for name in deviations:  # rotations of a turntable, by which its orientation is free
        if name not in values and not name.startswith("direction"):
            table.add_row(Text(name), "-", _deviation(name, deviations), "-")
    Console().print(table)


def _deviation(name: str, deviations: dict[str, float]) -> str:
    if name not in deviations:  # "direction" is common to all arms
        name = name[name.index("direction") :] if "direction" in name else name
    if name not in deviations:
        return "held" if "orientation" not in name else "-"
    value = deviations[name]
    return f"{value * 1e6:.3g}" if np.isfinite(value) else "not known"
