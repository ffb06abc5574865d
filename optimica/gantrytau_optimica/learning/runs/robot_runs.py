"""What learning control runs on."""

from typing import Protocol

import numpy as np

from gantrytau import Result
from gantrytau_optimica.learning.pose_maps import PoseMap


class Plant(Protocol):
    """A robot under its servos that runs references, such as a `Rig`, a unit of a co-simulation, or the robot itself.

    period: s, of the references; kinematics: those that its controller uses, whose joints are the columns of references.
    """

    period: float

    @property
    def kinematics(self) -> PoseMap: ...

    def run(self, position: np.ndarray, velocity: np.ndarray, seed: int = 0) -> Result:
        """What it does for positions (N, n) and speeds (N, n) of its joints, given every period, from rest.

        The result has N rows with `q_ref` and `measured.q`, and `measured.r` and `measured.a` where there are such sensors.
        """
        ...


def forward_speed(q: np.ndarray, period: float) -> np.ndarray:
    """Speeds (N, n) that lead from each of positions (N, n) to the next; a backward difference would come a sample late."""
    return np.vstack([np.diff(q, axis=0), np.zeros((1, q.shape[1]))]) / period
