"""`gantrytau vision detect`: the corners of a pattern in folders of images."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import answered, busy, refusing, reporting, written
from gantrytau_optimica.vision import Pattern, write_vision_page
from gantrytau_optimica.vision import detect as detected

Report = Annotated[
    Path | None,
    typer.Option("--report", help="Write a page (HTML) with the images that were lost.", show_default=False),
]


@serves(
    detected,
    background="Images of each camera whose median shows what stands still; 0 for none.",
    up=typer.Option(metavar="DEG", help="Direction of the side that is up, clockwise in the image."),
)
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
    background: int,
    up: float,
    pattern: Annotated[Literal["quincunx", "charuco"], typer.Option(help="The pattern.")] = "quincunx",
    columns: Annotated[int, typer.Option(help="Cells of a charuco board.")] = 5,
    rows: Annotated[int, typer.Option(help="Cells of a charuco board.")] = 4,
    output: Annotated[Path, typer.Option(help="Where to keep the corners (.npz).")] = Path("corners.npz"),
    report: Report = None,
    json: Json = False,
) -> None:
    """Find a pattern in images, and say at which step images were lost."""
    with reporting(json):
        with refusing():
            flat = Pattern.quincunx(side) if pattern == "quincunx" else Pattern.charuco(columns, rows, side)
        names = [str(folder) for folder in folders]
        with busy(f"looking for the pattern in {len(folders)} folders"):
            found = detected(names, flat, background=background, up=float(np.radians(up)))
        files = written(output, found.save)
        files += written(report, lambda file: write_vision_page(file, found, names))
        record = {
            "poses": len(found.numbers),
            "pairs": int(found.pairs.sum()),
            "found": found.found.sum(axis=1),
            "lost": [
                {"camera": int(c) + 1, "image": int(found.numbers[k]), "step": str(found.steps[c, k])}
                for c, k in np.argwhere(~found.found)
            ],
            "findings": [{"kind": f.kind, "message": f.message} for f in found.findings],
            "output": output,
            "report": report,
        }
        answered(json, record, str(found), files)
