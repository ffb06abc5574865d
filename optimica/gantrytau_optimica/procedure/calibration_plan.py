"""What the procedure plans: poses in a safe order, what to expect of their calibration, and files for who carries it out."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.kinematics import Limits
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.documents.rapid import OPERATOR, rapid_program
from gantrytau_optimica.procedure.fleet import Fleet
from gantrytau_optimica.procedure.pose_choice import Choice
from gantrytau_optimica.procedure.trials import Trials, matched, placed
from gantrytau_optimica.procedure.verdict import Verdict, um
from gantrytau_optimica.procedure.ways.tours import Roadmap, find_tour
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace


@dataclass(frozen=True, eq=False)
class Cell:
    """What a plan was made from and its file does not hold: robots, limits, device, candidates."""

    fleet: Fleet
    limits: Limits
    device: Device | None = None
    candidates: Candidates | None = None


@dataclass(frozen=True, eq=False)
class CalibrationPlan:
    """Poses to measure and what to expect of them; lengths in m, angles in rad.

    q (k, n), r (k, 3), R (k, 3, 3): the program, from home to home, and where the nominal robot then is; measured (k,):
    whether the device measures there, else the pose is only passed. workspace: its size, on which grid; prediction: the
    choice of poses with `.position` (error expected over the workspace), `.error`, `.condition` and `.observability`;
    trials: simulated calibrations, `.before` and `.after`; verdict: `.good` and `.reasons`. lost: poses that were wanted,
    (m, 3), but cannot be reached without a collision. kind, joints, carts, parameters: of the robot; settings: what was
    asked for. unseen (j, 3): safe places that the device does not see in all robots. cell: None where the plan was loaded
    without its robot. numbers (k,): of the rows of the program in poses.csv, counted from 1; of what is left of a plan
    they are those of the whole plan.
    """

    robot_name: str
    kind: str
    joints: tuple[str, ...]
    carts: int
    parameters: Mapping[str, Any]
    settings: Mapping[str, Any]
    workspace: SettledWorkspace
    q: np.ndarray
    r: np.ndarray
    R: np.ndarray
    measured: np.ndarray
    prediction: Choice
    trials: Trials
    verdict: Verdict
    lost: np.ndarray
    unseen: np.ndarray
    cell: Cell | None = field(default=None, repr=False)
    numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    def __post_init__(self):
        if len(self.numbers) != len(self.q):
            object.__setattr__(self, "numbers", np.arange(1, len(self.q) + 1))

    def __repr__(self) -> str:
        state = "good" if self.verdict.good else "not good enough"
        return f"<CalibrationPlan of {self.robot_name}: {int(self.measured.sum())} poses, {state}>"

    def __str__(self) -> str:
        passed = int((~self.measured).sum())
        lines = [
            f"Calibration of {self.robot_name} ({self.kind}) with a {self.settings['device']}",
            f"  verdict    {'good' if self.verdict.good else 'NOT GOOD ENOUGH'}",
            *(f"             {reason}" for reason in self.verdict.reasons),
            f"  workspace  {self.workspace}",
            f"  poses      {int(self.measured.sum())} to measure, {passed} only passed, {len(self.lost)} replaced as "
            "they cannot "
            "be reached",
            f"  expected   {um(self.prediction.error)} of the tool by noise of {um(self.prediction.noise)} per axis; "
            "condition "
            f"{self.prediction.condition:.3g}, observability {self.prediction.observability:.3g} (Nahvi and Hollerbach)",
        ]
        return "\n".join(lines)

    def program(
        self,
        name: str = "Calibration",
        *,
        speed: float = 0.1,
        settle: float = 1.0,
        measure: float = 2.0,
        carts: Literal["robax", "extax"] = "robax",
        trigger: str = OPERATOR,
        tool: str = "tool0",
    ) -> str:
        """The text of a RAPID module that drives through the poses.

        speed: m/s; settle: s of rest before a measurement, measure: s after its trigger; carts: which axes of a joint
        target move the robot, turntables after the carts; trigger: "operator" waits for a key on the pendant, "TPWrite"
        only tells and goes on after `measure`, and so does the name of a digital output, which gets a pulse too; tool:
        name of its tool data. Raises ModelError for words that RAPID does not take.
        """
        return rapid_program(
            self, name, speed=speed, settle=settle, measure=measure, carts=carts, trigger=trigger, tool=tool
        )

    def write(self, folder: str | Path, **program: Any) -> Path:
        """Write workspace.png, poses.csv, measurements-template.csv, plan.json, plan.html and the program into a folder.

        Each is written whole or not at all; the template has the poses to measure, and cells to be filled in.
        program: as of `program`; its name is that of the file, Calibration.mod. Returns the folder, which is made where
        it does not exist; ModelError where the folder around it does not.
        """
        from gantrytau_optimica.procedure.documents.files import write_plan

        return write_plan(self, Path(folder), program)

    def placed(self, measurements: Measurements) -> Measurements:
        """Measurements in any frame, such as the axes of the device, laid over the poses that are expected, by their q."""
        found = placed(self._as_planned(measurements), self.q[self.measured], self.r[self.measured])
        return Measurements(measurements.q, found.r, found.R, found.rails, numbers=measurements.numbers)

    def missing(self, measurements: Measurements) -> np.ndarray:
        """Rows of the program that are to be measured and that measurements do not hold yet, by their q, or by number."""
        wanted = np.flatnonzero(self.measured)
        return wanted[~self._held(measurements)]

    def remaining(self, measurements: Measurements) -> "CalibrationPlan":
        """The plan of the poses that measurements do not hold yet, in a collision-free order again.

        With the robot known (not loaded without it) the order is sought anew, under the limits that it is loaded with: what
        they make unreachable is in `lost`; else the program goes the same way as before and passes what is measured already.
        """
        left = self.missing(measurements)
        if self.cell is None:
            todo = np.zeros(len(self.q), dtype=bool)
            todo[left] = True
            return replace(self, measured=todo)
        roadmap = Roadmap(self.cell.fleet, self.q[:-1])
        numbers = np.arange(len(self.q)) % (len(self.q) - 1)  # the last row is home again
        roadmap.clear(list(pairwise(numbers.tolist())))  # again: limits may be others than those of the plan
        tour = find_tour(roadmap, left)
        rows = tour.nodes
        return replace(
            self,
            q=self.q[rows],
            r=self.r[rows],
            R=self.R[rows],
            measured=~tour.via & np.isin(rows, left),
            numbers=self.numbers[rows],
            lost=np.concatenate([self.lost, self.r[tour.lost]]),
        )

    def _as_planned(self, measurements: Measurements) -> Measurements:
        """The same with q as planned where poses have their numbers."""
        if measurements.numbers is None:
            return measurements
        known = dict(zip(self.numbers.tolist(), self.q, strict=True))
        q = [known.get(n, own) for n, own in zip(measurements.numbers.tolist(), measurements.q, strict=True)]
        return Measurements(q, measurements.r, measurements.R, measurements.rails)

    def _held(self, measurements: Measurements) -> np.ndarray:
        """Which of the poses to measure the measurements hold with finite numbers, (m,)."""
        if measurements.q.shape[1] != self.q.shape[1]:
            raise ModelError(
                f"remaining: found measurements of {measurements.q.shape[1]} actuators, expected {self.q.shape[1]} as "
                f"the plan ({', '.join(self.joints)}); check the columns q1, q2, ..."
            )
        good = measurements.finite
        rows = matched(self._as_planned(measurements).q[good], self.q[self.measured])
        held = np.zeros(int(self.measured.sum()), dtype=bool)
        held[rows[rows >= 0]] = True
        return held
