"""`gantrytau vision compare`: places by cameras beside those of a laser."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import as_json, refusing, reporting, writable
from gantrytau.commands.vision.vision_options import SPELLING


def compare(
    places: Annotated[
        Path, typer.Argument(metavar="FILE", help="Places, CSV with x,y,z in m.", show_default=False)
    ],
    reference: Annotated[
        Path,
        typer.Argument(
            metavar="REFERENCE", help="The same poses by a laser, CSV with x,y,z in m.", show_default=False
        ),
    ],
    scale: Annotated[bool, typer.Option("--scale", help="Fit the scale, too.")] = False,
    to: Annotated[
        Path | None,
        typer.Option("--to", help="Draw errors as a map and as histograms.", show_default=False),
    ] = None,
    json: Json = False,
) -> None:
    """Compare places with those of a better device, after the best motion.

    Rows are paired by the column `number` where both files have it.
    """
    with reporting(json, None, SPELLING):
        from gantrytau_optimica.vision import compare as compared
        from gantrytau_optimica.vision import paired, plot_comparison

        with refusing():
            r, others = paired(places, reference)
            found = compared(r, others, scale=scale)
        if to is not None:
            with writable(to):
                plot_comparison(found, file=to)
        if json:
            record = {
                "mean_m": found.mean,
                "axes_m": found.axes.tolist(),
                "border_ratio": found.border_ratio,
                "scale": found.scale,
                "error_m": found.error.tolist(),
                "to": None if to is None else str(to),
            }
            typer.echo(as_json(record))
            return
        typer.echo(str(found))
        if to is not None:
            typer.echo(f"Written: {to}")
