"""Links of an arm on turntables over the measured poses, by all parameters of the arm; `Chain` has no turntables."""

from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import left_jacobian
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.closure import by_motion

STEP = 1e-5  # m or rad, of differences by an actuator


class ArmOverPoses:
    """An arm over poses q (N, n), r (N, 3), R (N, 3, 3), worked out for all of its links at once.

    Its parameters p are changes of the unknowns of the arm as it was given; local rotations are d of R(u) exp([d]x).
    """

    def __init__(self, arm: ArmClosure, q: np.ndarray, r: np.ndarray, R: np.ndarray | None):
        self.arm, self.q, self.r, self.R = arm, q, r, R
        self.start = arm.vector
        self.turns = [k for k, name in enumerate(arm.names) if ".rotation[" in name and name.endswith("[0]")]
        self._differences: tuple[bytes, dict[int, np.ndarray]] = (b"", {})
        self._known: tuple[bytes, np.ndarray, np.ndarray] = (b"", self.start, self.start)

    def moved(self, p: np.ndarray) -> ArmClosure:
        """The arm with these parameters."""
        return self.arm.moved(p - self.start)

    def closure(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Errors (N, m) in m, and their derivatives (N, m, p)."""
        key = p.tobytes()
        if self._known[0] != key:
            e, J = self.moved(p).closure(self.q, self.r, self.R)
            for k in self.turns:
                J[:, :, k : k + 3] = J[:, :, k : k + 3] @ left_jacobian(p[k : k + 3]).T
            self._known = key, e, J
        return self._known[1:]

    def told(self, p: np.ndarray) -> np.ndarray | None:
        """Jacobian (p, p) of rotations from the moved arm by rotations from its start; None for the unit matrix.

        exp([d + dd]x) = exp([d]x) exp([J(d)' dd]x) with the Jacobian J of the left.
        """
        if not self.turns or not any(p[k : k + 3].any() for k in self.turns):
            return None
        found = np.eye(len(p))
        for k in self.turns:
            found[k : k + 3, k : k + 3] = left_jacobian(p[k : k + 3]).T
        return found

    def differences(self, p: np.ndarray) -> dict[int, np.ndarray]:
        """Derivatives of the errors by the actuators of the arm, (N, m), by columns of q."""
        key = p.tobytes()
        if self._differences[0] == key:
            return self._differences[1]
        arm, found = self.moved(p), {}
        for column in (arm.cart, *arm.columns):
            step = STEP * (np.arange(self.q.shape[1]) == column)
            ends = [arm.errors(self.q + s * step, self.r, self.R) for s in (1.0, -1.0)]
            found[column] = (ends[0] - ends[1]) / (2 * STEP)
        self._differences = key, found
        return found


@dataclass(frozen=True, eq=False)
class ArmLink(Record):
    """Link number j of an arm over poses, as `Chain` says; its errors are in m."""

    poses: ArmOverPoses
    j: int

    @property
    def name(self) -> str:
        """Its path."""
        return self.poses.arm.links[self.j]

    @property
    def cart(self) -> int:
        """The column of its cart."""
        return self.poses.arm.cart

    @property
    def q(self) -> np.ndarray:
        """Positions of its cart, (N,)."""
        return self.poses.q[:, self.cart]

    @property
    def R(self) -> np.ndarray | None:
        """Orientations of the plate."""
        return self.poses.R

    def error(self, p: np.ndarray) -> np.ndarray:
        """e, (N,) in m."""
        return self.poses.closure(p)[0][:, self.j]

    distance = error

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """de/dp, (N, size)."""
        return self.poses.closure(p)[1][:, self.j]

    def by_actuator(self, p: np.ndarray) -> dict[int, np.ndarray]:
        """de/dq, (N,), by columns of q."""
        return {column: derivatives[:, self.j] for column, derivatives in self.poses.differences(p).items()}

    def by_pose(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """de/dT and de/dphi, (N, 3) each."""
        arm, here = self.poses.moved(p), self.poses
        offset = None if here.R is None else arm.vector_of(arm.said.rods[self.j].plate_offset)
        return by_motion(arm.directions(here.q, here.r, here.R)[:, self.j], here.R, offset)

    def told(self, p: np.ndarray) -> np.ndarray | None:
        """Jacobian of the reported parameters by the fitted ones; None for the unit matrix."""
        return self.poses.told(p)


def links_of(arm: ArmClosure, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> list[ArmLink]:
    """The links of an arm over poses, which share what is worked out."""
    poses = ArmOverPoses(arm, q, r, R)
    return [ArmLink(poses, j) for j in range(len(arm.lengths))]
