"""The automated calibration procedure: from a tape measure to a robot program whose poses are safe, visible and enough.

Dressler (2012), section 5.6. `plan_calibration` runs the stages one after another: `workspace_resolution`, `candidates`,
`pose_choice`, `tours` on `clear_ways`, `trials`, `plan_verdict`; `stages` keeps what is finished in a folder; `pose_plan` is
the result, which `documents` write and `calibration_plan` hands over. `cells` are the files that say what is to be planned,
`measured_plan` what became of it. A robot before its calibration is known to the tape measure only: whatever has to be safe
is asked of a `fleet` of robots that the tape measure cannot tell apart.
"""

from gantrytau_optimica.procedure.calibration_plan import CalibrationPlan, load_plan
from gantrytau_optimica.procedure.cells.cell_example import cell_example
from gantrytau_optimica.procedure.cells.cell_file import Cell, read_cell
from gantrytau_optimica.procedure.cells.planned_cell import (
    PlannedCell,
    is_planned,
    load_planned_cell,
    plan_cell,
)
from gantrytau_optimica.procedure.measured_plan import MeasuredPlan, measured_plan
from gantrytau_optimica.procedure.plan_calibration import plan_calibration

__all__ = [
    "CalibrationPlan",
    "Cell",
    "MeasuredPlan",
    "PlannedCell",
    "cell_example",
    "is_planned",
    "load_plan",
    "load_planned_cell",
    "measured_plan",
    "plan_calibration",
    "plan_cell",
    "read_cell",
]
