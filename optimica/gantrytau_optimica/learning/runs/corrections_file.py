"""Corrections on file: a column for each joint over time, for controllers to add and to be read again."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.columns import Columns
from gantrytau_optimica.learning.servo_loop import unit_of

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
    table = Columns.read(path, "one line for each sample of the reference")
    if len(table) != len(t):
        raise ModelError(
            f"{path}: found {len(table)} rows, expected {len(t)}, one for each sample of the reference"
        )
    if table.time is None:
        raise ModelError(f"{path}: found no column time, expected the times of the reference")
    off = np.abs(table.time - t)
    if not np.all(off <= SAME * (t[1] - t[0])):
        worst = int(np.argmax(off))
        raise ModelError(
            f"{path}: found the time {table.time[worst]:g} s in row {worst}, expected those of the reference, every "
            f"{t[1] - t[0]:g} s"
        )
    return np.column_stack([table.column(joint, unit_of([joint]), filled=True) for joint in joints])
