"""Measurements of a plan: laid over the poses it expects, told what is missing, judged by what was wanted."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.commands.calibrate import cell_file as cells
from gantrytau.commands.calibrate.cell_file import Cell
from gantrytau.commands.calibrate.measurement_file import OF_GUIDEWAYS, Measured
from gantrytau.commands.calibrate.plan_command import CELL, PROGRAM
from gantrytau.commands.printing.reporting import CommandError

SAME = 1e-4  # m and rad, by which measured actuators may be off those of the plan
FAR = 0.02  # m and rad, by which actuators of a pose with the same number may be off
AS_PLANNED = 1e-6  # m, of digits in poses.csv: nothing measures that well
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

    def seen(self, measured: Measured) -> Measured:
        """Measurements without the rows that were left empty: poses that were not measured."""
        data = measured.data
        rows = np.flatnonzero(~np.isnan(data.r).all(axis=1))
        return replace(measured, data=data.select(rows), lines=measured.lines[rows])

    def placed(self, measured: Measured) -> tuple[Measured, Any]:
        """Measurements in the frame of the plan, and the motion that brought them there if they were in another, or None.

        Positions in the world, and those that fit the plan in no frame, stay as they are. ModelError where actuators are
        not those of planned poses.
        """
        data, rows = measured.data, self._rows(measured)
        if len(data.findings) and any(f.kind in ("millimetres", OF_GUIDEWAYS) for f in data.findings):
            return measured, None
        known = rows >= 0
        expected, near = self.plan.r[self.plan.measured][rows[known]], OF_TAPE * self.cell.tape
        self._check_measured(measured, known, expected)
        if _apart(data.r[known], expected) < near:
            return measured, None
        placed = self.plan.placed(data)
        if not _apart(placed.r[known], expected) < near:
            self._check_axes(measured, known, expected, near)
            return measured, None
        return replace(measured, data=placed), _motion(data.r, placed.r)

    def _check_measured(self, measured: Measured, known: np.ndarray, expected: np.ndarray) -> None:
        """ModelError if positions are those that the plan expects, to the last digit of its file."""
        r = measured.data.r[known]
        if len(r) >= FEW and np.nanmax(np.abs(r - expected), initial=0.0) < AS_PLANNED:
            raise ModelError(
                f"{measured.file}: found x, y, z as the plan expects them, expected what was measured; fill in the cells "
                "of measurements-template.csv. Nothing was written"
            )

    def with_prior(self, policy: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
        """Keywords of `calibrate` with the prior of the plan's own simulations, unless another was given; words on it."""
        prior = self.plan.settings.get("prior")
        if policy["prior"] is not None or not prior or policy["model"] is not None:
            return policy, []
        told = ", ".join(f"{name}={value:g}" for name, value in prior.items())
        return dict(policy, prior=dict(prior)), [f"prior: {told}, as the plan expects"]

    def tool_error(self, measured: Measured, found: Any, orientation: Any) -> Any:
        """The error of the tool to be expected at all planned poses, by those that were fitted."""
        from gantrytau_optimica.calibration.design.identifiability import Poses
        from gantrytau_optimica.calibration.judging.tool_error import tool_error

        plan = self.plan
        where = np.flatnonzero(plan.measured)
        turns = plan.kind != "three links"
        every = Poses(plan.q[where], plan.r[where], plan.R[where] if turns else None)
        rows = self._rows(measured)[np.setdiff1d(found.rows, found.left_out)]
        rows = rows[rows >= 0]
        fitted = Poses(every.q[rows], every.r[rows], None if every.R is None else every.R[rows])
        noise = np.nanmax([found.noise, plan.prediction.noise])
        return tool_error(
            self.cell.robot,
            fitted,
            every,
            noise=float(noise),
            angle=float(plan.prediction.noise_angle),
            tape=self.cell.tape,
            orientation=orientation,
        )

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
        rows = self._by_number(measured) if measured.data.numbers is not None else nearest(q, planned)
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

    def _by_number(self, measured: Measured) -> np.ndarray:
        """The same by the numbers of poses; ModelError for a number whose pose is another."""
        data, known = measured.data, self.plan.numbers[self.plan.measured].tolist()
        rows = np.array([known.index(n) if n in known else -1 for n in data.numbers.tolist()], dtype=int)
        planned = self.plan.q[self.plan.measured]
        off = np.where(rows >= 0, np.abs(data.q - planned[rows]).max(axis=1), 0.0)
        wrong = np.flatnonzero(off > FAR)
        if wrong.size and wrong.size < len(rows) / 2:  # of more the columns are wrong
            k = wrong[0]
            raise ModelError(
                f"{measured.file}: line {measured.lines[k]} has number {data.numbers[k]} and q = {_told(data.q[k])}, "
                f"expected {_told(planned[rows[k]])} as in poses.csv; correct the number or q. Nothing was written"
            )
        return np.where(off > FAR, -1, rows)

    def missing(self, measured: Measured) -> list[int]:
        """Numbers in poses.csv of poses that were planned but are not measured."""
        return [int(self.plan.numbers[k]) for k in self.plan.missing(measured.data)]

    @property
    def rest_program(self) -> Path:
        """The program of the poses that are missing."""
        return self.folder / REST.lower() / f"{self._rest_name}.mod"

    @property
    def _rest_name(self) -> str:
        return f"{self.cell.program.get('name', PROGRAM)[: 32 - len(REST)]}{REST}"

    def write_rest(self, measured: Measured) -> None:
        """Write the plan of the poses that are missing, in a folder of its own."""
        from gantrytau_optimica import load_plan

        options = dict(self.cell.program, name=self._rest_name)
        folder = self.rest_program.parent
        plan = load_plan(self.folder, self.cell.robot, self.cell.limits)
        try:
            plan.remaining(measured.data).write(folder, **options)
        except OSError as error:
            raise CommandError(f"Cannot write into {folder}: {error.strerror}") from error


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


def _told(q: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in q) + ")"


def _motion(r: np.ndarray, placed: np.ndarray) -> Any:
    """The rigid motion that was made of positions (N, 3)."""
    from gantrytau_optimica.calibration.judging.plausibility import motion
    from gantrytau_optimica.calibration.report.report import Motion

    good = np.isfinite(r).all(axis=1)
    return Motion(*motion(r[good], placed[good]))


def _apart(r: np.ndarray, expected: np.ndarray) -> float:
    """Distance of most positions from where they are expected, m."""
    found = np.linalg.norm(r - expected, axis=1)
    return float(np.nanmedian(found)) if np.isfinite(found).any() else np.inf
