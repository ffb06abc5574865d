"""`gantrytau vision detect`: the corners of a pattern in folders of images."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.printing.reporting import CommandError, as_json, busy, refusing, reporting, writable
from gantrytau.commands.vision.vision_options import SPELLING

PATTERNS = ("quincunx", "charuco")
Report = Annotated[
    Path | None,
    typer.Option("--report", help="Write a page (HTML) with the images that were lost.", show_default=False),
]


def detect(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER...",
            help="Images, one folder for each camera; files are paired by the number in their names.",
            show_default=False,
        ),
    ],
    side: Annotated[float, typer.Option(metavar="M", help="Of a cell of the pattern.", show_default=False)],
    pattern: Annotated[
        str, typer.Option(metavar="|".join(PATTERNS), autocompletion=words(*PATTERNS), help="The pattern.")
    ] = "quincunx",
    columns: Annotated[int, typer.Option(help="Cells of a charuco board.")] = 5,
    rows: Annotated[int, typer.Option(help="Cells of a charuco board.")] = 4,
    background: Annotated[
        int, typer.Option(help="Images of each camera whose median shows what stands still; 0 for none.")
    ] = 10,
    up: Annotated[
        float, typer.Option(metavar="DEG", help="Direction of the side that is up, clockwise in the image.")
    ] = 0.0,
    output: Annotated[Path, typer.Option(help="Where to keep the corners (.npz).")] = Path("corners.npz"),
    report: Report = None,
    json: Json = False,
) -> None:
    """Find a pattern in images, and say at which step images were lost."""
    with reporting(json, None, SPELLING):
        from gantrytau_optimica.vision import Pattern, write_vision_page
        from gantrytau_optimica.vision import detect as detected

        if pattern not in PATTERNS:
            raise CommandError(
                f"--pattern {pattern}: found an unknown pattern, expected one of {', '.join(PATTERNS)}"
            )
        with refusing():
            flat = Pattern.quincunx(side) if pattern == "quincunx" else Pattern.charuco(columns, rows, side)
        names = [str(folder) for folder in folders]
        with busy(f"looking for the pattern in {len(folders)} folders"):
            found = detected(names, flat, background=background, up=float(np.radians(up)))
        with writable(output):
            found.save(output)
        if report is not None:
            with writable(report):
                write_vision_page(report, found, names)
        if json:
            record = {
                "poses": len(found.numbers),
                "pairs": int(found.pairs.sum()),
                "found": found.found.sum(axis=1).tolist(),
                "lost": [
                    {"camera": int(c) + 1, "image": int(found.numbers[k]), "step": str(found.steps[c, k])}
                    for c, k in np.argwhere(~found.found)
                ],
                "findings": [{"kind": f.kind, "message": f.message} for f in found.findings],
                "output": str(output),
                "report": None if report is None else str(report),
            }
            typer.echo(as_json(record))
            return
        typer.echo(str(found))
        for path in (output, report):
            if path is not None:
                typer.echo(f"Written: {path}")
