"""The numbers of a table from a CSV file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.errors import ModelError, did_you_mean
from gantrytau.language.scales import Scale
from gantrytau.language.tables.csv_cells import check_cells, headings, number_of, read_cells


def read_table(path: str | Path, columns: Sequence[str] | None = None) -> tuple[Any, np.ndarray]:
    """The numbers of a CSV file for `table(x, *read_table("curve.csv"))`.

    Two columns with names in the first line are a curve: xs (n,), ys (n,); columns: which two, where there are more.
    A first line of numbers behind its first cell is a map, `table((x, y), *read_table("map.csv"))`: (xs, ys), values
    (n, m), with ys in the first line, xs in the first column. Cells are separated by commas, or by semicolons or tabs:
    then decimals may have a comma. Columns with units, "v [mm/s]", come in SI and are named without them. ModelError with
    file and line for what cannot be read, and for a unit that is none.
    """
    path = Path(path)
    rows, separator = read_cells(path)
    if len(rows) < 2:
        raise ModelError(
            f"{path}: found {len(rows)} lines, expected a header and at least one line of numbers"
        )
    first, header = rows[0][0], [name.strip() for name in rows[0][1]]
    for line, row in rows[1:]:
        check_cells(path, line, row, len(header), separator)
    if columns is None and len(header) > 2 and all(_is_number(name, separator) for name in header[1:]):
        if "[" in header[0]:
            raise ModelError(
                f"{path}: line {first}: found {header[0]!r}, expected a map without units, in SI"
            )
        ys = np.array([number_of(path, first, "ys", cell, separator) for cell in header[1:]])
        found = [
            [_filled(path, line, f"{k + 1}", c, separator) for k, c in enumerate(row)]
            for line, row in rows[1:]
        ]
        return (np.array(found)[:, 0], ys), np.array(found)[:, 1:]
    if all(_is_number(name, separator) for name in header):
        raise ModelError(
            f"{path}: found numbers in the first line, expected the names of the columns; add them"
        )
    header, scales = headings(path, header, None)
    names = list(columns or header)
    if len(names) != 2:
        raise ModelError(
            f"{path}: found the columns {', '.join(names)}, expected two of a curve; name them, columns=('x', 'y')",
            argument="columns",
        )
    for name in names:
        if header.count(name) != 1:
            raise ModelError(
                f"{path}: found {'no' if name not in header else 'several'} columns {name}, expected one of "
                f"{', '.join(header)}{did_you_mean(name, header)}",
                argument="columns",
            )
    places = [header.index(name) for name in names]
    x, y = (
        _in_si([_filled(path, line, name, row[k], separator) for line, row in rows[1:]], scales[k])
        for name, k in zip(names, places, strict=True)
    )
    return x, y


def _in_si(column: Sequence[float], unit: Scale | None) -> np.ndarray:
    return np.array(column) if unit is None else np.asarray(unit.si(np.array(column)))


def _filled(path: Path, line: int, column: str, cell: str, separator: str) -> float:
    if not cell.strip():
        raise ModelError(f"{path}: line {line}, column {column}: found an empty cell, expected a number")
    return number_of(path, line, column, cell, separator)


def _is_number(text: str, separator: str) -> bool:
    try:
        float(text if separator == "," else text.replace(",", "."))
    except ValueError:
        return False
    return True
