"""`gantrytau simulate`: a model over time, its result as figures, files and picture_output."""

from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

import gantrytau
from gantrytau import DoubtfulResult, SolveError
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.display_option import Displayed, check_display, displayed, of_table
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.options import (
    Inputs,
    Json,
    Kept,
    ModelName,
    Plotted,
    PrototypeName,
    Saved,
    Seed,
    Settings,
    To,
)
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.arguments.values import check_names, signal
from gantrytau.commands.printing import picture_output, result_output
from gantrytau.commands.printing.reporting import as_json, busy, noted, reporting
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Dae, Result

WORDS = {
    name: [str(word).lower() for word in get_args(gantrytau.simulate.__annotations__[name])]
    for name in ("limits", "singular")
}
SPELLING = Spelling(
    ("simulate", "inputs"),
    {name: f"--{name}" for name in ("stop", "start", "tolerance", "points", "outputs", "seed", *WORDS)}
    | {"inputs": "--input", "parameters": "--set", "max_step": "--max-step"},
    exactly={"or None": "or none", "simulate(..., singular='cross')": "--singular cross"},
)


def _one_of(name: str, says: str) -> Any:
    return typer.Option(metavar="|".join(WORDS[name]), autocompletion=words(*WORDS[name]), help=says)


FEW = 12  # variables that are shown where no state was kept


def simulate(
    model: ModelName,
    stop: Annotated[float, typer.Option(help="Time at which to stop, in s.", show_default=False)],
    start: Annotated[float, typer.Option(help="Time at which to start, in s.")] = 0.0,
    tolerance: Annotated[
        float, typer.Option(help="Error, relative to values and to what is nominal.")
    ] = 1e-8,
    points: Annotated[int, typer.Option(help="Number of output times.")] = 501,
    max_step: Annotated[
        float | None, typer.Option(help="Longest step, in s, for pulses shorter than a 10,000th of the run.")
    ] = None,
    limits: Annotated[
        str, _one_of("limits", "Past a min or max: tell it, end there, or do not look.")
    ] = "warn",
    singular: Annotated[
        str, _one_of("singular", "At a singular pose: stop, or cross it if smooth.")
    ] = "stop",
    input_: Inputs = None,
    seed: Seed = None,
    outputs: Kept = None,
    output: Saved = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Simulate a model from its start values, and print where its states begin and end.

    Ctrl-C stops early; what was computed until then is saved to --output.
    """
    with reporting(json, source_of(model), SPELLING):
        drawn, signals = listed(plot), dict(signal(text) for text in input_ or ())
        kept, units = listed(outputs), displayed(display)
        result_output.rehearse(output)
        place = picture_output.place(drawn, to)
        chosen = build(model, prototype, set_ or ())
        dae = _translated(chosen, drawn, kept, signals)
        check_display(units, dae.flat, drawn)
        policy = dict(
            stop=stop, start=start, tolerance=tolerance, points=points, max_step=max_step, seed=seed
        )
        policy |= dict(limits=None if limits == "none" else limits, singular=singular)
        told: list[str] = []
        try:
            with noted(DoubtfulResult, told, json, SPELLING):
                result = _simulated(dae, signals, outputs=(*kept, *drawn) if kept else None, **policy)
        except SolveError as error:
            result_output.stop(error, SPELLING, output, json)
        files = result_output.save(result, output, units)
        if place:
            files += picture_output.draw(result, drawn, place, units)
        summary = {**_summary(chosen, dae, result, files), "warnings": told}
        if json:
            typer.echo(as_json(summary))
        else:
            _show(summary, dae, result, units)


def _translated(
    chosen: Chosen, drawn: tuple[str, ...], kept: tuple[str, ...], signals: dict[str, Any]
) -> "Dae":
    """The model with the derivatives that are to be drawn; CommandError for a name that it does not have."""
    from gantrytau import flatten, translate

    with busy(f"translating {chosen.name}"):
        flat = flatten(chosen.model)
        for option, names in (("--plot", drawn), ("--outputs", kept), ("--input", signals)):
            check_names(option, (n for n in names if n not in flat.friction_modes), flat.expand)
        find = [name for name in (*drawn, *kept) if name.startswith("der(")]
        return translate(chosen.model, find=find, events=True)


def _simulated(dae: "Dae", signals: dict[str, Any], **policy: Any) -> "Result":
    return gantrytau.simulate(dae, inputs=signals, **policy)


def _summary(chosen: Chosen, dae: "Dae", result: "Result", files: list[str]) -> dict[str, Any]:
    return {
        "model": chosen.name,
        "prototype": chosen.prototype,
        "time": {"start": result.time[0], "stop": result.time[-1], "points": len(result.time)},
        "ended": result.ended,
        "states": dae.states,
        "final": {name: result.final(name) for name in result.names},
        "files": files,
    }


def _show(summary: dict[str, Any], dae: "Dae", result: "Result", units: Any) -> None:
    """The states at both ends, or a few of the outputs, as a table; texts of the model are no markup."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    time = summary["time"]
    typer.echo(
        f"{summary['model']}: {time['start']:g} s to {time['stop']:g} s, {time['points']} points, "
        f"{len(result.names)} variable{'' if len(result.names) == 1 else 's'}"
        + ("" if result.ended == "stop" else f", ended: {result.ended}")
    )
    states = [name for name in dae.states if name in result]
    shown = states or [name for name in result.names if name not in dae.parameter_values][:FEW]
    if shown:
        table = Table(box=SIMPLE, pad_edge=False)
        table.add_column("state" if states else "variable", no_wrap=True)
        for heading in ("start", "end", "least", "greatest"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("unit")
        for name, (values, unit) in of_table(result, shown, units).items():
            numbers = (values[0], values[-1], values.min(), values.max())
            table.add_row(Text(name), *(f"{number:.6g}" for number in numbers), Text(unit))
        Console().print(table)
    for file in summary["files"]:
        typer.echo(f"Written: {file}")
