"""`gantrytau study`: a model or a function for many values and seeds, as a file describes it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import SolveError
from gantrytau.border import listed
from gantrytau.commands.arguments.display_option import Displayed, displayed
from gantrytau.commands.arguments.options import Json, Plotted, To
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.arguments.study_file import EXAMPLE, StudyFile, read_study
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    INTERRUPTED,
    CommandError,
    as_json,
    fail,
    note,
    reporting,
    writable,
    writable_place,
)
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Study

SHOWN = 12  # failures that are printed
SPELLING = Spelling(
    ("study", "simulate"),
    {n: n for n in ("stop", "over", "seeds", "combine", "inputs", "outputs", "tolerance", "points")}
    | {"folder": "--folder", "where": "--where", "parameters": "set"},
)


def study(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="The study, as swings.toml; --example prints one.", show_default=False
        ),
    ] = None,
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
    example: Annotated[bool, typer.Option("--example", help="Print a file to begin with.")] = False,
    json: Json = False,
) -> None:
    """Simulate a model, or call a function, for many values and seeds, on all processors or on a cluster.

    A case that fails is told and does not stop the others; exit code 1 if all failed. Ctrl-C keeps what --folder holds.
    """
    if example:
        typer.echo(EXAMPLE, nl=False)
        return
    with reporting(json, None, SPELLING):
        if file is None:
            raise CommandError(
                "no file: expected that of a study; `gantrytau study --example > study.toml` begins one"
            )
        drawn = listed(plot)
        place, units = picture_output.place(drawn, to), displayed(display)
        writable_place("--output", output, ".nc")
        asked = read_study(file)
        keywords = dict(asked.keywords)
        keywords |= {k: v for k, v in (("folder", folder), ("where", where)) if v is not None}
        found = _found(asked, keywords, json)
        files = []
        if output is not None:
            with writable(output):
                files.append(str(found.save(output)))
        if place:
            files += picture_output.draw(found, drawn, place, units)
        if json:
            typer.echo(as_json(_summary(asked.name, found, files)))
        else:
            _show(asked.name, found, files)
        if len(found.failures) == len(found):
            raise typer.Exit(1)


def _found(asked: StudyFile, keywords: dict[str, Any], json: bool) -> "Study":
    import gantrytau

    try:
        return gantrytau.study(asked.subject, **keywords)
    except SolveError as error:
        if not error.interrupted:
            raise
        fail(SPELLING.of(error), INTERRUPTED, json, kind=type(error).__name__)


def _ends(value: Any) -> dict[str, float]:
    """What is told of one case: the last values of its variables, numbers that a function returned."""
    from gantrytau import Result

    if isinstance(value, Result):
        return {name: value.final(name) for name in value.names}
    if isinstance(value, dict):
        return {str(name): number for name, number in value.items() if isinstance(number, (int, float))}
    return {"value": value} if isinstance(value, (int, float)) else {}


def _summary(name: str, found: "Study", files: list[str]) -> dict[str, Any]:
    failed = {failure.case.number: failure for failure in found.failures}
    cases = []
    for case, value in zip(found.cases, found.values, strict=True):
        row: dict[str, Any] = {"chosen": case.names}
        if case.number in failed:
            row |= {"error": failed[case.number].message, "kind": failed[case.number].kind}
        else:
            row |= {"final": _ends(value)}
        cases.append(row)
    return {"study": name, "cases": cases, "failures": len(failed), "files": files}


def _show(name: str, found: "Study", files: list[str]) -> None:
    """What the cases end with, as a table over all of them, and those that failed."""
    import statistics

    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    axes = " x ".join(f"{n} ({k})" for n, k in zip(found.axes.names, found.axes.shape, strict=True))
    typer.echo(f"{name}: {len(found)} cases over {axes}, {len(found.failures)} failed")
    columns: dict[str, list[float]] = {}
    for _, value in found:
        for key, number in _ends(value).items():
            columns.setdefault(key, []).append(number)
    if columns and len(columns) <= SHOWN:
        table = Table(box=SIMPLE, pad_edge=False)
        table.add_column("at the end", no_wrap=True)
        for heading in ("least", "median", "greatest"):
            table.add_column(heading, justify="right", no_wrap=True)
        for key, numbers in columns.items():
            shown = (min(numbers), statistics.median(numbers), max(numbers))
            table.add_row(Text(key), *(f"{number:.6g}" for number in shown))
        Console().print(table)
    for failure in found.failures[:SHOWN]:
        note(f"Failed: {failure}")
    if len(found.failures) > SHOWN:
        note(f"and {len(found.failures) - SHOWN} more; --json tells all")
    for file in files:
        typer.echo(f"Written: {file}")
