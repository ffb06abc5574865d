"""`gantrytau vision example`: rendered images of a robot, to try the other commands with."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gantrytau.commands.printing.reporting import CommandError, busy, note, reporting
from gantrytau.kinematics import Kinematics
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import Measurements
from gantrytau_optimica.vision import Camera, Light, Pattern, Scene, render

SIDE = 0.06  # m, of a cell
PLACE = "0.15,0,0"  # of the pattern on the plate
LINES = ((2.7, -0.9), (3.0, -0.3), (3.3, -0.8), (2.8, -0.5), (3.2, -0.4))  # y and z in m
NEXT = f"""Next, there:
  gantrytau vision detect camera1 camera2 --side {SIDE} --report images.html
  gantrytau vision reconstruct corners.npz --camera left.toml --camera right.toml --estimate \\
    --carts carts.csv --output places.csv
  gantrytau vision compare places.csv laser.csv --to error.png
  gantrytau calibrate places.csv --robot 'SixLinkGantryTau(GT_A)' --model 1"""


def example(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where to write.", show_default=False)],
    each: Annotated[int, typer.Option(help="Poses on each of five lines along the guideways.")] = 8,
    gain: Annotated[float, typer.Option(help="Of the light; 0.15 is dim.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of noise and light.")] = 0,
) -> None:
    """Write images of a Gantry-Tau by two cameras, what is guessed of their lenses, the carts, and places by a laser."""
    with reporting(False):
        if folder.exists() and any(folder.iterdir()):
            raise CommandError(f"{folder}: found a folder that is not empty, expected a new one")
        if each < 2:
            raise CommandError(
                f"--each {each}: found fewer than two poses, expected lines along the guideways"
            )
        folder.mkdir(parents=True, exist_ok=True)
        scene = Scene(Pattern.quincunx(SIDE), SixLinkGantryTau(prototypes.GT_A))
        lens = Camera([[1296.0, 0, 518.0], [0, 1296.0, 377.0], [0, 0, 1]], [-0.12, 0.03, 0, 0, 0])
        cameras = [lens.looking((4.8, y, -0.6), (1.3, 3.0, -0.6)) for y in (2.4, 3.6)]
        r = np.array([[x, y, z] for y, z in LINES for x in np.linspace(0.5, 2.0, each)])
        with busy(f"drawing {2 * len(r)} images"):
            render(scene, r, cameras, light=Light(gain), seed=seed, folder=folder)
        guess = Camera.guess(lens.size, 1290.0)
        for name in ("left.toml", "right.toml"):
            guess.write(folder / name)
        assert scene.robot is not None
        q = Kinematics(scene.robot).ik(r, np.eye(3))
        by_laser = r + 5e-5 * np.random.default_rng(seed).standard_normal(r.shape)
        numbers = np.arange(len(r))
        Measurements(q, by_laser, numbers=numbers).write(folder / "laser.csv")
        header = ",".join(["number", *(f"q{k + 1}" for k in range(q.shape[1]))])
        rows = np.column_stack([numbers, q])
        np.savetxt(folder / "carts.csv", rows, delimiter=",", header=header, comments="", fmt="%.9g")
        note(f"Written: {2 * len(r)} images and four files in {folder}. {NEXT}")
