"""What `gantrytau calibrate` prints of a calibration."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import typer

from gantrytau.commands.calibrate import results
from gantrytau.commands.calibrate.measured import Measured


def summary(found: Any, measured: Measured, robot: str, files: list[str]) -> dict[str, Any]:
    """The calibration as a record for programs: that of the report, with lines of the file in place of rows."""
    from gantrytau_optimica.calibration.report import report_numbers

    numbers = report_numbers(found)
    numbers["robot"] = robot
    del numbers["covariance"]  # the report holds it
    numbers["findings"] = [
        {"kind": f.kind, "lines": measured.lines[f.rows].tolist(), "message": f.message}
        for f in found.findings
    ]
    return {"measurements": str(measured.file), **numbers, "files": files}


def show(
    found: Any, measured: Measured, files: list[str], notes: Sequence[str], verdict: Mapping[str, Any]
) -> None:
    """Verdict, error, findings and parameters, readable in a terminal."""
    if verdict:
        typer.echo(f"{'Good' if verdict['good'] else 'NOT GOOD ENOUGH'}: {verdict['verdict']}")
    errors = found.errors[np.isfinite(found.errors)] * 1e6
    kept = "of the fit itself" if np.array_equal(found.held_out, found.rows) else "not fitted"
    typer.echo(
        f"{found.geometry.name}: {len(found.names)} numbers identified from {len(found.rows)} poses of "
        f"{measured.file.name}, in {found.iterations} steps"
    )
    typer.echo(
        f"Error: {errors.mean():.4g} um in the mean of {len(found.held_out)} poses {kept}, "
        f"95 % below {np.quantile(errors, 0.95):.4g} um, {errors.max():.4g} um at most"
    )
    if np.isfinite(found.angle_error):
        typer.echo(f"Angle error: {np.degrees(found.angle_error) * 1e3:.4g} mdeg in the mean")
    typer.echo(f"Noise of {found.noise * 1e6:.4g} um in each measured coordinate explains what is left")
    for note in notes:
        typer.echo(note)
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


def _show_parameters(found: Any) -> None:
    """Each number with its deviation, and how far it is from the nominal one."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

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


def scalars(values: Any) -> dict[str, float]:
    """Numbers by name; of a vector `v` the elements `v[0]`, `v[1]` and so on."""
    found = {}
    for name, value in values.items():
        elements = [name] if np.ndim(value) == 0 else [f"{name}[{k}]" for k in range(len(value))]
        found |= dict(zip(elements, np.atleast_1d(value).tolist(), strict=True))
    return found


def nominal_values(found: Any) -> dict[str, float]:
    """The numbers that the robot had before."""
    from gantrytau import flatten
    from gantrytau.parameters import parameter_table

    return dict(parameter_table(flatten(found.geometry.robot)).values)
