"""A plan for who carries it out: the robot program, files, and the poses that are left to be measured."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError, Result
from gantrytau.border.checks import number
from gantrytau.kinematics import Limits
from gantrytau.kinematics.rotations import motion
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.procedure.documents.files import plan_on_file, write_plan
from gantrytau_optimica.procedure.documents.rapid import OPERATOR, RapidOptions, rapid_program
from gantrytau_optimica.procedure.monte_carlo import matched, placed
from gantrytau_optimica.procedure.motion_planning.plan_motion import plan_motion
from gantrytau_optimica.procedure.motion_planning.tours import Roadmap, find_tour
from gantrytau_optimica.procedure.pose_plan import PlanBasis, PosePlan
from gantrytau_optimica.procedure.robot_samples import build_fleet


class CalibrationPlan(PosePlan):
    """Poses to measure and what to expect of them, with its program and its files; the numbers are those of `PosePlan`."""

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
        return rapid_program(self, RapidOptions(name, speed, settle, measure, carts, trigger, tool))

    def motion(self, *, speed: float = 0.1, rest: float = 3.0) -> Result:
        """The nominal robot on its way through the poses, which `animate(plan)` shows, with obstacles and places to measure.

        speed: of the tool, m/s; rest: s at each pose that is measured. Forces are not in it. Raises ModelError for a speed
        or a rest that cannot be, and for a plan that was loaded without its robot.
        """
        if self.cell is None:
            raise ModelError(
                f"motion: found a plan of {self.robot_name} that was loaded without it, expected its robot; "
                "load_plan(folder, robot, limits)"
            )
        speed = number("motion", "speed", speed, least=1e-3)
        rest = number("motion", "rest", rest, least=0.0)
        fleet = self.cell.fleet.with_limits(self.cell.limits)
        return plan_motion(fleet.robot, fleet.nominal, self.q, self.measured, speed, rest)

    def write(self, folder: str | Path, **program: Any) -> Path:
        """Write workspace.png, poses.csv, measurements-template.csv, plan.json, plan.html and the program into a folder.

        Each is written whole or not at all; the template has the poses to measure, and cells to be filled in.
        program: as of `program`; its name is that of the file, Calibration.mod. Returns the folder, which is made where
        it does not exist; ModelError where the folder around it does not.
        """
        return write_plan(self, Path(folder), RapidOptions(**program))

    def placed(self, measurements: Measurements) -> Measurements:
        """Measurements in any frame, such as the axes of the device, laid over the poses that are expected, by their q."""
        found = placed(self._as_planned(measurements), self.q[self.measured], self.r[self.measured])
        moved = Measurements(measurements.q, found.r, found.R, found.rails, numbers=measurements.numbers)
        moved.lines = measurements.lines
        if measurements.covariance is None:
            return moved
        known = np.isfinite(measurements.r).all(axis=1)
        turn, _ = motion(measurements.r[known], found.r[known])
        shared = None if measurements.shared is None else turn @ measurements.shared
        return moved.uncertain(turn @ measurements.covariance @ turn.T, shared)

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


def load_plan(
    folder: str | Path, robot: Model | None = None, limits: Limits | None = None
) -> CalibrationPlan:
    """The plan that `CalibrationPlan.write` left in a folder, or its plan.json itself.

    robot, limits: as they were planned for; with both `remaining` seeks a new order, without them it keeps the old one.
    Raises ModelError for a folder without a plan, a file that is none, and a robot of another kind or
    with other parameters.
    """
    plan = CalibrationPlan(**plan_on_file(Path(folder)))
    return plan if robot is None or limits is None else _with_basis(plan, robot, limits)


def _with_basis(plan: CalibrationPlan, robot: Model, limits: Limits) -> CalibrationPlan:
    asked = plan.settings
    fleet = build_fleet(robot, limits, tape=asked["tape"], robots=asked["robots"], seed=asked["seed"])
    if tuple(fleet.nominal.kinematics.joints) != plan.joints:
        raise ModelError(
            f"load_plan: found {type(robot).__name__} with {', '.join(fleet.nominal.kinematics.joints)}, expected the "
            f"robot of the plan, {plan.robot_name} with {', '.join(plan.joints)}"
        )
    now = {name: arm.values[name] for arm in fleet.arms for name in arm.free}
    for name, then in plan.parameters.items():
        if name not in now or not np.allclose(now[name], then, rtol=0, atol=1e-9):
            found, expected = (np.asarray(x).tolist() for x in (now.get(name), then))
            raise ModelError(
                f"load_plan: found {type(robot).__name__} with {name} = {found}, expected {expected} as planned; give the "
                "robot with its nominal values of then, or plan again"
            )
    return replace(plan, cell=PlanBasis(fleet, limits))
