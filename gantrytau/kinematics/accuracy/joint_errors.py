"""How far errors of the joints carry the tool of any robot.

Each joint errs by at most e_i. To first order the tool is moved by J e, J its velocity by rates of the joints, and farthest
in one of the corners of the box of errors; what is exact moves it by forward kinematics, from where it is.
"""

import os
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, check_words, whole
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.accuracy.figures import draw_levels
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import poses

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class JointErrors(Record):
    """Errors of the tool in N poses, to first order. Rows out of reach and in singular poses are NaN.

    r (N, 3) m, R (N, 3, 3) or None where the joints do not choose it, q (N, n); errors: the largest of each joint, (n,) in
    m and rad. rates: velocity of the tool by rates of the joints, (N, 3, n), and with R its angular velocity, (N, 6, n).
    """

    kinematics: Kinematics
    r: np.ndarray
    R: np.ndarray | None
    q: np.ndarray
    errors: np.ndarray
    rates: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """Displacements of the tool (m) and, with R, rotations (rad) in the corners of the errors, (N, 2^n, 3 or 6)."""
        signs = np.array(list(product((-1.0, 1.0), repeat=len(self.errors))))
        return np.swapaxes(self.rates @ (signs * self.errors).T, 1, 2)

    @property
    def error(self) -> np.ndarray:
        """The largest displacement of the tool, (N,) in m."""
        return np.linalg.norm(self.corners[:, :, :3], axis=2).max(axis=1)

    @property
    def turn(self) -> np.ndarray:
        """The largest rotation of the tool, (N,) in rad; ModelError where the joints do not choose its orientation."""
        if self.R is None:
            raise ModelError(
                f"{self.kinematics.dae.name}: found no orientation, as its joints choose the position alone; ask for error"
            )
        return np.linalg.norm(self.corners[:, :, 3:], axis=2).max(axis=1)

    def displaced(self, errors: ArrayLike) -> np.ndarray:
        """Displacements of the tool (N, k, 3) in m for errors of the joints, (k, n), by forward kinematics."""
        found = []
        for error in array("displaced", "errors", errors, (None, len(self.errors))):
            near = self.r if self.R is None else (self.r, self.R)
            found.append(self.kinematics.fk(self.q + error, near=near)[0] - self.r)
        return np.stack(found, axis=1) if found else np.zeros((len(self.r), 0, 3))

    def sampled(self, samples: int = 100, *, seed: int = 0) -> np.ndarray:
        """Displacements of the tool for random errors, even over their box, (N, samples, 3) in m: the Monte Carlo check."""
        whole("sampled", "samples", samples, least=1)
        random = np.random.default_rng(seed)
        return self.displaced(random.uniform(-1, 1, (samples, len(self.errors))) * self.errors)

    def plot(
        self,
        quantity: Literal["error", "turn"] = "error",
        *,
        axes: str = "xy",
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """Level plot over a slice of poses; quantity: "error" or "turn"; axes: the coordinates that vary, such as "xy".

        Raises ModelError for another quantity, other axes, or poses that lie on one line.
        """
        check_words(JointErrors.plot, locals())
        values = self.error * 1e6 if quantity == "error" else np.rad2deg(self.turn)
        label = (
            "largest error of the tool [µm]" if quantity == "error" else "largest rotation of the tool [°]"
        )
        none = np.zeros((len(self.r), 0, 3))
        return draw_levels({label: values}, self.r, np.isfinite(values), none, axes, file)


def joint_errors(kinematics: Kinematics, r: ArrayLike, R: ArrayLike | None, errors: ArrayLike) -> JointErrors:
    """See `accuracy`; errors: (n,), the largest of each joint."""
    errors = array("accuracy", "errors", errors, (len(kinematics.joints),), least=0.0)
    at = poses(r, R, "accuracy")
    turns = at.R
    if turns is None and kinematics.turning:
        turns = np.array(np.broadcast_to(kinematics.home.R, (len(at.r), 3, 3)))
    return JointErrors(
        kinematics=kinematics,
        r=at.r,
        R=turns,
        q=kinematics.ik(at.r, turns),
        errors=errors,
        rates=kinematics.rates(at.r, turns),
    )
