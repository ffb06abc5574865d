"""A cell and the plan that was made for it, in a folder of their own."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau.whole_files import replacing
from gantrytau_optimica.procedure.calibration_plan import CalibrationPlan, load_plan
from gantrytau_optimica.procedure.cells.cell_file import Cell, Robot, read_cell
from gantrytau_optimica.procedure.documents.files import TEMPLATE
from gantrytau_optimica.procedure.plan_calibration import plan_calibration
from gantrytau_optimica.procedure.stages import Progress

CELL = "plan.toml"  # in the folder of a plan: the cell that it was made for
PROGRAM = "Calibration"
MEASUREMENTS = "measurements.csv"
SAME = 1e-6  # m and rad, by which poses of the same plan may differ


@dataclass(frozen=True, eq=False)
class PlannedCell(Record):
    """A cell, the plan that was made for it, and their folder."""

    cell: Cell
    plan: CalibrationPlan
    folder: Path

    @property
    def files(self) -> list[Path]:
        """What stands in the folder for who carries the plan out."""
        program = f"{self.cell.program.get('name', PROGRAM)}.mod"
        names = ("plan.html", "workspace.png", "poses.csv", TEMPLATE, program, "plan.json", CELL)
        return [self.folder / name for name in names if (self.folder / name).is_file()]

    @property
    def measurements(self) -> Path:
        """Where its measurements belong."""
        return self.folder / MEASUREMENTS

    @property
    def template(self) -> Path:
        """The file of measurements to be filled in."""
        return self.folder / TEMPLATE


def plan_cell(cell: Cell, folder: str | Path, *, progress: Progress | None = None) -> PlannedCell:
    """Plan the calibration of a cell, and write the plan with all its files into a folder.

        planned = plan_cell(read_cell("cell.toml"), "cell-plan")
        print(planned.plan)

    progress, and going on after an interruption: as of `plan_calibration`. Raises ModelError as that, and where the folder
    holds measurements of other poses, which this plan would make worthless.
    """
    folder = Path(folder)
    plan = plan_calibration(
        cell.robot, cell.limits, cell.device, folder=folder, progress=progress, **cell.policy
    )
    planned = PlannedCell(cell, plan, folder)
    _protect(planned)
    plan.write(folder, **cell.program)
    with replacing(folder / CELL) as partial:
        partial.write_text(cell.copied(), encoding="utf-8")
    return planned


def load_planned_cell(folder: str | Path, robot: Robot | None = None) -> PlannedCell:
    """The cell and the plan that `plan_cell` left in a folder; robot: as of `read_cell`. ModelError where there is none."""
    folder = Path(folder)
    cell = read_cell(folder / CELL, robot)
    try:
        return PlannedCell(cell, load_plan(folder), folder)
    except ModelError as error:
        raise ModelError(f"{folder}: the plan cannot be used: {error}") from error


def is_planned(folder: Path) -> bool:
    """Whether `plan_cell` left a plan in a folder."""
    return (folder / CELL).is_file() and (folder / "plan.json").is_file()


def _protect(planned: PlannedCell) -> None:
    """ModelError if the folder holds measurements of other poses."""
    if not planned.measurements.is_file() or not (planned.folder / "plan.json").is_file():
        return
    earlier, found = load_plan(planned.folder).q, planned.plan.q
    if earlier.shape != found.shape or np.abs(earlier - found).max() > SAME:
        raise ModelError(
            f"{planned.measurements}: found measurements of an earlier plan with other poses; nothing was written. Name "
            "another folder, or move the measurements away",
            argument="folder",
        )
