"""Forward kinematics of arms on turntables as they were identified."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_poses import poses_of


class ArmKinematics:
    """Forward kinematics of calibrated arms, also of quaternions that are not unit: `fk(q, near)` by Newton."""

    def __init__(self, arms: Sequence[ArmClosure], r: np.ndarray, R: np.ndarray):
        self.arms = tuple(arms)
        self.start_r, self._R = r, R
        self.turns = True

    def fk(self, q: Any, near: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """Positions (N, 3) and orientations (N, 3, 3) for actuator positions (N, 6), from poses (r, R) near by.

        near: by default a measured pose. NaN where links do not close.
        """
        q = np.asarray(q, dtype=float)
        single, q = q.ndim == 1, np.atleast_2d(q)
        r, R = near if near is not None else (self.start_r, self._R)
        r, R = np.broadcast_to(r, (len(q), 3)), np.broadcast_to(R, (len(q), 3, 3))
        found, turned = poses_of(self.arms, q, r, R, all_of_them=False)
        turned = np.asarray(turned)
        return (found[0], turned[0]) if single else (found, turned)
