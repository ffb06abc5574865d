"""`gantrytau browse`: results that were saved, as a page in which variables are found, drawn over each other and read."""

from pathlib import Path
from typing import Annotated

import typer

import gantrytau
from gantrytau import translate
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.display_option import Displayed, displayed
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.options import Json, PrototypeName, Settings
from gantrytau.commands.arguments.saved_results import FORMATS, read_result
from gantrytau.commands.printing.reporting import answered, busy, reporting, writable_place, written
from gantrytau.viewing import LARGEST


def browse(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="RESULT...",
            help=f"Files that simulate or optimize saved, {', '.join(FORMATS)}; several are drawn over each other.",
            show_default=False,
        ),
    ],
    names: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            help="Read these variables and components only, as tool.r,carts[0].",
            show_default="all",
        ),
    ] = None,
    first: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES", help="Draw these variables when the page opens.", show_default="some states"
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write this page.", show_default="RESULT.html")
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="Show this model in motion beside: a name of the library, or robot.py:Robot.",
            show_default=False,
        ),
    ] = None,
    display: Displayed = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Write a page with the curves of results, for any browser and without a network.

    Variables stand by component with units and descriptions; drag to zoom, click for a cursor, export as CSV, SVG or PNG.
    """
    with reporting(json, source_of(model or "")):
        writable_place("--output", output, ".html", ".htm")
        kept, begun = listed(names), listed(first)
        units = displayed(display)
        wanted = (*kept, *begun) if kept else ()
        runs = [read_result(file, "RESULT", wanted, LARGEST) for file in results]
        dae = None
        if model is not None:
            chosen = build(model, prototype, set_ or ())
            with busy(f"translating {chosen.name}"):
                dae = translate(chosen.model, events=True)
        page = gantrytau.browse(*runs, names=kept, first=begun, display=units, model=dae)
        files = written(output or results[0].with_suffix(".html"), page.save)
        record = {
            "results": [str(file) for file in results],
            "variables": len({name for run in runs for name in run.names}),
            "file": files[0],
            "bytes": len(page.text.encode()),
        }
        answered(json, record, None, files)
