"""`gantrytau vision compare`: places by cameras beside those of a laser."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import answered, refusing, reporting, written
from gantrytau_optimica.vision import compare as compared
from gantrytau_optimica.vision import paired, plot_comparison


@serves(compared, scale="Fit the scale, too.")
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
    scale: bool,
    to: Annotated[
        Path | None,
        typer.Option("--to", help="Draw errors as a map and as histograms.", show_default=False),
    ] = None,
    json: Json = False,
) -> None:
    """Compare places with those of a better device, after the best motion.

    Rows are paired by the column `number` where both files have it.
    """
    with reporting(json):
        with refusing():
            found = compared(*paired(places, reference), scale=scale)
        record = {
            "mean_m": found.mean,
            "axes_m": found.axes,
            "border_ratio": found.border_ratio,
            "scale": found.scale,
            "error_m": found.error,
            "to": to,
        }
        answered(json, record, str(found), written(to, lambda file: plot_comparison(found, file=file)))
