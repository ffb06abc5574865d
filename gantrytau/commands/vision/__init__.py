"""`gantrytau vision`: from images of a pattern on a robot to measurements, one module for each command."""

import typer

from gantrytau.commands.vision.vision_compare import compare
from gantrytau.commands.vision.vision_detect import detect
from gantrytau.commands.vision.vision_example import example
from gantrytau.commands.vision.vision_reconstruct import reconstruct
from gantrytau.commands.vision.vision_rehearse import rehearse

app = typer.Typer(
    help="Images of a pattern on a robot, by one camera or more: corners, poses, comparison with a laser.",
    no_args_is_help=True,
)

app.command(epilog="Example: gantrytau vision example try && cd try")(example)
app.command(
    epilog="Example: gantrytau vision detect camera1 camera2 --side 0.06 --output corners.npz --report images.html"
)(detect)
app.command(
    epilog="Example: gantrytau vision reconstruct corners.npz --camera left.toml --camera right.toml --carts carts.csv "
    "--estimate --output places.csv"
)(reconstruct)
app.command(epilog="Example: gantrytau vision compare places.csv laser.csv --to error.png")(compare)
app.command(epilog="Example: gantrytau calibrate cell.toml; gantrytau vision rehearse cell-plan")(rehearse)
