"""`gantrytau fmu run`: an FMU, or a system of them, over time."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from gantrytau import SolveError
from gantrytau.border import listed
from gantrytau.commands.arguments.display_option import Displayed, displayed
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Inputs, Json, Plotted, Saved, To
from gantrytau.commands.arguments.values import pairs, signal
from gantrytau.commands.fmu.fmu_info import FmuFile, is_system, present
from gantrytau.commands.printing import picture_output, result_output
from gantrytau.commands.printing.reporting import CommandError, answered, noted, reporting
from gantrytau_fmu import Master, UnconnectedInputs, cosimulate, run_fmu

SHOWN = 24  # variables in the table; files and JSON have all


@serves(
    run_fmu,
    stop=typer.Option(help="Time at which to stop, in s.", show_default="that of the file"),
    step=typer.Option(
        help="Communication step, in s; of the outputs with --me.", show_default="that of the file"
    ),
    seed="Of signals that have none: the same numbers for the same seed.",
    tolerance="Handed to the FMUs, or to CVode.",
    model_exchange=typer.Option("--me", help="Integrate Model Exchange with CVode."),
    isolate=typer.Option("--isolate", help="Run each FMU in a process of its own: a crash is an error."),
)
def run(
    file: FmuFile,
    model_exchange: bool,
    isolate: bool,
    start: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Set a parameter or a start value, in a system robot.m=2.5. Repeatable.",
            show_default=False,
        ),
    ] = None,
    inputs: Inputs = None,
    order: Annotated[
        Literal["gauss-seidel", "jacobi", "iterate"] | None,
        typer.Option(help="Of a system.", show_default="gauss-seidel"),
    ] = None,
    output: Saved = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Run an FMU of any tool, or a system of FMUs, and print where its variables begin and end.

    Its binaries are code: trust them. Ctrl-C stops early; what was computed until then is saved to --output.
    """
    with reporting(json):
        present(file)
        _check(file, order, model_exchange, isolate)
        drawn, signals = listed(plot), dict(signal(text) for text in inputs or ())
        policy |= {"start": pairs("--set", start), "inputs": signals}
        result_output.rehearse(output)
        place, units = picture_output.place(drawn, to), displayed(display)
        told: list[str] = []
        try:
            with noted(UnconnectedInputs, told, json):
                if is_system(file):
                    master = Master(
                        order=order or "gauss-seidel", isolate=isolate, tolerance=policy.pop("tolerance")
                    )
                    result = cosimulate(file, master=master, **policy)
                else:
                    result = run_fmu(file, model_exchange=model_exchange, isolate=isolate, **policy)
        except SolveError as error:
            result_output.stop(error, output, json)
        files = result_output.save(result, output, units)
        if place:
            files += picture_output.draw(result, drawn, place, units)

        def show() -> None:
            result_output.print_ends(str(file), result, result.names[:SHOWN], "variable")
            if len(result.names) > SHOWN:
                typer.echo(f"and {len(result.names) - SHOWN} more; --output saves all")

        answered(json, {"file": file, **result_output.record(result), "warnings": told}, show, files)


def _check(file: Path, order: str | None, me: bool, isolate: bool) -> None:
    """CommandError for options that do not go together."""
    if me and is_system(file):
        raise CommandError("--me: a system is simulated by Co-Simulation; leave it out")
    if order is not None and not is_system(file):
        raise CommandError(f"--order {order}: found one FMU, expected a system (.ssp); leave it out")
    if me and isolate:
        raise CommandError(
            "--me --isolate: Model Exchange runs in this process, expected one of them; leave the other out"
        )
