"""`gantrytau vision rehearse`: a plan for cameras carried out on rendered images, from the tape measure to the verdict."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import FAULT, answered, note, refusing, reporting
from gantrytau_optimica.procedure import load_planned_cell
from gantrytau_optimica.vision import Light, rehearse_plan


@serves(
    rehearse_plan,
    side=typer.Option(metavar="M", help="Of a cell of the pattern on the tool."),
    seed="Of the robot that stands there, and of noise and light.",
)
def rehearse(
    plan: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A plan by `gantrytau calibrate cell.toml`.", show_default=False
        ),
    ],
    side: float,
    seed: int,
    gain: Annotated[float, typer.Option(help="Of the light; 0.15 is dim.")] = 1.0,
    believe: Annotated[
        bool,
        typer.Option("--believe", help="Take lenses as they are believed to be, instead of fitting them."),
    ] = False,
    json: Json = False,
) -> None:
    """Carry out a plan whose device is cameras with a simulated robot: images, corners, poses, calibration, verdict."""
    with reporting(json):
        with refusing():
            planned = load_planned_cell(plan, lambda name: build(name).model)
            light = Light(gain)
        found = rehearse_plan(
            planned,
            side=side,
            light=light,
            intrinsics="fixed" if believe else "estimate",
            seed=seed,
            progress=None if json else lambda words: note(f"{words} ..."),
        )
        record = {
            "pairs": int(found.detections.pairs.sum()),
            "poses": len(found.detections.numbers),
            "measured_m": found.measured.mean,
            "tool_m": found.tool.mean,
            "good": found.verdict.good,
            "verdict": str(found.verdict),
        }
        answered(json, record, str(found), found.files)
        if not found.verdict.good:
            raise typer.Exit(FAULT)
