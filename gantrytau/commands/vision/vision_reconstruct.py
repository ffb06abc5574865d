"""`gantrytau vision reconstruct`: poses of the pattern and cameras from corners in images."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import (
    CommandError,
    answered,
    busy,
    refusing,
    reporting,
    written,
)
from gantrytau.commands.vision.vision_detect import Report
from gantrytau_optimica.vision import Camera, Detections, read_carts, write_vision_page
from gantrytau_optimica.vision import reconstruct as reconstructed

NAMES = {"spacing": "--carts"}


@serves(reconstructed, scale=typer.Option(help="What tells lengths.", show_default="what there is"))
def reconstruct(
    corners_file: Annotated[
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
    scale: Any,
    carts: Annotated[
        Path | None,
        typer.Option(
            help="Positions of the carts, CSV with q1,q2,q3 in m and perhaps number, a row for each image. They "
            "tell the scale, and go into the measurements.",
            show_default=False,
        ),
    ] = None,
    intrinsics: Annotated[bool, typer.Option("--estimate", help="Fit the lenses, too.")] = False,
    orientation: Annotated[
        bool, typer.Option("--turning", help="The plate turns from pose to pose.")
    ] = False,
    corners: Annotated[
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
    with reporting(json, None, NAMES):
        middle = _place(place)
        with refusing():
            found = Detections.read(corners_file)
            lenses = [Camera.read(file) for file in camera]
            q = None if carts is None else read_carts(carts, found.numbers)
        with busy("adjusting cameras and poses"):
            poses = reconstructed(
                found,
                lenses,
                intrinsics="estimate" if intrinsics else "fixed",
                scale=scale,
                spacing=None if scale == "pattern" else q,
                orientation="free" if orientation else "fixed",
                corners="free" if corners else "plate",
            )
        empty = np.zeros((len(poses.r), 0)) if q is None else q
        files = written(output, lambda file: poses.measurements(empty, place=middle).write(file))
        folders = [str(folder) for folder in images or ()]
        files += written(report, lambda file: write_vision_page(file, found, folders, poses))
        cameras = ("focal", "centre", "distortion", "r", "R")
        record = {
            "poses": int(poses.found.sum()),
            "rms_pixel": poses.rms,
            "expected_m": poses.expected,
            "scale": poses.scale,
            "cameras": [{name: getattr(one, name) for name in cameras} for one in poses.cameras],
            "findings": [{"kind": f.kind, "message": f.message} for f in poses.findings],
            "output": output,
            "report": report,
        }
        answered(json, record, str(poses), files)


def _place(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != 3:
        raise CommandError(f"--place {text}: found no three numbers, expected as --place 0.15,0,0 in m")
    return found
