"""Measured poses for calibration: actuator positions, tool positions, orientations, guideways."""

import copy
import csv
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.data_checks import check_data
from gantrytau_optimica.calibration.findings import Finding

_POSITION = ("x", "y", "z")
_QUATERNION = ("qw", "qx", "qy", "qz")


class Measurements:
    """Measured poses of a robot, and measured guideways. SI units; the first axis is the pose.

    q: actuator positions (N, n), carts in m first, then angles in rad; r: tool positions (N, 3) in m; R: orientations of
    the plate (N, 3, 3), world = R @ plate, or unit quaternions (N, 4), scalar first, or None; rails: for each guideway
    (k, 4) the columns q, x, y, z of points measured along it, k from 2, in any frame, or None.
    Arrays are copied and cannot be written to. Raises ModelError for shapes that do not fit; what is doubtful about the
    numbers stands in `findings`.
    """

    def __init__(self, q: Any, r: Any, R: Any = None, rails: Sequence[Any] | None = None):
        self.q = _numbers("q", q)
        self.r = _numbers("r", r)
        if self.q.ndim != 2 or self.r.shape != (len(self.q), 3):
            raise ModelError(
                f"Measurements: found q of shape {self.q.shape} and r of shape {self.r.shape}, expected (N, n) and (N, 3), "
                "one row for each pose"
            )
        self.R = None if R is None else _orientations(R, len(self.q))
        self.rails = None if rails is None else tuple(_rail(k, rail) for k, rail in enumerate(rails))
        for array in (self.q, self.r, self.R, *(self.rails or ())):
            if array is not None:
                array.flags.writeable = False

    @classmethod
    def read(cls, path: str | Path, rails: Sequence[Any] | None = None) -> Self:
        """Measurements from a CSV file with the header q1..qn,x,y,z[,qw,qx,qy,qz], in m and rad.

        rails: as above, or paths of CSV files with the header q,x,y,z, one for each guideway. Empty cells count as NaN.
        Raises ModelError for another header or cells that are no numbers, with the line.
        """
        header, table = _table(Path(path))
        n = len(header) - 3 - 4 * (header[-4:] == list(_QUATERNION))
        expected = [f"q{k + 1}" for k in range(n)] + list(_POSITION)
        if n < 1 or header[: n + 3] != expected or len(header) not in (n + 3, n + 7):
            raise ModelError(
                f"{path}: found the header {','.join(header)}, expected q1,q2,q3,x,y,z as many q as actuators, then "
                "qw,qx,qy,qz if orientations were measured; write it as the first line"
            )
        q, r, R = table[:, :n], table[:, n : n + 3], table[:, n + 3 :] if len(header) > n + 3 else None
        read = [_rail_file(Path(r)) if isinstance(r, (str, Path)) else r for r in rails] if rails else None
        return cls(q, r, R, read)

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        more = "" if self.R is None else " with orientations"
        more += "" if self.rails is None else f", {len(self.rails)} guideways"
        return f"<Measurements: {len(self)} poses of {self.q.shape[1]} actuators{more}>"

    @cached_property
    def finite(self) -> np.ndarray:
        """Which rows hold numbers only, (N,)."""
        arrays = [self.q, self.r] if self.R is None else [self.q, self.r, self.R]
        with np.errstate(invalid="ignore", over="ignore"):
            if all(np.isfinite(array.sum()) for array in arrays):
                return np.ones(len(self), dtype=bool)
        good = np.isfinite(self.q).all(axis=1) & np.isfinite(self.r).all(axis=1)
        return np.asarray(good if self.R is None else good & np.isfinite(self.R).all(axis=(1, 2)))

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What is doubtful in these numbers, whatever the robot: kinds "nan", "duplicates", "stuck", "too few poses",
        "line", "plane", "millimetres", "rotations", "guideway".
        """
        return check_data(self.q, self.r, self.R, self.finite, self.rails)

    def select(self, rows: Any) -> "Measurements":
        """The measurements of some rows (indices, a slice or a mask), with all guideways."""
        if isinstance(rows, np.ndarray) and rows.dtype != bool and is_all(rows, len(self)):
            return self
        found = copy.copy(self)
        found.__dict__ = {"q": self.q[rows], "r": self.r[rows], "R": None if self.R is None else self.R[rows]}
        found.rails = self.rails
        return found


def is_all(rows: np.ndarray, count: int) -> bool:
    """Whether rising rows are all rows, which then need no copy."""
    return (
        len(rows) == count
        and (count == 0 or (rows[0] == 0 and rows[-1] == count - 1))
        and bool(np.all(np.diff(rows) == 1))
    )


def _numbers(name: str, values: Any) -> np.ndarray:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ModelError(
            f"Measurements: found {name} that is no array of numbers ({error}), expected rows of numbers"
        ) from None


def _orientations(R: Any, count: int) -> np.ndarray:
    found = _numbers("R", R)
    if found.shape == (count, 4):
        return _of_quaternions(found)
    if found.shape == (count, 3, 3):
        return found
    raise ModelError(
        f"Measurements: found R of shape {found.shape} for {count} poses, expected ({count}, 3, 3) rotation matrices or "
        f"({count}, 4) quaternions, scalar first"
    )


def _of_quaternions(u: np.ndarray) -> np.ndarray:
    """Rotation matrices (N, 3, 3) of quaternions (N, 4), scalar first, made of unit length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        w, x, y, z = (u / np.linalg.norm(u, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _rail(k: int, rail: Any) -> np.ndarray:
    found = _numbers(f"rails[{k}]", rail)
    if found.ndim != 2 or found.shape[1] != 4 or len(found) < 2 or not np.isfinite(found).all():
        raise ModelError(
            f"Measurements: found rails[{k}] of shape {found.shape}{'' if np.isfinite(found).all() else ' with NaN'}, "
            "expected finite (k, 4), the columns q, x, y, z of two points or more"
        )
    found = found[np.argsort(found[:, 0], kind="stable")]
    if np.any(np.diff(found[:, 0]) == 0):
        raise ModelError(
            f"Measurements: found rails[{k}] with several points at one q, expected one; average them first"
        )
    return found


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    """Header and numbers of a CSV file; empty cells are NaN."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [(k, row) for k, row in enumerate(csv.reader(file), 1) if row and "".join(row).strip()]
    except OSError as error:
        raise ModelError(f"{path}: found no file to read ({error.strerror}), expected a CSV file") from None
    if not lines:
        raise ModelError(f"{path}: found an empty file, expected a header and one line for each pose")
    header = [name.strip() for name in lines[0][1]]
    numbers = []
    for k, row in lines[1:]:
        if len(row) != len(header):
            raise ModelError(f"{path}: line {k} has {len(row)} cells, expected {len(header)} as the header")
        try:
            numbers.append([float(cell) if cell.strip() else np.nan for cell in row])
        except ValueError as error:
            raise ModelError(
                f"{path}: line {k}: {error}; expected numbers, with a point before decimals"
            ) from None
    return header, np.array(numbers).reshape(len(numbers), len(header))


def _rail_file(path: Path) -> np.ndarray:
    header, table = _table(path)
    if header != ["q", *_POSITION]:
        raise ModelError(f"{path}: found the header {','.join(header)}, expected q,x,y,z of a guideway")
    return table
