"""Measured poses for calibration: actuator positions, tool positions, orientations, guideways."""

import copy
import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau.border.columns import Columns
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import of_quaternions, quaternions
from gantrytau.whole_files import replacing
from gantrytau_optimica.calibration.data.data_checks import check_data
from gantrytau_optimica.fitting.finding import Finding

_POSITION = ("x", "y", "z")
_QUATERNION = ("qw", "qx", "qy", "qz")
_COVARIANCE = {"cxx": (0, 0), "cxy": (0, 1), "cxz": (0, 2), "cyy": (1, 1), "cyz": (1, 2), "czz": (2, 2)}
LEAST_SPREAD = 0.1  # of the mean, along an axis: no device is that much surer along one
_ACTUATOR = re.compile(r"q[1-9]\d*")


class Measurements(Record):
    """Measured poses of a robot, and measured guideways. SI units; the first axis is the pose.

    q: actuator positions (N, n), carts in m first, then angles in rad; r: tool positions (N, 3) in m; R: orientations of
    the plate (N, 3, 3), world = R @ plate, or unit quaternions (N, 4), scalar first, or None; rails: for each guideway
    (k, 4) the columns q, x, y, z of points measured along it, k from 2, in any frame, or None. numbers: of the poses in
    a plan (N,), or None; lines: of the rows in the file that they were read from (N,), or None; covariance: of r,
    (N, 3, 3) in m2, where a device says how sure each is (`uncertain`), or None for poses that are all as sure; shared:
    factors F (N, 3, k) in m of what positions have in common of it, cov(r_i, r_j) = F_i F_j', or None.
    Arrays are copied and cannot be written to. Raises ModelError for shapes that do not fit; what is doubtful about the
    numbers stands in `findings`.
    """

    def __init__(
        self, q: Any, r: Any, R: Any = None, rails: Sequence[Any] | None = None, *, numbers: Any = None
    ):
        self.q = array("Measurements", "q", q, (None, None), finite=False)
        self.r = array("Measurements", "r", r, (len(self.q), 3), finite=False)
        self.R = None if R is None else _orientations(R, len(self.q))
        self.rails = None if rails is None else tuple(_rail(k, rail) for k, rail in enumerate(rails))
        self.numbers = None if numbers is None else np.array(numbers, dtype=int).reshape(len(self.q))
        self.lines: np.ndarray | None = None
        self.covariance: np.ndarray | None = None
        self.shared: np.ndarray | None = None
        for values in (self.q, self.r, self.R, *(self.rails or ())):
            if values is not None:
                values.flags.writeable = False

    @classmethod
    def read(cls, path: str | Path, rails: Sequence[Any] | None = None) -> Self:
        """Measurements from a CSV file with the columns q1..qn, x, y, z and perhaps qw, qx, qy, qz, in m and rad.

        Columns are known by the names in the first line, in any order. `number` is that of a pose in a plan; rows whose
        `measured` is 0 are left out; columns with other names are not read. Cells are separated by commas, or by
        semicolons or tabs: then decimals may have a comma. Empty cells count as NaN. cxx, cxy, cxz, cyy, cyz and czz are
        the covariance of a position in m2. rails: as above, or paths of CSV
        files with the columns q, x, y, z, one for each guideway.
        Raises ModelError for columns that are missing and cells that are no numbers, with the line.
        """
        table = Columns.read(path, "one line for each pose")
        _check_names(table)
        if "measured" in table:
            table = table.select(table.column("measured", "1") != 0)
        joints = [f"q{k + 1}" for k in range(sum(bool(_ACTUATOR.fullmatch(name)) for name in table.names))]
        q = np.column_stack([table.column(name, "m", "rad") for name in joints])
        r = np.column_stack([table.column(name, "m") for name in _POSITION])
        R = np.column_stack([table.column(name, "1") for name in _QUATERNION]) if "qw" in table else None
        read = [_rail_file(Path(r)) if isinstance(r, (str, Path)) else r for r in rails] if rails else None
        numbers = _whole(table.column("number", "1")) if "number" in table else None
        found = cls(q, r, R, read, numbers=numbers)
        found.lines = table.lines
        if all(name in table for name in _COVARIANCE):
            covariance = np.empty((len(found), 3, 3))
            for name, (i, j) in _COVARIANCE.items():
                covariance[:, i, j] = covariance[:, j, i] = table.column(name, "m2")
            return found.uncertain(covariance)
        return found

    def write(self, path: str | Path) -> None:
        """Write the CSV file that `read` reads, without guideways."""
        columns = {} if self.numbers is None else {"number": self.numbers}
        columns |= {f"q{k + 1}": column for k, column in enumerate(self.q.T)}
        columns |= dict(zip(_POSITION, self.r.T, strict=True))
        if self.R is not None:
            columns |= dict(zip(_QUATERNION, quaternions(self.R).T, strict=True))
        if self.covariance is not None:
            columns |= {name: self.covariance[:, i, j] for name, (i, j) in _COVARIANCE.items()}
        rows = np.column_stack(list(columns.values()))
        with replacing(path) as partial:
            np.savetxt(partial, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")

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
            if all(np.isfinite(values.sum()) for values in arrays):
                return np.ones(len(self), dtype=bool)
        good = np.isfinite(self.q).all(axis=1) & np.isfinite(self.r).all(axis=1)
        return np.asarray(good if self.R is None else good & np.isfinite(self.R).all(axis=(1, 2)))

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings in these measurements, whatever the robot: kinds "nan", "duplicates", "stuck", "too few poses",
        "line", "plane", "millimetres", "rotations", "guideway".
        """
        return check_data(self.q, self.r, self.R, self.finite, self.rails)

    def shifted(self, offset: np.ndarray) -> Self:
        """The measurements with positions moved by an offset, (3,) in m."""
        found = self.select(slice(None))
        found.r = self.r + offset
        found.r.flags.writeable = False
        return found

    def select(self, rows: Any) -> Self:
        """The measurements of some rows (indices, a slice or a mask), with all guideways."""
        if isinstance(rows, np.ndarray) and rows.dtype != bool and is_all(rows, len(self)):
            return self
        found = copy.copy(self)
        found.__dict__ = {"q": self.q[rows], "r": self.r[rows], "R": None if self.R is None else self.R[rows]}
        found.rails = self.rails
        found.numbers = None if self.numbers is None else self.numbers[rows]
        found.lines = None if self.lines is None else self.lines[rows]
        found.covariance = None if self.covariance is None else self.covariance[rows]
        found.shared = None if self.shared is None else self.shared[rows]
        return found

    def uncertain(self, covariance: Any, shared: Any = None) -> Self:
        """The measurements with covariances of their positions, (N, 3, 3) in m2: `calibrate` believes sure ones more.

        shared: F (N, 3, k) in m, the part F_i F_j' that errors of positions have in common, as by cameras.
        Raises ModelError for other shapes, and for covariances of finite positions that are not finite and above zero.
        """
        given = array("Measurements", "covariance", covariance, (len(self), 3, 3), finite=False)
        known = np.isfinite(self.r).all(axis=1)
        wrong = np.flatnonzero(known & ~(np.trace(given, axis1=1, axis2=2) > 0))
        if wrong.size or not np.all(np.isfinite(given[known])):
            first = (*wrong, *np.flatnonzero(known & ~np.isfinite(given).all(axis=(1, 2))))[0]
            raise ModelError(
                f"Measurements: found a covariance that is not finite or not above zero, the first in row {first}, expected "
                "squares of m",
                argument="covariance",
            )
        found = self.select(slice(None))
        found.covariance = given
        found.covariance.flags.writeable = False
        if shared is not None and np.size(shared):
            found.shared = array("Measurements", "shared", shared, (len(self), 3, None))
        return found

    @property
    def _own(self) -> np.ndarray:
        """Covariances of positions without what they share, (N, 3, 3)."""
        assert self.covariance is not None
        if self.shared is None:
            return self.covariance
        rest = self.covariance - self.shared @ np.swapaxes(self.shared, 1, 2)
        least = LEAST_SPREAD**2 * np.trace(self.covariance, axis1=1, axis2=2) / 3
        return rest + np.maximum(least - np.trace(rest, axis1=1, axis2=2) / 3, 0.0)[:, None, None] * np.eye(3)

    @property
    def deviation(self) -> float | None:
        """Told deviation of a coordinate of a pose of median covariance, m, without what poses share."""
        if self.covariance is None:
            return None
        return float(np.nanmedian(np.sqrt(np.trace(self._own, axis1=1, axis2=2) / 3)))

    @property
    def distances(self) -> np.ndarray:
        """Of positions from their middle, (N,) in m."""
        return np.linalg.norm(self.r - self.r.mean(axis=0), axis=1)

    @property
    def certainty(self) -> np.ndarray | None:
        """Weights of poses, (N,), 1 for one of median covariance; None where all are as sure."""
        if self.covariance is None:
            return None
        size = np.sqrt(np.trace(self._own, axis1=1, axis2=2))
        return np.nan_to_num(np.nanmedian(size) / size, nan=1.0)

    @property
    def spreads(self) -> np.ndarray | None:
        """Square roots of the covariances of positions, (N, 3, 3): 1 for one alike along all axes and of median size; None
        where all are as sure.
        """
        if self.covariance is None:
            return None
        size = np.sqrt(np.trace(self._own, axis1=1, axis2=2))
        values, axes = np.linalg.eigh(np.nan_to_num(3 * self._own / np.nanmedian(size) ** 2))
        values = np.maximum(values, LEAST_SPREAD**2 * values.mean(axis=1, keepdims=True))
        return (axes * np.sqrt(values)[:, None]) @ np.swapaxes(axes, 1, 2)


def is_all(rows: np.ndarray, count: int) -> bool:
    """Whether rising rows are all rows, which then need no copy."""
    return (
        len(rows) == count
        and (count == 0 or (rows[0] == 0 and rows[-1] == count - 1))
        and bool(np.all(np.diff(rows) == 1))
    )


def _orientations(R: Any, count: int) -> np.ndarray:
    """Rotation matrices (N, 3, 3) of these, or of quaternions (N, 4), scalar first."""
    found = array("Measurements", "R", R, (count, 3, 3), (count, 4), finite=False)
    if found.ndim == 3:
        return found
    with np.errstate(invalid="ignore", divide="ignore"):
        return of_quaternions(found / np.linalg.norm(found, axis=1, keepdims=True))


def _rail(k: int, rail: Any) -> np.ndarray:
    name = f"rails[{k}]"
    found = array("Measurements", name, rail, (None, 4))
    found = found[np.argsort(found[:, 0], kind="stable")]
    if len(found) < 2 or np.any(np.diff(found[:, 0]) == 0):
        raise ModelError(
            "expected q, x, y, z of two points or more, one at each q; average them first",
            place="Measurements",
            found=Given(name, rail),
        )
    return found


def _check_names(table: Columns) -> None:
    """ModelError for columns of measurements that are missing."""
    joints = [name for name in table.names if _ACTUATOR.fullmatch(name)]
    expected = [f"q{k + 1}" for k in range(max(1, len(joints)))] + list(_POSITION)
    if any(name in table for name in _QUATERNION):
        expected += _QUATERNION
    if missing := [name for name in expected if name not in table]:
        raise ModelError(
            f"{table.path}: found the header {','.join(table.names)}: found no column {', '.join(missing)}, expected "
            "q1,q2,q3,x,y,z, as many q as actuators, and qw,qx,qy,qz if orientations were measured; write these names in "
            "the first line"
        )


def _whole(numbers: np.ndarray) -> np.ndarray:
    """Numbers of poses, -1 for none."""
    whole = np.isfinite(numbers) & (numbers == np.round(numbers)) & (np.abs(numbers) < 1e9)
    return np.where(whole, numbers, -1).astype(int)


def _rail_file(path: Path) -> np.ndarray:
    table = Columns.read(path, "one line for each point")
    if missing := [name for name in ("q", *_POSITION) if name not in table]:
        raise ModelError(f"{path}: found no column {', '.join(missing)}, expected q,x,y,z of a guideway")
    return np.column_stack([table.column("q", "m", "rad"), *(table.column(x, "m") for x in _POSITION)])


def thinned(count: int, poses: int = 200) -> np.ndarray:
    """At most `poses` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, poses)).astype(int))
