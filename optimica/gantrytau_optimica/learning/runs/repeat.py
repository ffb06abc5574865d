"""How well a robot repeats a motion: what no learning can take away."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import GantryTauError
from gantrytau.border.checks import array, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.filters.tukey import Tukey
from gantrytau_optimica.learning.runs.corrections import Corrections
from gantrytau_optimica.learning.runs.learn import RUNS, LearningError
from gantrytau_optimica.learning.runs.reference import Reference
from gantrytau_optimica.learning.runs.robot_runs import Plant
from gantrytau_optimica.learning.runs.run_checks import check_runs
from gantrytau_optimica.learning.servo_loop import unit_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Repetitions(Record):
    """Runs of one motion. q: measured positions of the joints (K, N, n); error: reference less these in run 0, (N, n).

    t: times (N,) in s; full: the samples (N,) by which they are judged.
    """

    joints: tuple[str, ...]
    q: np.ndarray
    error: np.ndarray
    full: np.ndarray
    t: np.ndarray

    @property
    def deviations(self) -> np.ndarray:
        """Run 0 less each other, (K - 1, N, n): Dressler (2012), (7.26)."""
        return self.q[0] - self.q[1:]

    @property
    def rms(self) -> np.ndarray:
        """Of these, (n,)."""
        return np.sqrt(np.mean(self.deviations[:, self.full] ** 2, axis=(0, 1)))

    @property
    def relative(self) -> np.ndarray:
        """These in % of the error, (n,)."""
        return 100 * self.rms / np.sqrt(np.mean(self.error[self.full] ** 2, axis=0))

    def plot(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Errors of the joints in run 0 and deviations of the other runs from it: Dressler (2012), Figures 7.6 and 7.12."""
        from gantrytau_optimica.learning.runs.history_pictures import draw_over_time

        later = [(f"run 0 less run {k}", one) for k, one in enumerate(self.deviations, 1)]
        rows = [
            (name, [("error of run 0", self.error[:, i]), *((label, one[:, i]) for label, one in later)])
            for i, name in enumerate(self.joints)
        ]
        return draw_over_time("repeated runs", self.t, self.full, rows, file)

    def __str__(self) -> str:
        rows = [f"repeated {len(self.q)} times, deviations from the first"]
        rows += [
            f"  {name:16s} {1e6 * rms:8.3g} u{unit_of([name])} rms, {part:.2g} % of the error"
            for name, rms, part in zip(self.joints, self.rms, self.relative, strict=True)
        ]
        return "\n".join(rows)


def repeat(
    rig: Plant,
    reference: Reference,
    corrections: ArrayLike | None = None,
    *,
    runs: int = 5,
    seed: int = 0,
    window: Tukey | None = None,
) -> Repetitions:
    """Run a reference several times without learning, with corrections of the joints (N, n), such as `read_corrections` has.

    window: the part that is judged, the whole run by default. Run k draws with the seed 100 seed + k. Raises ModelError for
    corrections of another shape, or beyond the limits of joints, a reference of another period, and fewer than two runs;
    LearningError for a run that fails.
    """
    whole("repeat", "runs", runs, least=2)
    check_runs("repeat", rig, reference, seed=seed)
    at = Corrections(rig.kinematics, True, reference.moving)
    q_r = at.wanted(reference.r)
    u = np.zeros_like(q_r) if corrections is None else array("repeat", "corrections", corrections, q_r.shape)
    q_ref, v_ref = at.references(reference.r, u, rig.period)
    q = np.array([_measured(rig, q_ref, v_ref, RUNS * seed, k) for k in range(runs)])
    weights = (window or Tukey(lead=0.0)).full(len(reference), reference.period)
    return Repetitions(rig.kinematics.joints, q, q_r - q[0], weights, reference.t)


def _measured(rig: Plant, q_ref: np.ndarray, v_ref: np.ndarray, seed: int, k: int) -> np.ndarray:
    try:
        return np.asarray(rig.run(q_ref, v_ref, seed=seed + k)["measured.q"])
    except GantryTauError as error:
        raise LearningError(f"repeat: run {k} failed: {error}", argument=error.argument) from error
