"""Cells of CSV files: separated by commas, or by semicolons or tabs, where decimals may then have a comma."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from gantrytau.errors import ModelError
from gantrytau.language.scales import Scale, column_of, known_scale

SEPARATORS = (";", "\t", ",")


def read_cells(path: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """The lines of a CSV file that are not empty, each with its number, from 1, and its cells; and what separates these.

    ModelError for what cannot be read as text.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            first = file.readline()
            separator = next((one for one in SEPARATORS if one in first), ",")
            file.seek(0)
            reader = csv.reader(file, delimiter=separator)
            rows = [(reader.line_num, row) for row in reader if "".join(row).strip()]
    except OSError as error:
        raise ModelError(f"{path}: found no file to read ({error.strerror}), expected a CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ModelError(
            f"{path}: cannot be read as text ({error}); save it as CSV with the encoding UTF-8"
        ) from None
    return rows, separator


def headings(
    path: Path, header: Sequence[str], units: Callable[[str], Sequence[str]] | None
) -> tuple[list[str], list[Scale | None]]:
    """Names of columns, and their units where these stand behind in brackets, "x [mm]".

    units: name -> what a column may measure, in SI units; none for one that is not read; None for any. ModelError for
    other units.
    """
    names, scales = [], list[Scale | None]()
    for heading in header:
        name, bracket, _ = heading.strip().rpartition(" [")
        allowed = units(name.strip()) if bracket and units else ()
        if not allowed and not (bracket and units is None):
            names.append(heading.strip())
            scales.append(None)
            continue
        try:
            name, unit = column_of(heading)
            if unit is not None and allowed and not any(unit.measures(one) for one in allowed):
                known_scale(f"column {name}", unit.text, allowed[0])
        except ModelError as error:
            raise ModelError(f"{path}: {error}") from None
        names.append(name)
        scales.append(unit)
    return names, scales


def check_cells(path: Path, line: int, row: list[str], count: int, separator: str) -> None:
    """ModelError for a line that has not as many cells as the first."""
    if len(row) != count:
        commas = separator == "," and len(row) > count
        remedy = "; where decimals have commas, separate cells by semicolons" if commas else ""
        raise ModelError(f"{path}: line {line} has {len(row)} cells, expected {count} as the header{remedy}")


def number_of(path: Path, line: int, column: str, cell: str, separator: str) -> float:
    """The number in a cell, NaN for an empty one; ModelError for what is none."""
    text = cell.strip()
    try:
        return float(text if separator == "," else text.replace(",", ".")) if text else np.nan
    except ValueError:
        decimals = "" if separator == "," else ", or a comma"
        raise ModelError(
            f"{path}: line {line}, column {column}: found {text!r}, expected a number, with a point{decimals} before "
            "decimals and nothing between thousands"
        ) from None
