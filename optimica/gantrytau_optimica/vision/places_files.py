"""Tables beside images: carts and places, known by the number of an image where there is a column `number`."""

from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.language.tables.csv_cells import check_cells, headings, number_of, read_cells
from gantrytau_optimica.vision.opencv import VisionError

Array = np.ndarray
PLACE = ("x", "y", "z")


def read_places(path: Path) -> tuple[Array, Array | None]:
    """Places (N, 3) in m from a CSV file with x, y, z, and the numbers of their images (N,) or None.

    Raises VisionError for columns that are missing.
    """
    columns = _columns(path, PLACE, ("number",))
    return np.column_stack([columns[name] for name in PLACE]), columns.get("number")


def paired(places: Path, reference: Path) -> tuple[Array, Array]:
    """Places of two files, of the same poses in each row, (N, 3) in m: by `number`, or row by row.

    Raises VisionError where they have none in common, or not as many.
    """
    (r, first), (others, second) = read_places(places), read_places(reference)
    if first is not None and second is not None:
        common, rows, of_reference = np.intersect1d(first, second, return_indices=True)
        if not common.size:
            raise VisionError(f"{reference}: found none of the numbers of {places}, expected the same poses")
        return r[rows], others[of_reference]
    if len(r) != len(others):
        raise VisionError(
            f"{reference}: found {len(others)} rows, expected {len(r)} as in {places}; a column `number` in both pairs them"
        )
    return r, others


def read_carts(path: Path, numbers: Any) -> Array:
    """Positions (N, n) of the carts in m from a CSV file with q1, q2, ..., a row for each image.

    numbers: of the images (N,), by which rows are chosen where the file has a column `number`. Raises VisionError for
    columns and rows that are missing.
    """
    several = tuple(f"q{k + 1}" for k in range(1, 12))
    columns = _columns(path, ("q1",), (*several, "number"))
    q = np.column_stack([column for name, column in columns.items() if name != "number"])
    if "number" in columns:
        places = {int(number): k for k, number in enumerate(columns["number"]) if np.isfinite(number)}
        missing = [int(number) for number in numbers if int(number) not in places]
        if missing:
            raise VisionError(
                f"{path}: found no row with the number {missing[0]}, expected one for each image; "
                f"{len(missing)} are missing"
            )
        return q[[places[int(number)] for number in numbers]]
    if len(q) != len(numbers):
        raise VisionError(
            f"{path}: found {len(q)} rows for images of {len(numbers)} poses, expected as many; a column "
            "`number` tells which row is which image"
        )
    return q


def _columns(path: Path, names: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Array]:
    """Columns of a CSV file by name; VisionError for those that are missing, with the names that it has."""
    rows, separator = read_cells(path)
    if not rows:
        raise VisionError(f"{path}: found an empty file, expected the columns {','.join(names)}")
    try:
        header, units = headings(
            path, rows[0][1], lambda name: _units(name) if name in (*names, *optional) else ()
        )
    except ModelError as error:
        raise VisionError(str(error)) from None
    missing = [name for name in names if name not in header]
    if missing:
        raise VisionError(
            f"{path}: found the columns {','.join(header)}, expected {', '.join(missing)} as well; write names "
            "in the first line"
        )
    wanted = [name for name in header if name in (*names, *optional)]
    table: dict[str, list[float]] = {name: [] for name in wanted}
    for line, row in rows[1:]:
        check_cells(path, line, row, len(header), separator)
        for name in wanted:
            table[name].append(number_of(path, line, name, row[header.index(name)], separator))
    found = {name: np.array(column) for name, column in table.items()}
    scales = dict(zip(header, units, strict=True))
    return {name: x if (unit := scales[name]) is None else unit.si(x) for name, x in found.items()}


def _units(name: str) -> tuple[str, ...]:
    """In what the numbers of a column are."""
    return ("1",) if name == "number" else ("m", "rad") if name.startswith("q") else ("m",)
