"""Corrections on file: a column for each joint over time, for controllers to add and to be read again."""

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gantrytau import ModelError, Result, did_you_mean
from gantrytau.language.tables.csv_cells import headings
from gantrytau_optimica.learning.servo_loop import unit_of

UNIT = re.compile(r"\s*\[([^\]]*[a-z%][^\]]*)\]$")  # behind a name; [0] is an index
SAME = 1e-6  # of a period, by which times may differ


def write_corrections(
    path: str | os.PathLike[str], t: np.ndarray, joints: Sequence[str], u: np.ndarray
) -> Path:
    """Corrections u (N, n) of joints at times t (N,), in the formats of `Result.save`."""
    columns = dict(zip(joints, u.T, strict=True))
    units = {joint: unit_of([joint]) for joint in joints}
    return Result(t, columns, units=units, title="corrections").save(path)


def read_corrections(path: str | os.PathLike[str], joints: Sequence[str], t: np.ndarray) -> np.ndarray:
    """Corrections (N, n) of joints, in their order, at times t (N,) of a reference, from a CSV file; headings may say units.

    Raises ModelError for files that are none, joints that are missing, other quantities, other times, what is not finite.
    """
    file = Path(path)
    try:
        with file.open(newline="", encoding="utf-8-sig") as text:
            header, *lines = [row for row in csv.reader(text) if row]
        rows = np.array([[float(value) for value in row] for row in lines])
    except FileNotFoundError:
        raise ModelError(f"{file}: found no such file, expected corrections") from None
    except (OSError, ValueError) as error:
        raise ModelError(
            f"{file}: found a file that is no table of numbers ({error}), expected corrections"
        ) from None
    names, units = headings(
        file, header, lambda name: ("s",) if name == "time" else (unit_of([name]),) if name in joints else ()
    )
    names = [UNIT.sub("", name) for name in names]  # also of columns that are not read
    for joint in names[1:]:
        if joint in joints and names.count(joint) > 1:
            raise ModelError(f"{file}: found the column {joint} twice, expected one for each joint")
    for joint in joints:
        if joint not in names:
            raise ModelError(
                f"{file}: found no column {joint}, expected one for each joint{did_you_mean(joint, names)}"
            )
    if rows.shape != (len(t), len(names)):
        raise ModelError(
            f"{file}: found {len(rows)} rows, expected {len(t)}, one for each sample of the reference"
        )
    rows = np.column_stack([x if unit is None else unit.si(x) for x, unit in zip(rows.T, units, strict=True)])
    off = np.abs(rows[:, 0] - t)
    if not np.all(off <= SAME * (t[1] - t[0])):
        raise ModelError(
            f"{file}: found the time {rows[int(np.argmax(off)), 0]:g} s in row {int(np.argmax(off))}, expected those of the "
            f"reference, every {t[1] - t[0]:g} s"
        )
    found = rows[:, [names.index(joint) for joint in joints]]
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if bad.size:
        raise ModelError(f"{file}: found a correction that is not finite in row {bad[0]}, expected numbers")
    return found
