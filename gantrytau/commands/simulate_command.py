"""`gantrytau simulate`: a model over time, its result as figures, files and pictures."""

from dataclasses import asdict
from typing import Annotated, Any

import typer

import gantrytau
from gantrytau import Dae, DoubtfulResult, SolveError, flatten, translate
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.display_option import Displayed, check_display, displayed
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import (
    Inputs,
    Json,
    Kept,
    ModelName,
    Plotted,
    PrototypeName,
    Saved,
    Settings,
    To,
)
from gantrytau.commands.arguments.values import check_names, signal
from gantrytau.commands.printing import picture_output, result_output
from gantrytau.commands.printing.reporting import answered, busy, noted, reporting

FEW = 12  # variables that are shown where no state was kept


@serves(
    gantrytau.simulate,
    stop="Time at which to stop, in s.",
    start="Time at which to start, in s.",
    tolerance="Error, relative to values and to what is nominal.",
    points="Number of output times.",
    max_step="Longest step, in s, for pulses shorter than a 10,000th of the run.",
    limits="Past a min or max: tell it, end there, or do not look.",
    singular="At a singular pose: stop, or cross it if smooth.",
    seed="Of signals that have none: the same numbers for the same seed.",
)
def simulate(
    model: ModelName,
    inputs: Inputs = None,
    outputs: Kept = None,
    output: Saved = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    statistics: Annotated[
        bool,
        typer.Option(
            "--statistics", help="Also print steps, events by condition, seconds, and what limits the step."
        ),
    ] = False,
    json: Json = False,
    **policy: Any,
) -> None:
    """Simulate a model from its start values, and print where its states begin and end.

    Ctrl-C stops early; what was computed until then is saved to --output.
    """
    with reporting(json, source_of(model), {"parameters": "--set"}):
        drawn, signals = listed(plot), dict(signal(text) for text in inputs or ())
        kept, units = listed(outputs), displayed(display)
        result_output.rehearse(output)
        place = picture_output.place(drawn, to)
        chosen = build(model, prototype, set_ or ())
        dae = _translated(chosen, drawn, kept, signals)
        check_display(units, dae.flat, drawn)
        told: list[str] = []
        try:
            with noted(DoubtfulResult, told, json):
                named = (*kept, *drawn) if kept else None
                result = gantrytau.simulate(dae, inputs=signals, outputs=named, **policy)
        except SolveError as error:
            result_output.stop(error, output, json)
        files = result_output.save(result, output, units)
        if place:
            files += picture_output.draw(result, drawn, place, units)
        record = {**chosen.record("model"), "states": dae.states, "warnings": told}
        states = [name for name in dae.states if name in result]
        shown = states or [name for name in result.names if name not in dae.parameter_values][:FEW]
        heading = "state" if states else "variable"
        work = result.statistics
        record |= result_output.record(result) | {"statistics": asdict(work)}

        def told_ends() -> None:
            result_output.print_ends(chosen.name, result, shown, heading, units)
            if statistics:
                typer.echo(f"\n{work}")

        answered(json, record, told_ends, files)


def _translated(
    chosen: Chosen, drawn: tuple[str, ...], kept: tuple[str, ...], signals: dict[str, Any]
) -> Dae:
    """The model with the derivatives that are to be drawn; CommandError for a name that it does not have."""
    with busy(f"translating {chosen.name}"):
        flat = flatten(chosen.model)
        for option, names in (("--plot", drawn), ("--outputs", kept), ("--input", signals)):
            check_names(option, (n for n in names if n not in flat.friction_modes), flat.expand)
        find = [name for name in (*drawn, *kept) if name.startswith("der(")]
        return translate(flat, find=find, events=True)
