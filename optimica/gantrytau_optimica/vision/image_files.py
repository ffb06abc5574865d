"""Folders of images, and the poses that they show, on file."""

import os
from pathlib import Path

import numpy as np

from gantrytau.kinematics.rotations import of_quaternions, quaternions
from gantrytau_optimica.vision.opencv import VisionError, opencv

Array = np.ndarray
ENDINGS = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm")
HEADER = ("x", "y", "z", "qw", "qx", "qy", "qz")


def file_name(k: int) -> str:
    """The name of an image."""
    return f"{k:04d}.png"


def write_image(path: Path, image: Array) -> None:
    """Write an image; VisionError where that is not possible."""
    if not opencv().imwrite(str(path), image):
        raise VisionError(f"{path}: the image cannot be written; check the folder and its rights")


def read_image(path: Path) -> Array | None:
    """An image as it stands on file, or None where it cannot be read."""
    data = np.fromfile(path, np.uint8)
    return opencv().imdecode(data, opencv().IMREAD_UNCHANGED) if data.size else None


def write_poses(path: str | os.PathLike[str], r: Array, R: Array) -> None:
    """Write poses (N, 3), (N, 3, 3) as CSV with the columns x, y, z, qw, qx, qy, qz, in m."""
    rows = np.column_stack([r, quaternions(R)])
    np.savetxt(path, rows, delimiter=",", header=",".join(HEADER), comments="", fmt="%.17g")


def read_poses(path: str | os.PathLike[str]) -> tuple[Array, Array]:
    """Poses from a CSV file as of `write_poses`: r (N, 3) in m, R (N, 3, 3); VisionError for other columns."""
    path = Path(path)
    if not path.is_file():
        raise VisionError(f"{path}: there is no such file; check its path")
    head, *lines = path.read_text(encoding="utf-8-sig").splitlines() or [""]
    if tuple(name.strip() for name in head.split(",")) != HEADER:
        raise VisionError(
            f"{path}: found the columns {head!r}, expected {','.join(HEADER)} in the first line"
        )
    try:
        rows = np.array([[float(cell) for cell in line.split(",")] for line in lines if line.strip()])
        rows = rows.reshape(-1, len(HEADER))
    except ValueError as error:
        raise VisionError(f"{path}: {error}; expected seven numbers in each line") from None
    return rows[:, :3], of_quaternions(rows[:, 3:])
