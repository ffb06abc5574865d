"""Folders of images, and the poses that they show, on file."""

import os
from pathlib import Path

import numpy as np

from gantrytau import Columns, ModelError
from gantrytau.kinematics.rotations import of_quaternions, quaternions
from gantrytau_optimica.vision.opencv import opencv

Array = np.ndarray
ENDINGS = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm")
HEADER = ("x", "y", "z", "qw", "qx", "qy", "qz")


def file_name(k: int) -> str:
    """The name of an image."""
    return f"{k:04d}.png"


def write_image(path: Path, image: Array) -> None:
    """Write an image; ModelError where that is not possible."""
    if not opencv().imwrite(str(path), image):
        raise ModelError(f"{path}: the image cannot be written; check the folder and its rights")


def read_image(path: Path) -> Array | None:
    """An image as it stands on file, or None where it cannot be read."""
    data = np.fromfile(path, np.uint8)
    return opencv().imdecode(data, opencv().IMREAD_UNCHANGED) if data.size else None


def write_poses(path: str | os.PathLike[str], r: Array, R: Array) -> None:
    """Write poses (N, 3), (N, 3, 3) as CSV with the columns x, y, z, qw, qx, qy, qz, in m."""
    rows = np.column_stack([r, quaternions(R)])
    np.savetxt(path, rows, delimiter=",", header=",".join(HEADER), comments="", fmt="%.17g")


def read_poses(path: str | os.PathLike[str]) -> tuple[Array, Array]:
    """Poses from a CSV file as of `write_poses`: r (N, 3) in m, R (N, 3, 3); ModelError for other columns."""
    table = Columns.read(path, "one line for each pose")
    rows = np.column_stack([table.column(x, "m" if x in "xyz" else "1", filled=True) for x in HEADER])
    return rows[:, :3], of_quaternions(rows[:, 3:])
