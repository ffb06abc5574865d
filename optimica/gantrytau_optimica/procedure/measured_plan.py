"""Measurements of a plan: laid over the poses it expects, told what is missing, judged by what was wanted."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import check_words
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import motion
from gantrytau_optimica.calibration.assessment.calibration_acceptance import (
    CalibrationVerdict,
    judge,
    told_by_tool,
)
from gantrytau_optimica.calibration.assessment.cross_validation import CrossValidation
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.data.mistakes import mistakes
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.diagnostics.device_frames import Motion
from gantrytau_optimica.calibration.diagnostics.tool_error import ToolError, tool_error
from gantrytau_optimica.fitting.finding import Finding, length_text
from gantrytau_optimica.procedure.calibration_plan import load_plan
from gantrytau_optimica.procedure.cells.planned_cell import PROGRAM, PlannedCell
from gantrytau_optimica.procedure.monte_carlo import matched

FAR = 0.02  # m and rad, by which actuators of a pose with the same number may be off
AS_PLANNED = 1e-6  # m, of digits in poses.csv: nothing measures that well
FEW = 3  # poses that hold a frame
OF_TAPE = 5  # deviations of the tape measure by which a tool may be off its nominal place
MATTERS = 0.1  # of the error that is wanted, by which a number that is not held may move the tool
NOISIER = 3.0  # times the noise that is foretold, more than which is not chance
REST = "Rest"

Frame = Literal["fitted", "base"]


@dataclass(frozen=True, eq=False)
class MeasuredPlan(Record):
    """Measurements of a plan, made ready for `calibrate`.

    measurements: in the frame of the plan, without rows that were left empty; rows: the measured poses of the plan that they
    are, (N,) from 0, -1 for none; motion: which laid measurements over the plan, None if they were in its frame; frame: of
    `calibrate`; target: where it is seen from the tool, in the base, (3,) in m; taken_off: whether positions were those of
    the target, in the base, and are the tool's now.
    """

    planned: PlannedCell
    measurements: Measurements
    rows: np.ndarray
    motion: Motion | None
    frame: Frame = "fitted"
    target: Any = (0.0, 0.0, 0.0)
    taken_off: bool = False

    @property
    def missing(self) -> list[int]:
        """Numbers in poses.csv of poses that were planned but are not measured."""
        plan = self.planned.plan
        return [int(plan.numbers[k]) for k in plan.missing(self.measurements)]

    @property
    def prior(self) -> dict[str, float] | None:
        """The prior of the plan's own simulations, for `calibrate`; None if it has none."""
        return dict(self.planned.plan.settings.get("prior") or {}) or None

    def expected(self, found: Calibration, orientation: Any = "local") -> ToolError:
        """The error of the tool to be expected at all planned poses, by those that were fitted."""
        plan, cell = self.planned.plan, self.planned.cell
        where = np.flatnonzero(plan.measured)
        turns = plan.kind != "three links"
        every = PoseArrays(plan.q[where], plan.r[where], plan.R[where] if turns else None)
        kept = np.setdiff1d(found.rows, found.left_out)
        kept = kept[self.rows[kept] >= 0]
        rows = self.rows[kept]
        fitted = PoseArrays(every.q[rows], every.r[rows], None if every.R is None else every.R[rows])
        return tool_error(
            cell.robot,
            fitted,
            every,
            noise=float(np.nanmax([found.noise, plan.prediction.noise])),
            angle=float(plan.prediction.noise_angle),
            tape=cell.tape,
            orientation=orientation,
            certainty=found.measurements.select(kept).certainty,
        )

    def judged(
        self, checked: CrossValidation, orientation: Any = "local"
    ) -> tuple[Calibration, CalibrationVerdict]:
        """The calibration, whose findings say what moves the tool, and whether it is good enough for the cell."""
        cell, expected = self.planned.cell, self.expected(checked.calibration, orientation)
        if self.motion is not None:
            checked = replace(checked, calibration=checked.calibration.measured_by(self.motion))
        found = told_by_tool(checked.calibration, expected, least=MATTERS * cell.wanted, tape=cell.tape)
        found = found.with_findings([*found.findings, *self._noisy(found)])
        return found, judge(checked, cell.wanted, expected=expected, tape=cell.tape)

    def _noisy(self, found: Calibration) -> Iterator[Finding]:
        """Noise that the device of the plan does not have."""
        foretold = self.planned.plan.prediction.noise
        if found.noise > NOISIER * foretold:
            yield Finding(
                "noise",
                found.rows,
                f"what is left needs noise of {length_text(found.noise)} in each coordinate, {length_text(foretold)} are "
                "foretold of the device; look at the other findings, at its settings, and whether robot and target stood "
                "still",
            )

    @property
    def rest_program(self) -> Path:
        """The program of the poses that are missing."""
        return self.planned.folder / REST.lower() / f"{self._rest_name}.mod"

    @property
    def _rest_name(self) -> str:
        return f"{self.planned.cell.program.get('name', PROGRAM)[: 32 - len(REST)]}{REST}"

    def write_rest(self) -> Path:
        """Write the plan of the poses that are missing in a folder of its own; its program."""
        cell = self.planned.cell
        plan = load_plan(self.planned.folder, cell.robot, cell.limits)
        options = dict(cell.program, name=self._rest_name)
        plan.remaining(self.measurements).write(self.rest_program.parent, **options)
        return self.rest_program

    @property
    def facts(self) -> Mapping[str, str]:
        """What a report says of cell and plan, in words by heading."""
        cell, settings = self.planned.cell, self.planned.plan.settings
        place = ", ".join(f"{x:.4g}" for x in np.asarray(settings["device_r"], dtype=float))
        return {
            "goal": f"{cell.wanted * 1e6:.4g} um, error of the tool in the mean over the workspace",
            "device": f"{settings['device']} at ({place}) m",
            "nominal values": f"known by a tape measure to {cell.tape * 1e3:.3g} mm",
            "plan": str(self.planned.folder),
        }


