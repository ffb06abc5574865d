"""What the procedure plans: poses in a safe order, and what to expect of their calibration."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics import Limits
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.fitting.finding import length_text
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.monte_carlo import Trials
from gantrytau_optimica.procedure.plan_acceptance import PlanVerdict
from gantrytau_optimica.procedure.pose_choice import PoseChoice
from gantrytau_optimica.procedure.robot_samples import WIDER, Fleet
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace

USUAL = 20  # robots that are drawn
DOUBT = 0.05  # of 95 % confidence


@dataclass(frozen=True, eq=False)
class PlanBasis(Record):
    """What a plan was made from and its file does not hold: robots, limits, device, candidates."""

    fleet: Fleet
    limits: Limits
    device: Device | None = None
    candidates: Candidates | None = None


@dataclass(frozen=True, eq=False)
class PosePlan(Record):
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
    prediction: PoseChoice
    trials: Trials
    verdict: PlanVerdict
    lost: np.ndarray
    unseen: np.ndarray
    cell: PlanBasis | None = field(default=None, repr=False)
    numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    def __post_init__(self):
        if len(self.numbers) != len(self.q):
            object.__setattr__(self, "numbers", np.arange(1, len(self.q) + 1))

    def __repr__(self) -> str:
        state = "good" if self.verdict.good else "not good enough"
        return f"<{type(self).__name__} of {self.robot_name}: {int(self.measured.sum())} poses, {state}>"

    def __str__(self) -> str:
        passed = int((~self.measured).sum())
        lines = [
            f"Calibration of {self.robot_name} ({self.kind}) with a {self.settings['device']}",
            f"  verdict    {'good' if self.verdict.good else 'NOT GOOD ENOUGH'}",
            *(f"             {reason}" for reason in self.verdict.reasons),
            f"  workspace  {self.workspace}",
            f"  poses      {int(self.measured.sum())} to measure, {passed} only passed, {len(self.lost)} replaced as they "
            "cannot be reached",
            f"  expected   {length_text(self.prediction.error)} of the tool by noise of "
            f"{length_text(self.prediction.noise)} per axis; condition {self.prediction.condition:.3g}, observability "
            f"{self.prediction.observability:.3g} (Nahvi and Hollerbach)",
        ]
        return "\n".join(lines)

    @property
    def header(self) -> str:
        """The header of a file with its measurements: q1,q2,...,x,y,z, and quaternions where the plate turns."""
        turns = [] if self.kind == "three links" else ["qw", "qx", "qy", "qz"]
        return ",".join([*(f"q{k + 1}" for k in range(self.q.shape[1])), "x", "y", "z", *turns])

    @property
    def few_robots(self) -> bool:
        """Whether fewer robots than usual were simulated."""
        return int(self.settings["robots"]) < USUAL

    @property
    def safety(self) -> str:
        """What so many simulated robots say of the safety of all others."""
        robots = int(self.settings["robots"])
        share = 1 - DOUBT ** (1 / robots)
        words = (
            f"none of {robots} robots drawn with the tape error, and none of as many with {WIDER:g} times these errors, "
            f"breaks a limit on the way; {robots} alone would say with 95 % confidence that no more than {share:.0%} of all "
            "do; a robot farther from its nominal values may"
        )
        return f"{words}; {USUAL} or more robots say more" if self.few_robots else words

    def command(self, folder: str | Path = ".") -> str:
        """What is given on the command line once its poses are measured and written into a folder."""
        prior = self.settings.get("prior") or {}
        words = " --prior " + ",".join(f"{name}={value:g}" for name, value in prior.items()) if prior else ""
        return f"gantrytau calibrate {Path(folder) / 'measurements.csv'}{words}"
