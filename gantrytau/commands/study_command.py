"""`gantrytau study`: a model or a function for many values and seeds, as a file describes it."""

import statistics
from pathlib import Path
from typing import Annotated, Any

import typer

import gantrytau
from gantrytau import Result, SolveError, Study
from gantrytau.border import listed
from gantrytau.commands.arguments.display_option import Displayed, displayed
from gantrytau.commands.arguments.option import printing
from gantrytau.commands.arguments.options import Json, Plotted, To
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.arguments.study_file import EXAMPLE, POLICY, read_study
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    answered,
    fail,
    note,
    print_table,
    reporting,
    writable_place,
    written,
)
from gantrytau.commands.printing.spelling import spelled

SHOWN = 12  # failures that are printed
NAMES = {key: key for key in (*POLICY, "over", "inputs")} | {"folder": "--folder", "where": "--where"}


def study(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="The study, as swings.toml; --example prints one.", show_default=False
        ),
    ],
    folder: Annotated[
        Path | None,
        typer.Option(
            help="Keep finished cases there; the same command goes on with the rest.", show_default=False
        ),
    ] = None,
    where: Annotated[
        str | None,
        typer.Option(
            metavar="processes|dask|ADDRESS",
            autocompletion=words("processes", "dask"),
            help="All processors of this machine, a Dask cluster on it, or one by its address, tcp://host:8786.",
            show_default="processes",
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="Save all results as one dataset, .nc (netCDF).", show_default=False)
    ] = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    example: Annotated[
        bool,
        typer.Option(
            "--example", help="Print a file to begin with.", is_eager=True, callback=printing(EXAMPLE)
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Simulate a model, or call a function, for many values and seeds, on all processors or on a cluster.

    A case that fails is told and does not stop the others; exit code 1 if all failed. Ctrl-C keeps what --folder holds.
    """
    with reporting(json, None, NAMES | {"parameters": "set"}):
        drawn = listed(plot)
        place, units = picture_output.place(drawn, to), displayed(display)
        writable_place("--output", output, ".nc")
        asked = read_study(file)
        chosen: dict[str, Any] = {k: v for k, v in (("folder", folder), ("where", where)) if v is not None}
        try:
            found = gantrytau.study(asked.subject, **{**asked.keywords, **chosen})
        except SolveError as error:
            if not error.interrupted:
                raise
            fail(spelled(error), INTERRUPTED, json, kind=type(error).__name__)
        files: list[Any] = written(output, found.save)
        if place:
            files += picture_output.draw(found, drawn, place, units)
        answered(json, _summary(asked.name, found), lambda: _show(asked.name, found), files)
        if len(found.failures) == len(found):
            raise typer.Exit(FAULT)


def _ends(value: Any) -> dict[str, float]:
    """What is told of one case: the last values of its variables, numbers that a function returned."""
    if isinstance(value, Result):
        return {name: value.final(name) for name in value.names}
    if isinstance(value, dict):
        return {str(name): number for name, number in value.items() if isinstance(number, (int, float))}
    return {"value": value} if isinstance(value, (int, float)) else {}


def _summary(name: str, found: Study) -> dict[str, Any]:
    failed = {failure.case.number: failure for failure in found.failures}
    cases = []
    for case, value in zip(found.cases, found.values, strict=True):
        row: dict[str, Any] = {"chosen": case.names}
        if case.number in failed:
            row |= {"error": failed[case.number].message, "kind": failed[case.number].kind}
        else:
            row |= {"final": _ends(value)}
        cases.append(row)
    return {"study": name, "cases": cases, "failures": len(failed)}


def _show(name: str, found: Study) -> None:
    """What the cases end with, as a table over all of them, and those that failed."""
    axes = " x ".join(f"{n} ({k})" for n, k in zip(found.axes.names, found.axes.shape, strict=True))
    typer.echo(f"{name}: {len(found)} cases over {axes}, {len(found.failures)} failed")
    columns: dict[str, list[float]] = {}
    for _, value in found:
        for key, number in _ends(value).items():
            columns.setdefault(key, []).append(number)
    if columns and len(columns) <= SHOWN:
        shown = {key: (min(n), statistics.median(n), max(n)) for key, n in columns.items()}
        rows = [(key, *(f"{number:.6g}" for number in numbers)) for key, numbers in shown.items()]
        print_table(("at the end", "least", "median", "greatest"), rows)
    for failure in found.failures[:SHOWN]:
        note(f"Failed: {failure}")
    if len(found.failures) > SHOWN:
        note(f"and {len(found.failures) - SHOWN} more; --json tells all")