def measured_plan(
    planned: PlannedCell, measurements: Measurements, frame: Frame | None = None
) -> MeasuredPlan:
    """Measurements of a plan, in its frame.

        planned = load_planned_cell("cell-plan")
        measured = measured_plan(planned, Measurements.read("cell-plan/measurements.csv"))
        checked = cross_validate(planned.cell.robot, measured.measurements, prior=measured.prior, frame=measured.frame)
        found, verdict = measured.judged(checked)

    frame: that of the measurements, as of `calibrate`, by default what the cell says. Rows whose positions were left empty
    are not there. Positions in the base stay where they are; those of the target of a plate that cannot turn become those of
    the tool, unless they lie where the plan expects the tool itself. A "fitted" frame that is another is laid over the poses
    that the plan expects; positions that fit it in no frame stay as they are. Raises ModelError where actuators are not
    those of planned poses, positions are mirrored, those of the plan itself, or not in the base where they are said to be.
    """
    check_words(measured_plan, locals())
    chosen: Frame = frame or planned.cell.frame
    data = measurements.select(np.flatnonzero(~np.isnan(measurements.r).all(axis=1)))
    plan, rows = planned.plan, _rows(planned, data)
    if any(f.kind in ("millimetres", "guideway") for f in data.findings):
        return MeasuredPlan(planned, data, rows, None, chosen)
    known = rows >= 0
    expected, near = plan.r[plan.measured][rows[known]], OF_TAPE * planned.cell.tape
    _check_measured(data.r[known], expected)
    target = _target(planned)
    as_tool, as_target = (_apart(data.r[known] - off, expected) for off in (0.0, target))
    if as_target < near:
        return MeasuredPlan(planned, data.shifted(-target), rows, None, chosen, target, bool(target.any()))
    if as_tool < near:
        return MeasuredPlan(planned, data, rows, None, chosen, target)
    if chosen == "base":
        raise ModelError(
            f"found positions {min(as_tool, as_target):.3g} m off the poses of the plan beside it in the median, expected "
            f"{near:.3g} m at most where ",
            Given("frame", "base"),
            "; take ",
            Given("frame", "fitted"),
            " for another frame",
            argument="frame",
        )
    placed = plan.placed(data)
    if not _apart(placed.r[known], expected) < near:
        _check_axes(planned, data, expected, known)
        return MeasuredPlan(planned, data, rows, None)
    good = np.isfinite(data.r).all(axis=1)
    return MeasuredPlan(planned, placed, rows, Motion(*motion(data.r[good], placed.r[good]), placed=True))


