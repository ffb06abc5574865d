"""Logs of motion on file: CSV, as programs of controllers, spreadsheets and `Result.save` write it."""

from pathlib import Path

import numpy as np

from gantrytau.border.columns import Columns
from gantrytau.whole_files import replacing
from gantrytau_optimica.identification.logs.log_columns import EXPECTED, UNITS, columns_of

Arrays = dict[str, np.ndarray | None]


def read_log(path: Path) -> Arrays:
    """Arrays t, q, f, v, r of a log in SI, as `MotionLog` takes them.

    Raises ModelError for what is no such file, with the line of a cell that is no number.
    """
    table = Columns.read(path, f"one line for each time; {EXPECTED}")
    arrays: Arrays = dict.fromkeys("tqfvr")
    for kind, places in columns_of(table).items():
        columns = [table.column(table.names[k], *UNITS[kind], place=k) for k in places]
        arrays[kind] = np.column_stack(columns) if kind != "t" else columns[0]
    return arrays


def write_log(path: Path, arrays: Arrays) -> None:
    """Write a log, in SI, so that it is read to the last digit."""
    names, kept = [], []
    for name, array in arrays.items():
        if array is None:
            continue
        columns = array.reshape(len(array), -1)
        if name in "tr":
            names += ["t [s]"] if name == "t" else ["x [m]", "y [m]", "z [m]"]
        else:
            names += [f"{name}{k + 1}" for k in range(columns.shape[1])]
        kept.append(columns)
    with replacing(path) as partial:
        np.savetxt(partial, np.column_stack(kept), "%.17g", ",", header=",".join(names), comments="")
