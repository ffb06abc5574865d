"""The numbers of a table from a CSV file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.columns import Columns, is_number, split_heading
from gantrytau.border.refusal import ModelError


def read_table(path: str | Path, columns: Sequence[str] | None = None) -> tuple[Any, np.ndarray]:
    """The numbers of a CSV file for `table(x, *read_table("curve.csv"))`.

    Two columns with names in the first line are a curve: xs (n,), ys (n,); columns: which two, where there are more.
    A first line of numbers behind its first cell is a map, `table((x, y), *read_table("map.csv"))`: (xs, ys), values
    (n, m), with ys in the first line, xs in the first column. Cells are separated by commas, or by semicolons or tabs:
    then decimals may have a comma. Columns with units, "v [mm/s]", come in SI and are named without them. ModelError with
    file and line for what cannot be read, and for a unit that is none.
    """
    read = Columns.read(path, "at least one line of numbers")
    if (
        columns is None
        and len(read.header) > 2
        and all(is_number(x, read.separator) for x in read.header[1:])
    ):
        if split_heading(read.header[0])[1]:
            raise ModelError(f"{path}: found {read.header[0]!r}, expected a map without units, in SI")
        x, *values = (read.column(name, filled=True, place=k) for k, name in enumerate(read.header))
        ys = [float(y if read.separator == "," else y.replace(",", ".")) for y in read.header[1:]]
        return (x, np.array(ys)), np.column_stack(values)
    names = list(columns or read.names)
    if len(names) != 2:
        words = (
            f"found the columns {', '.join(names)}, expected two of a curve; name them, columns=('x', 'y')"
        )
        raise ModelError(words, place=str(path), argument="columns")
    x, y = (read.column(name, filled=True) for name in names)
    return x, y
