"""`gantrytau estimate`: parameters of a model from measured data, how sure they are, what cannot be told apart."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from gantrytau import SolveError
from gantrytau.border import source_of
from gantrytau.commands.arguments.options import Json, Picture
from gantrytau.commands.estimate.estimate_file import EXAMPLE, EstimateFile, read_estimate
from gantrytau.commands.estimate.estimated_values import own_names, set_values, values_text
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    INTERRUPTED,
    CommandError,
    as_json,
    fail,
    reporting,
    writable_place,
    write_text,
)
from gantrytau.commands.printing.solver_line import live
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau_optimica import Estimate

MOST = 10  # parameters whose covariance is printed; --json has all
KEYS = ("loss", "elements", "points", "scheme", "tolerance", "max_iterations", "max_time")
SPELLING = Spelling(
    ("estimate", "Experiment", "Samples"),
    {name: name for name in KEYS} | {"inputs": "inputs"},
    exactly={
        "in Experiment(inputs={": "in [[experiment]]: inputs = {",
        ": ...})": " = ... }",
        "expected {name: Free(guess)} in parameters or in start": "expected some under [estimate], or a start with a guess",
        "or give Samples(..., deviation=...)": "or give deviation = ...",
        "give Samples(..., deviation=...) everywhere": "give deviation = ... everywhere",
        "Experiment(start={name: number or Free(guess)})": "start = { name = number, or { guess = ... } }",
        "numbers or Free(...)": "numbers, or { guess = ... }",
        "What was reached so far is in .optimum.": "",
        "look at .optimum": "look at the data",
    },
)


def estimate(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Model, parameters and data, as swing.toml; --example prints one.",
            show_default=False,
        ),
    ] = None,
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
    example: Annotated[bool, typer.Option("--example", help="Print a file to begin with.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    json: Json = False,
) -> None:
    """Estimate parameters of a model from measured data, with deviations, covariance and what to doubt.

    What the data cannot tell apart is refused with its names. The last line has the values as options: --set L=0.9.
    """
    if example:
        typer.echo(EXAMPLE, nl=False)
        return
    with reporting(json, None, SPELLING):
        if file is None:
            raise CommandError(
                "found no FILE, expected a model and its data: gantrytau estimate --example > swing.toml"
            )
        writable_place("--output", output, ".toml")
        if plot is not None:
            picture_output.rehearse(plot, "--plot")
        asked = read_estimate(file)
    with reporting(json, source_of(asked.text), SPELLING):
        try:
            with live(asked.chosen.name, quiet or json) as progress:
                found = _estimated(asked, progress)
        except SolveError as error:
            _leave(error, json)
        values = set_values(asked, found)
        files = []
        if output is not None:
            write_text(values_text(asked, found, values), output)
            files.append(str(output))
        if plot is not None:
            files += picture_output.shown(lambda place: found.plot(file=place), plot)
        if json:
            typer.echo(as_json({**_summary(asked, found), "set": values, "files": files}))
        else:
            _show(found, values, files)


def _estimated(asked: EstimateFile, progress: Any) -> "Estimate":
    import gantrytau_optimica

    return gantrytau_optimica.estimate(
        asked.chosen.model,
        asked.parameters,
        asked.experiments,
        progress=progress,
        **asked.keywords,
    )


def _leave(error: SolveError, json: bool) -> NoReturn:
    """Say why there is no estimate."""
    if error.interrupted:
        fail("Interrupted; nothing was written", INTERRUPTED, json)
    raise error


def _summary(asked: EstimateFile, found: "Estimate") -> dict[str, Any]:
    """What was found as a record for programs; rows and columns of the covariance are `names`."""
    deviations, intervals = found.deviations, found.intervals(0.95)
    return {
        "model": asked.chosen.name,
        "prototype": asked.chosen.prototype,
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
        "covariance": found.covariance().tolist(),
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


def _show(found: "Estimate", values: dict[str, Any], files: list[str]) -> None:
    typer.echo(found.report())
    if 1 < len(found.names) <= MOST:
        width = max(len(name) for name in found.names)
        typer.echo("covariance:")
        for name, row in zip(found.names, found.covariance(), strict=True):
            typer.echo(f"  {name:<{width}}" + "".join(f" {number:>11.3g}" for number in row))
    for file in files:
        typer.echo(f"Written: {file}")
    options = (f"--set {shlex.quote(f'{name}={_text(value)}')}" for name, value in values.items())
    if values:
        typer.echo(f"As options: {' '.join(options)}")


def _text(value: Any) -> str:
    return f"[{', '.join(map(_text, value))}]" if isinstance(value, list) else f"{value:.9g}"
