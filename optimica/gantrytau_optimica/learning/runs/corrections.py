"""Where corrections enter: at references of the actuators, or of the tool."""

from collections.abc import Sequence

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.learning.pose_maps import PoseMap
from gantrytau_optimica.learning.runs.robot_runs import forward_speed

AXES = "xyz"
OVER = 1e-9  # m or rad beyond limits that rounding may bring


class Corrections:
    """Corrections of all joints, or of some axes of the tool: how they become references.

    joints: whether of joints; moving: axes of the tool that are corrected otherwise.
    """

    def __init__(self, kinematics: PoseMap, joints: bool, moving: Sequence[int]):
        self.kinematics = kinematics
        self.joints = joints
        self.picked = tuple(range(len(kinematics.joints))) if joints else tuple(moving)
        if not moving:
            raise ModelError(
                "corrections: found a reference that rests, expected one that moves", argument="reference"
            )

    @property
    def count(self) -> int:
        """How many corrections there are."""
        return len(self.picked)

    @property
    def names(self) -> tuple[str, ...]:
        """What is corrected."""
        return tuple(self.kinematics.joints[k] if self.joints else AXES[k] for k in self.picked)

    def wanted(self, r: np.ndarray) -> np.ndarray:
        """What estimates (N, m) should be where the tool should be at r (N, 3)."""
        return self.joints_at(r) if self.joints else r[:, list(self.picked)]

    def references(self, r: np.ndarray, u: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions and speeds of the joints (N, n) for the tool at r (N, 3) and corrections u (N, m).

        Raises ModelError for a tool that is out of reach, and for joints beyond their limits.
        """
        if self.joints:
            q = self.joints_at(r) + u
        else:
            moved = np.array(r)
            moved[:, list(self.picked)] += u
            q = self.joints_at(moved, period)
        self._check_limits(q, period)
        return q, forward_speed(q, period)

    def joints_at(self, r: np.ndarray, period: float | None = None) -> np.ndarray:
        """Joints (N, n) for the tool at r (N, 3), of a reference, or with corrections in it every period s.

        Raises ModelError for a tool that is out of reach.
        """
        q = self.kinematics.ik(r)
        bad = np.flatnonzero(~np.isfinite(q).all(axis=1))
        if bad.size:
            place, within = (
                np.round(r[bad[0]], 4).tolist(),
                f"within reach of {', '.join(self.kinematics.joints)}",
            )
            raise ModelError(
                f"reference: found the tool at {place} m in row {bad[0]}, expected one {within}; move it inside"
                if period is None
                else f"corrections: found the tool at {place} m at {bad[0] * period:g} s, expected one {within}; correct "
                "less, or move the reference inside",
                argument="reference",
            )
        return q

    def _check_limits(self, q: np.ndarray, period: float) -> None:
        limits = self.kinematics.limits
        over = np.maximum(q - limits[:, 1], limits[:, 0] - q)
        if np.any(over > OVER):
            row, joint = np.unravel_index(np.argmax(over), over.shape)
            low, high = limits[joint]
            raise ModelError(
                f"corrections: found the reference {q[row, joint]:.5g} of {self.kinematics.joints[joint]} at "
                f"{row * period:g} s, expected one within its limits, {low:g} to {high:g}; correct less, or move "
                "the reference inside",
                argument="reference",
            )
