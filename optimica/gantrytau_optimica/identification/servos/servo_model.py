"""What steps tell of servos: delay, pole and gain of each actuator, as text, linear system and figure."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.answers.linear_systems.state_space import StateSpace
from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.covariance import named_covariance
from gantrytau_optimica.fitting.diagnostics import Diagnostics
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.servos.figures import draw_steps
from gantrytau_optimica.identification.servos.servo_fit import corner, response
from gantrytau_optimica.identification.servos.step_response import StepResponse

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class ServoModel(Record):
    """Servos of n actuators, q_m = q^-d b / (1 - a q^-1) q_r from sample to sample, (6.11).

    delay: d in samples, (n,) of whole numbers; pole: a, (n,); gain: b, (n,); fit: % of the motion that is explained, (n,);
    period: in s. rest: position in m (rad) from which each step began, (steps, n), NaN where an actuator did not step.
    diagnostics: what the laws leave.
    """

    delay: np.ndarray
    pole: np.ndarray
    gain: np.ndarray
    fit: np.ndarray
    period: float
    rest: np.ndarray
    steps: tuple[StepResponse, ...]
    findings: tuple[Finding, ...]
    matrix: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    diagnostics: Diagnostics | None = field(default=None, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Rows and columns of the covariance: pole[0], gain[0], pole[1] and so on."""
        return tuple(f"{word}[{i}]" for i in range(len(self.pole)) for word in ("pole", "gain"))

    def covariance(self, names: Sequence[str] | None = None) -> np.ndarray:
        """Covariance (k, k) of `pole[i]` and `gain[i]` for the delay found; None for all `names`.

        By the spectrum of what is left, which friction colours: as noise that is white it would seem far too small.
        Raises ModelError for other names.
        """
        return named_covariance("ServoModel", self.names, self.matrix, names)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.matrix)).tolist(), strict=True))

    @property
    def time_constant(self) -> np.ndarray:
        """-period / log(a), (n,) in s, without the delay; 0 for a pole at 0."""
        moving = self.pole > 0
        return np.where(moving, -self.period / np.log(np.where(moving, self.pole, 0.5)), 0.0)

    @property
    def bandwidth(self) -> np.ndarray:
        """Frequency at which the gain is 1 / sqrt(2) of that at rest, (n,) in Hz; infinite above half of the sampling."""
        return np.array([corner(pole, self.period) for pole in self.pole.tolist()])

    @property
    def system(self) -> StateSpace:
        """All actuators side by side from sample to sample: references in, positions out, from rest at zero."""
        parts = [_delayed(*law) for law in zip(self.delay, self.pole, self.gain, strict=True)]
        sizes = np.cumsum([0, *(len(part[0]) for part in parts)])
        n = len(parts)
        A, B = np.zeros((sizes[-1], sizes[-1])), np.zeros((sizes[-1], n))
        C, D = np.zeros((n, sizes[-1])), np.zeros((n, n))
        for i, (a, b, c, d) in enumerate(parts):
            rows = slice(sizes[i], sizes[i + 1])
            A[rows, rows], B[rows, i], C[i, rows], D[i, i] = a, b, c, d
        return StateSpace(A, B, C, D, period=self.period)

    def simulated(self, step: int) -> np.ndarray:
        """Positions (N, n) in m (rad) by the law in one of the steps; NaN of actuators that did not step."""
        reference = self.steps[step].reference
        laws = zip(reference.T - reference[0][:, None], self.delay, self.pole, self.gain, strict=True)
        return np.column_stack([response(u, int(d), a, b) for u, d, a, b in laws]) + self.rest[step]

    def plot(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Steps and the law over time, from rest, and what the law leaves; a row for each actuator."""
        return draw_steps(self.steps, [self.simulated(k) for k in range(len(self.steps))], self.rest, file)

    def __repr__(self) -> str:
        lines = [f"<Servos of {len(self.pole)} actuator{'s' * (len(self.pole) > 1)}, every {self.period:g} s"]
        deviation = self.deviations
        for i, pole in enumerate(self.pole):
            lines.append(
                f"  actuator {i}: delay {self.delay[i]}, pole {pole:.5f} ± {deviation[f'pole[{i}]']:.2g}, gain "
                f"{self.gain[i]:.5f}; {self.time_constant[i]:.4g} s, {self.bandwidth[i]:.4g} Hz, fit {self.fit[i]:.1f} %"
            )
        return "\n".join([*lines, *(f"  {finding}" for finding in self.findings)]) + ">"


def _delayed(d: int, a: float, b: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """A, B, C and D of y[k] = a y[k - 1] + b u[k - d]; states y and the inputs that are still on their way.

    Without delay the state is the output before, as y answers at once.
    """
    if d == 0:
        return np.array([[a]]), np.array([b]), np.array([a]), b
    A, B, C = np.zeros((d, d)), np.zeros(d), np.zeros(d)
    A[0, 0], C[0] = a, 1.0
    if d > 1:
        A[0, 1] = b
    A[range(1, d - 1), range(2, d)] = 1.0
    B[-1] = b if d == 1 else 1.0
    return A, B, C, 0.0
