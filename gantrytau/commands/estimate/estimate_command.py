"""`gantrytau estimate`: parameters of a model from measured data, how sure they are, what cannot be told apart."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

import gantrytau_optimica
from gantrytau import SolveError
from gantrytau.border import source_of
from gantrytau.commands.arguments.option import printing
from gantrytau.commands.arguments.options import Json, Picture, Quiet
from gantrytau.commands.estimate.estimate_file import EXAMPLE, POLICY, EstimateFile, read_estimate
from gantrytau.commands.estimate.estimated_values import own_names, set_values, values_text
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    INTERRUPTED,
    answered,
    busy,
    fail,
    reporting,
    writable_place,
    write_text,
)
from gantrytau_optimica import Estimate

MOST = 10  # parameters whose covariance is printed; --json has all
NAMES = {name: name for name in (*POLICY, "inputs")}


def estimate(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Model, parameters and data, as swing.toml; --example prints one.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Save the values (.toml), which --set of every command takes.",
            show_default=False,
        ),
    ] = None,
    plot: Picture = None,
    example: Annotated[
        bool,
        typer.Option(
            "--example", help="Print a file to begin with.", is_eager=True, callback=printing(EXAMPLE)
        ),
    ] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate parameters of a model from measured data, with deviations, covariance and what to doubt.

    What the data cannot tell apart is refused with its names. The last line has the values as options: --set L=0.9.
    """
    with reporting(json):
        writable_place("--output", output, ".toml")
        picture_output.rehearse(plot, "--plot")
        asked = read_estimate(file)
    with reporting(json, source_of(asked.text), NAMES):
        try:
            with busy(asked.chosen.name, quiet or json):
                found = gantrytau_optimica.estimate(
                    asked.chosen.model,
                    asked.parameters,
                    asked.experiments,
                    **asked.keywords,
                )
        except SolveError as error:
            if error.interrupted:
                fail("Interrupted; nothing was written", INTERRUPTED, json)
            raise
        values = set_values(asked, found)
        files = []
        if output is not None:
            write_text(values_text(asked, found, values), output)
            files.append(str(output))
        files += picture_output.shown(found.plot, plot)
        answered(json, {**_summary(asked, found), "set": values}, _report(found), files)
        if values and not json:
            options = (f"--set {shlex.quote(f'{name}={_text(value)}')}" for name, value in values.items())
            typer.echo(f"As options: {' '.join(options)}")


def _summary(asked: EstimateFile, found: Estimate) -> dict[str, Any]:
    """What was found as a record for programs; rows and columns of the covariance are `names`."""
    deviations, intervals = found.deviations, found.intervals(0.95)
    return {
        **asked.chosen.record("model"),
        "parameters": {
            name: {
                "value": value,
                "deviation": deviations.get(name),
                "interval": intervals.get(name),
                "at_limit": name in found.at_bounds,
            }
            for name, value in found.parameters.items()
        },
        "names": list(found.names),
        "covariance": found.covariance(),
        "values": found.errors.size,
        "chi_square": found.chi_square,
        "noise": found.noise,
        "residuals": {
            f"{experiment}, {name}": float((left**2).mean() ** 0.5)
            for (experiment, name), left in found.residuals.items()
        },
        "warnings": list(found.warnings),
        "own": own_names(asked, found),
    }


def _report(found: Estimate) -> str:
    """The report with the covariance of a few parameters."""
    if not 1 < len(found.names) <= MOST:
        return found.report()
    width = max(len(name) for name in found.names)
    rows = zip(found.names, found.covariance(), strict=True)
    lines = (f"  {name:<{width}}" + "".join(f" {number:>11.3g}" for number in row) for name, row in rows)
    return "\n".join([found.report(), "covariance:", *lines])


def _text(value: Any) -> str:
    return f"[{', '.join(map(_text, value))}]" if isinstance(value, list) else f"{value:.9g}"
