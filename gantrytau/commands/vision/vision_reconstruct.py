"""`gantrytau vision reconstruct`: poses of the pattern and cameras from corners in images."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.arguments.shell_offers import words
from gantrytau.commands.printing.reporting import CommandError, as_json, busy, refusing, reporting, writable
from gantrytau.commands.vision.vision_detect import Report
from gantrytau.commands.vision.vision_options import SPELLING

SCALES = ("spacing", "pattern", "both")


def reconstruct(
    corners: Annotated[
        Path, typer.Argument(metavar="FILE", help="Corners by `gantrytau vision detect`.", show_default=False)
    ],
    camera: Annotated[
        list[Path],
        typer.Option(
            "--camera",
            metavar="FILE",
            help="What is known of a lens: K, distortion, size (TOML). One for each camera, in the order of the folders.",
            show_default=False,
        ),
    ],
    carts: Annotated[
        Path | None,
        typer.Option(
            help="Positions of the carts, CSV with q1,q2,q3 in m and perhaps number, a row for each image. They "
            "tell the scale, and go into the measurements.",
            show_default=False,
        ),
    ] = None,
    estimate: Annotated[bool, typer.Option("--estimate", help="Fit the lenses, too.")] = False,
    scale: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(SCALES),
            autocompletion=words(*SCALES),
            help="What tells lengths.",
            show_default="what there is",
        ),
    ] = None,
    turning: Annotated[bool, typer.Option("--turning", help="The plate turns from pose to pose.")] = False,
    free: Annotated[
        bool, typer.Option("--free", help="Take each corner for itself, as the thesis does.")
    ] = False,
    place: Annotated[
        str,
        typer.Option(metavar="X,Y,Z", help="Middle of the pattern in the frame of the plate, m."),
    ] = "0,0,0",
    output: Annotated[
        Path | None,
        typer.Option(
            help="Measurements (CSV): with --carts for `gantrytau calibrate`, covariances included.",
            show_default=False,
        ),
    ] = None,
    images: Annotated[
        list[Path] | None,
        typer.Option(
            "--images", metavar="FOLDER", help="Folders of images, for the report.", show_default=False
        ),
    ] = None,
    report: Report = None,
    json: Json = False,
) -> None:
    """Find poses of the pattern and where the cameras stand, with the error that is to be expected."""
    with reporting(json, None, SPELLING):
        from gantrytau_optimica import Measurements
        from gantrytau_optimica.vision import Camera, Detections, read_carts, write_vision_page
        from gantrytau_optimica.vision import reconstruct as reconstructed

        if scale is not None and scale not in SCALES:
            raise CommandError(
                f"--scale {scale}: found an unknown scale, expected one of {', '.join(SCALES)}"
            )
        middle = _place(place)
        with refusing():
            found = Detections.read(corners)
            lenses = [Camera.read(file) for file in camera]
            q = None if carts is None else read_carts(carts, found.numbers)
        tells: Any = scale
        with busy("adjusting cameras and poses"):
            poses = reconstructed(
                found,
                lenses,
                intrinsics="estimate" if estimate else "fixed",
                scale=tells,
                spacing=None if scale == "pattern" else q,
                orientation="free" if turning else "fixed",
                corners="free" if free else "plate",
            )
        if output is not None:
            empty = np.zeros((len(poses.r), 0)) if q is None else q
            measured: Measurements = poses.measurements(empty, place=middle)
            with writable(output):
                measured.write(output)
        if report is not None:
            with writable(report):
                write_vision_page(report, found, [str(folder) for folder in images or ()], poses)
        if json:
            record = {
                "poses": int(poses.found.sum()),
                "rms_pixel": poses.rms,
                "expected_m": poses.expected,
                "scale": poses.scale,
                "cameras": [
                    {
                        "focal": each.focal.tolist(),
                        "centre": each.centre.tolist(),
                        "distortion": each.distortion.tolist(),
                        "r": each.r.tolist(),
                        "R": each.R.tolist(),
                    }
                    for each in poses.cameras
                ],
                "findings": [{"kind": f.kind, "message": f.message} for f in poses.findings],
                "output": None if output is None else str(output),
                "report": None if report is None else str(report),
            }
            typer.echo(as_json(record))
            return
        typer.echo(str(poses))
        for path in (output, report):
            if path is not None:
                typer.echo(f"Written: {path}")


def _place(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != 3:
        raise CommandError(f"--place {text}: found no three numbers, expected as --place 0.15,0,0 in m")
    return found
