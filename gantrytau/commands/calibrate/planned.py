"""Measurements of a plan: laid over the poses it expects, told what is missing, judged by what was wanted."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.commands.calibrate import cell as cells
from gantrytau.commands.calibrate.cell import Cell
from gantrytau.commands.calibrate.measured import OF_GUIDEWAYS, Measured
from gantrytau.commands.calibrate.planning import CELL, PROGRAM
from gantrytau.commands.reporting import CommandError
from gantrytau.errors import ModelError

SAME = 1e-4  # m and rad, by which measured actuators may be off those of the plan
FEW = 3  # poses that hold a frame
OF_TAPE = 5  # deviations of the tape measure by which a tool may be off its nominal place
REST = "Rest"


@dataclass(frozen=True)
class Planned:
    """A plan beside a file of measurements, and the cell it was made for."""

    plan: Any
    cell: Cell
    folder: Path

    @staticmethod
    def beside(file: Path) -> "Planned | None":
        """The plan in the folder of a file, if there is one; CommandError if it cannot be read."""
        folder = file.absolute().parent
        if not (folder / CELL).is_file() or not (folder / "plan.json").is_file():
            return None
        from gantrytau_optimica import load_plan

        cell = cells.read(folder / CELL)
        try:
            return Planned(load_plan(folder), cell, folder)
        except ModelError as error:
            raise CommandError(f"{folder}: the plan cannot be used: {error}") from error

    def placed(self, measured: Measured) -> tuple[Measured, str]:
        """Measurements in the frame of the plan, and words about it if they were in another.

        Positions in the world, and those that fit the plan in no frame, stay as they are. ModelError where actuators are
        not those of planned poses.
        """
        data, rows = measured.data, self._rows(measured)
        if len(data.findings) and any(f.kind in ("millimetres", OF_GUIDEWAYS) for f in data.findings):
            return measured, ""
        known = rows >= 0
        expected, near = self.plan.r[self.plan.measured][rows[known]], OF_TAPE * self.cell.tape
        if _apart(data.r[known], expected) < near:
            return measured, ""
        placed = self.plan.placed(data)
        if not _apart(placed.r[known], expected) < near:
            self._check_axes(measured, known, expected, near)
            return measured, ""
        words = "positions are in another frame than the plan; they were laid over the poses that it expects"
        return replace(measured, data=placed), words

    def _check_axes(self, measured: Measured, known: np.ndarray, expected: np.ndarray, near: float) -> None:
        """ModelError if positions fit the plan once they are mirrored, which no frame does."""
        data = measured.data
        mirrored = type(data)(data.q, data.r[:, [1, 0, 2]])
        if _apart(self.plan.placed(mirrored).r[known], expected) < near:
            raise ModelError(
                f"{measured.file}: found positions that mirror the poses of the plan beside it; two of the columns x, y, z "
                "are swapped, or one has the wrong sign; correct the columns. Nothing was written"
            )

    def _rows(self, measured: Measured) -> np.ndarray:
        """The planned pose of each row, -1 for none."""
        q, planned = measured.data.q, self.plan.q[self.plan.measured]
        if q.shape[1] != planned.shape[1]:
            raise ModelError(
                f"{measured.file}: found {q.shape[1]} actuators, expected {planned.shape[1]} as the plan beside it, in the "
                f"order {', '.join(self.plan.joints)}; check the columns q1, q2, ..."
            )
        rows = nearest(q, planned)
        good = measured.data.finite
        if np.count_nonzero(rows[good] >= 0) >= min(FEW, np.count_nonzero(good)):
            return rows
        words = next(
            (words for words, other in _mistakes(q) if np.mean(nearest(other, planned) >= 0) > 0.5), ""
        )
        remedy = words or "q1, q2, ... must be those of poses.csv"
        raise ModelError(
            f"{measured.file}: found no actuator positions of the plan beside it; {remedy}; for measurements of other poses "
            f"name the robot, --robot '{self.cell.name}'. Nothing was written"
        )

    def missing(self, measured: Measured) -> list[int]:
        """Numbers in poses.csv of poses that were planned but are not measured."""
        return [int(k) + 1 for k in self.plan.missing(measured.data)]

    def write_rest(self, measured: Measured) -> Path:
        """Write the plan of the poses that are missing, in a folder of its own; its program."""
        options = dict(self.cell.program)
        name = f"{options.pop('name', PROGRAM)[: 32 - len(REST)]}{REST}"
        from gantrytau_optimica import load_plan

        folder = self.folder / REST.lower()
        plan = load_plan(self.folder, self.cell.robot, self.cell.limits)
        try:
            plan.remaining(measured.data).write(folder, name=name, **options)
        except OSError as error:
            raise CommandError(f"Cannot write into {folder}: {error.strerror}") from error
        return folder / f"{name}.mod"


def nearest(q: np.ndarray, planned: np.ndarray) -> np.ndarray:
    """The planned pose with the actuators of each row, -1 for none."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(q[:, None] - planned).max(axis=2)
    apart = np.where(np.isnan(apart), np.inf, apart)
    return np.where(apart.min(axis=1) <= SAME, apart.argmin(axis=1), -1)


def _mistakes(q: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """What may have been done to q, and q with that undone."""
    yield "they are in mm, expected m", q * 1e-3
    columns = range(q.shape[1])
    for order in permutations(columns) if len(columns) <= FEW else _swaps(len(columns)):
        words = [f"q{k + 1} stands in column q{c + 1}" for k, c in enumerate(order) if k != c]
        if words:
            yield ", ".join(words), q[:, list(order)]


def _swaps(count: int) -> Iterator[list[int]]:
    for i in range(count):
        for k in range(i + 1, count):
            order = list(range(count))
            order[i], order[k] = k, i
            yield order


def _apart(r: np.ndarray, expected: np.ndarray) -> float:
    """Distance of most positions from where they are expected, m."""
    found = np.linalg.norm(r - expected, axis=1)
    return float(np.nanmedian(found)) if np.isfinite(found).any() else np.inf
