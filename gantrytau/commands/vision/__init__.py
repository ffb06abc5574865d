"""`gantrytau vision`: from images of a pattern on a robot to measurements, one module for each command."""

from gantrytau.commands.printing.command_group import group

PLACES = {
    "example": ("vision.vision_example", "gantrytau vision example try && cd try"),
    "detect": (
        "vision.vision_detect",
        "gantrytau vision detect camera1 camera2 --side 0.06 --output corners.npz --report images.html",
    ),
    "reconstruct": (
        "vision.vision_reconstruct",
        "gantrytau vision reconstruct corners.npz --camera left.toml --camera right.toml --carts carts.csv "
        "--estimate --output places.csv",
    ),
    "compare": ("vision.vision_compare", "gantrytau vision compare places.csv laser.csv --to error.png"),
    "rehearse": (
        "vision.vision_rehearse",
        "gantrytau calibrate cell.toml; gantrytau vision rehearse cell-plan",
    ),
}
app = group(
    "Images of a pattern on a robot, by one camera or more: corners, poses, comparison with a laser.", PLACES
)
