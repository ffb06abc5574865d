"""Tables beside images: carts and places, known by the number of an image where there is a column `number`."""

from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.columns import Columns

Array = np.ndarray
PLACE = ("x", "y", "z")


def read_places(path: Path) -> tuple[Array, Array | None]:
    """Places (N, 3) in m from a CSV file with x, y, z, and the numbers of their images (N,) or None.

    Raises ModelError for what cannot be read, and columns that are missing.
    """
    table = Columns.read(path)
    return np.column_stack([table.column(name, "m") for name in PLACE]), _numbers(table)


def paired(places: Path, reference: Path) -> tuple[Array, Array]:
    """Places of two files, of the same poses in each row, (N, 3) in m: by `number`, or row by row.

    Raises ModelError where they have none in common, or not as many.
    """
    (r, first), (others, second) = read_places(places), read_places(reference)
    if first is not None and second is not None:
        common, rows, of_reference = np.intersect1d(first, second, return_indices=True)
        if not common.size:
            raise ModelError(f"{reference}: found none of the numbers of {places}, expected the same poses")
        return r[rows], others[of_reference]
    if len(r) != len(others):
        raise ModelError(
            f"{reference}: found {len(others)} rows, expected {len(r)} as in {places}; a column `number` in both pairs them"
        )
    return r, others


def read_carts(path: Path, numbers: Any) -> Array:
    """Positions (N, n) of the carts in m from a CSV file with q1, q2, ..., a row for each image.

    numbers: of the images (N,), by which rows are chosen where the file has a column `number`. Raises ModelError for
    columns and rows that are missing.
    """
    table = Columns.read(path)
    joints = [name for name in (f"q{k}" for k in range(2, 13)) if name in table]
    q = np.column_stack([table.column(name, "m", "rad") for name in ("q1", *joints)])
    of_images = _numbers(table)
    if of_images is not None:
        places = {int(number): k for k, number in enumerate(of_images) if np.isfinite(number)}
        missing = [int(number) for number in numbers if int(number) not in places]
        if missing:
            raise ModelError(
                f"{path}: found no row with the number {missing[0]}, expected one for each image; "
                f"{len(missing)} are missing"
            )
        return q[[places[int(number)] for number in numbers]]
    if len(q) != len(numbers):
        raise ModelError(
            f"{path}: found {len(q)} rows for images of {len(numbers)} poses, expected as many; a column "
            "`number` tells which row is which image"
        )
    return q


def _numbers(table: Columns) -> Array | None:
    """Numbers of images, None without such a column."""
    return table.column("number", "1") if "number" in table else None
