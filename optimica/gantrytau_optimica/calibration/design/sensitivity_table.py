"""How far a small error of each parameter moves the plate, and what it does to the cost of identification.

    S_p = sum_k (|T_k - T_k(p + h)| + |T_k - T_k(p - h)|)      over poses k, for each parameter p     (5.8)

and the same with the angles of the plate, and with the sums of squares of (5.10)-(5.12) in place of positions; the poses at
changed parameters are those of the changed robot, not a linearisation. (5.8) prints one index for parameters and poses.
Dressler (2012), section 5.3 and Table 5.10.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import check_words, number
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import rotation_vector
from gantrytau_optimica.calibration.design.identifiability import PoseArrays, finite_poses
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_factors import checked_poses
from gantrytau_optimica.calibration.links.arm_poses import poses_of

STEP = 5e-5  # m, or without unit: that of Table 5.10


@dataclass(frozen=True, eq=False)
class SensitivityTable(Record):
    """Sums over poses and both signs of a step of each parameter; prints itself as a table.

    names: of the parameters; position: (p,) in m; angle: (p,) in rad, zero where the plate cannot turn; cost: (p,) in m4;
    step: in m or 1; poses: how many there are.
    """

    names: tuple[str, ...]
    position: np.ndarray
    angle: np.ndarray
    cost: np.ndarray
    step: float
    poses: int

    def of(self, name: str) -> tuple[float, float, float]:
        """Position, angle and cost of one parameter; ModelError for an unknown name."""
        if name not in self.names:
            raise ModelError(f"sensitivity_table: there is no {name!r}{did_you_mean(str(name), self.names)}")
        k = self.names.index(name)
        return float(self.position[k]), float(self.angle[k]), float(self.cost[k])

    def __str__(self) -> str:
        width = max(map(len, self.names))
        rows = zip(self.names, self.position, self.angle, self.cost, strict=True)
        head = (
            f"{'':{width}}  position/mm  angle/mrad  cost/m4   ({self.poses} poses, steps of {self.step:g})"
        )
        return "\n".join(
            [head, *(f"{n:{width}}  {1e3 * p:11.4g}  {1e3 * a:10.4g}  {c:7.2e}" for n, p, a, c in rows)]
        )


def sensitivity_table(
    robot: Model, measurements: Any, *, step: float = STEP, orientation: Orientation = "local"
) -> SensitivityTable:
    """Changes of poses and costs by a step of each parameter either way, summed over poses.

    measurements: a record with q, r and R, or a tuple of them; the poses proper follow from q, near r and R. orientation:
    of turntables, as in `arms`. Rows that are not finite count for nothing.
    Raises ModelError for another robot, arrays that do not fit or a step that is not above zero, SolveError where links
    cannot be closed.
    """
    check_words(sensitivity_table, locals())
    step = number("sensitivity_table", "step", step, above=0.0)
    arms, (poses, _) = read_arms(robot, orientation), finite_poses(measurements)
    q, r, R = [checked_poses(arm, *poses) for arm in arms][-1]
    here = PoseArrays(q, *poses_of(arms, q, r, R))
    names, rows = [], []
    for i, arm in enumerate(arms):
        names += arm.names
        rows += [_of_parameter(arms, i, h, here) for h in step * np.eye(arm.count)]
    position, angle, cost = np.array(rows).T
    return SensitivityTable(tuple(names), position, angle, cost, step, len(q))


def _of_parameter(
    arms: Sequence[ArmClosure], i: int, step: np.ndarray, here: PoseArrays
) -> tuple[float, float, float]:
    position = angle = cost = 0.0
    for sign in (1.0, -1.0):
        arm = arms[i].moved(sign * step)
        r, R = poses_of([*arms[:i], arm, *arms[i + 1 :]], *here)
        position += np.linalg.norm(r - here.r, axis=1).sum()
        if R is not None and here.R is not None:
            turned = np.swapaxes(here.R, 1, 2) @ R
            angle += np.linalg.norm(rotation_vector(turned), axis=1).sum()
        cost += ((2 * arm.lengths * arm.closure(*here)[0]) ** 2).sum()
    return position, angle, cost
