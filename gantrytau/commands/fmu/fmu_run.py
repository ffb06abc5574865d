"""`gantrytau fmu run`: an FMU, or a system of them, over time."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import SolveError, did_you_mean
from gantrytau.border import listed
from gantrytau.commands.arguments.display_option import Displayed, displayed
from gantrytau.commands.arguments.options import Inputs, Json, Plotted, Saved, Seed, To
from gantrytau.commands.arguments.values import number, signal, split
from gantrytau.commands.fmu.fmu_info import is_system, present
from gantrytau.commands.printing import picture_output, result_output
from gantrytau.commands.printing.reporting import (
    CommandError,
    as_json,
    noted,
    reporting,
)
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Result

SPELLING = Spelling(
    ("cosimulate", "run_fmu", "Master"),
    {name: f"--{name}" for name in ("stop", "step", "order", "tolerance", "isolate", "seed")}
    | {"start": "--set", "inputs": "--input"},
    flags=("isolate",),
)
DEFAULT_ORDER = "gauss-seidel"
SHOWN = 24  # variables in the table; files and JSON have all


def run(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="An FMU, or a system of FMUs (.ssp).", show_default=False),
    ],
    stop: Annotated[
        float | None, typer.Option(help="Time at which to stop, in s.", show_default="that of the file")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            help="Communication step, in s; of the outputs with --me.", show_default="that of the file"
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Set a parameter or a start value, in a system robot.m=2.5. Repeatable.",
            show_default=False,
        ),
    ] = None,
    input_: Inputs = None,
    seed: Seed = None,
    order: Annotated[
        str | None,
        typer.Option(help="Of a system: gauss-seidel, jacobi or iterate.", show_default="gauss-seidel"),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Handed to the FMUs, or to CVode.", show_default=False)
    ] = None,
    me: Annotated[bool, typer.Option("--me", help="Integrate Model Exchange with CVode.")] = False,
    isolate: Annotated[
        bool, typer.Option("--isolate", help="Run each FMU in a process of its own: a crash is an error.")
    ] = False,
    output: Saved = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    json: Json = False,
) -> None:
    """Run an FMU of any tool, or a system of FMUs, and print where its variables begin and end.

    Its binaries are code: trust them. Ctrl-C stops early; what was computed until then is saved to --output.
    """
    from gantrytau_fmu import UnconnectedInputs

    with reporting(json, spelling=SPELLING):
        present(file)
        _check(file, order, me, isolate)
        drawn, signals = listed(plot), dict(signal(text) for text in input_ or ())
        start = dict(_setting(text) for text in set_ or ())
        result_output.rehearse(output)
        place, units = picture_output.place(drawn, to), displayed(display)
        policy: dict[str, Any] = dict(stop=stop, step=step, start=start, tolerance=tolerance)
        policy |= dict(inputs=signals, seed=seed)
        told: list[str] = []
        try:
            with noted(UnconnectedInputs, told, json, SPELLING):
                result = _result(file, policy, order=order or DEFAULT_ORDER, me=me, isolate=isolate)
        except SolveError as error:
            result_output.stop(error, SPELLING, output, json)
        files = result_output.save(result, output, units)
        if place:
            files += picture_output.draw(result, drawn, place, units)
        summary = {
            "file": str(file),
            "time": {"start": result.time[0], "stop": result.time[-1], "points": len(result.time)},
            "ended": result.ended,
            "final": {name: result.final(name) for name in result.names},
            "files": files,
            "warnings": told,
        }
        if json:
            typer.echo(as_json(summary))
        else:
            _show(summary, result)


def _check(file: Path, order: str | None, me: bool, isolate: bool) -> None:
    """CommandError for options that do not go together."""
    from gantrytau_fmu import ORDERS

    if order is not None and order not in ORDERS:
        near = did_you_mean(order, ORDERS)
        raise CommandError(
            f"--order {order}: expected {', '.join(ORDERS[:-1])} or {ORDERS[-1]}{near if 'did you' in near else ''}"
        )
    if is_system(file):
        if me:
            raise CommandError("--me: a system is simulated by Co-Simulation; leave it out")
        return
    if order is not None:
        raise CommandError(f"--order {order}: found one FMU, expected a system (.ssp); leave it out")
    if me and isolate:
        raise CommandError(
            "--me --isolate: Model Exchange runs in this process, expected one of them; leave the other out"
        )


def _setting(text: str) -> tuple[str, Any]:
    name, value = split("--set", text)
    return name, number("--set", name, value)


def _result(file: Path, policy: Mapping[str, Any], *, order: str, me: bool, isolate: bool) -> "Result":
    if not is_system(file):
        from gantrytau_fmu import run_fmu

        return run_fmu(file, model_exchange=me, isolate=isolate, **policy)
    from gantrytau_fmu import Master, cosimulate

    chosen: Any = order
    master = Master(order=chosen, isolate=isolate, tolerance=policy["tolerance"])
    return cosimulate(file, master=master, **{name: policy[name] for name in policy if name != "tolerance"})


def _show(summary: Mapping[str, Any], result: "Result") -> None:
    """The first variables at both ends as a table; texts of the file are no markup."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    time = summary["time"]
    typer.echo(
        f"{summary['file']}: {time['start']:g} s to {time['stop']:g} s, {time['points']} points, "
        f"{len(result.names)} variable{'' if len(result.names) == 1 else 's'}"
    )
    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("variable", no_wrap=True)
    for heading in ("start", "end", "least", "greatest"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit")
    for name in result.names[:SHOWN]:
        values = result[name]
        numbers = (values[0], values[-1], values.min(), values.max())
        table.add_row(Text(name), *(f"{number:.6g}" for number in numbers), Text(result.unit(name)))
    if result.names:
        Console().print(table)
    if len(result.names) > SHOWN:
        typer.echo(f"and {len(result.names) - SHOWN} more; --output saves all")
    if summary["ended"] != "stop":
        typer.echo(f"Ended before its stop time: {summary['ended']}")
    for file in summary["files"]:
        typer.echo(f"Written: {file}")