def _target(planned: PlannedCell) -> np.ndarray:
    """From the tool to what the device measures, in the base, (3,) in m; zero of plates that turn, whose tool it finds."""
    plan = planned.plan
    if plan.kind != "three links":
        return np.zeros(3)
    return plan.R[0] @ np.asarray(planned.cell.device.target, dtype=float)


def _check_measured(r: np.ndarray, expected: np.ndarray) -> None:
    """ModelError if positions are those that the plan expects, to the last digit of its file."""
    if len(r) >= FEW and np.nanmax(np.abs(r - expected), initial=0.0) < AS_PLANNED:
        raise ModelError(
            "found x, y, z as the plan expects them, expected what was measured; fill in the cells of "
            "measurements-template.csv"
        )


def _check_axes(planned: PlannedCell, data: Measurements, expected: np.ndarray, known: np.ndarray) -> None:
    """ModelError if positions fit the plan once they are mirrored, which no frame does."""
    mirrored = Measurements(data.q, data.r[:, [1, 0, 2]])
    if _apart(planned.plan.placed(mirrored).r[known], expected) < OF_TAPE * planned.cell.tape:
        raise ModelError(
            "found positions that mirror the poses of the plan beside it; two of the columns x, y, z are swapped, or one "
            "has the wrong sign; correct the columns"
        )


def _rows(planned: PlannedCell, data: Measurements) -> np.ndarray:
    """The planned pose of each row, -1 for none."""
    plan = planned.plan
    q, expected = data.q, plan.q[plan.measured]
    if q.shape[1] != expected.shape[1]:
        raise ModelError(
            f"found {q.shape[1]} actuators, expected {expected.shape[1]} as the plan beside it, in the order "
            f"{', '.join(plan.joints)}; check the columns q1, q2, ..."
        )
    rows = _by_number(planned, data) if data.numbers is not None else matched(q, expected)
    good = data.finite
    if np.count_nonzero(rows[good] >= 0) >= min(FEW, np.count_nonzero(good)):
        return rows
    words = _mistake(data, expected, plan.carts) or "q1, q2, ... must be those of poses.csv"
    raise ModelError(
        f"found no actuator positions of the plan beside it; {words}; for measurements of other poses name the robot, ",
        Given("robot", planned.cell.name),
    )


def _by_number(planned: PlannedCell, data: Measurements) -> np.ndarray:
    """The same by the numbers of poses; ModelError for a number whose pose is another."""
    plan = planned.plan
    assert data.numbers is not None
    known, expected = plan.numbers[plan.measured].tolist(), plan.q[plan.measured]
    rows = np.array([known.index(n) if n in known else -1 for n in data.numbers.tolist()], dtype=int)
    off = np.where(rows >= 0, np.abs(data.q - expected[rows]).max(axis=1), 0.0)
    wrong = np.flatnonzero(off > FAR)
    if wrong.size and wrong.size < len(rows) / 2:  # of more the columns are wrong
        k = wrong[0]
        where = f"row {k}" if data.lines is None else f"line {data.lines[k]}"
        raise ModelError(
            f"{where} has number {data.numbers[k]} and q = {_told(data.q[k])}, expected {_told(expected[rows[k]])} as in "
            "poses.csv; correct the number or q"
        )
    return np.where(off > FAR, -1, rows)


def _mistake(data: Measurements, expected: np.ndarray, carts: int) -> str:
    """The mistake in q alone without which most rows are planned poses; nothing where there is none."""
    for mistake in mistakes(carts, data.q.shape[1] - carts, turns=False):
        q, r, _ = mistake.undo(data.q, data.r, None)
        if np.array_equal(r, data.r, equal_nan=True) and np.mean(matched(q, expected) >= 0) > 0.5:
            return f"undo this: {mistake.words}"
    return ""


def _told(q: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in q) + ")"


def _apart(r: np.ndarray, expected: np.ndarray) -> float:
    """Distance of most positions from where they are expected, m."""
    found = np.linalg.norm(r - expected, axis=1)
    return float(np.nanmedian(found)) if np.isfinite(found).any() else np.inf
