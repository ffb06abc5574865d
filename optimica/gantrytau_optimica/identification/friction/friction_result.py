"""What runs at constant speed tell: mass and friction, with deviations, as text and figures."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics
from gantrytau_optimica.fitting.covariance import named_covariance
from gantrytau_optimica.fitting.diagnostics import Diagnostics
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.friction.carried_mass import CarriedMass
from gantrytau_optimica.identification.friction.constant_runs import ConstantRuns
from gantrytau_optimica.identification.friction.figures import draw_friction, draw_places

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Friction(Record):
    """Friction of n actuators and the mass that they carry.

    mass: in kg, of the plate with half of its links; deviation 0 where it was given. coulomb, viscous: (n, 2) in N and kg/s
    (N.m and N.m.s/rad of turning actuators), at positive and at negative speed, NaN where there were no runs.
    symmetric: mass in kg that makes Coulomb friction most symmetric, by norm ("least squares", "log ratio"): how far
    they lie apart says what the assumption is worth. runs: means of the runs that were taken; diagnostics: what is left
    of them.
    """

    mass: float
    coulomb: np.ndarray
    viscous: np.ndarray
    symmetric: Mapping[str, float]
    findings: tuple[Finding, ...]
    runs: ConstantRuns
    load: CarriedMass
    names: tuple[str, ...] = field(default=())
    matrix: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    diagnostics: Diagnostics | None = field(default=None, repr=False)

    def covariance(self, names: Sequence[str] | None = None) -> np.ndarray:
        """Covariance (k, k) of `mass`, `coulomb[i][d]` and `viscous[i][d]`; None for all `names`.

        By the scatter of runs about the fit; infinite without runs to spare. Raises ModelError for names that are not
        among `.names`.
        """
        return named_covariance("Friction", self.names, self.matrix, names)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self.matrix)).tolist(), strict=True))

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Forces (N, n) of the weight of the mass in the actuators at rest at q (N, n): columns of Table 6.2."""
        positions = np.atleast_2d(np.asarray(q, dtype=float))
        return self.mass * self.load.forces(positions, np.zeros_like(positions))[0]

    def force(self, v: np.ndarray) -> np.ndarray:
        """Force of friction (N, n) at speeds v (N, n), (6.8)."""
        v = np.asarray(v, dtype=float)
        coulomb, viscous = (np.where(v > 0, x[:, 0], x[:, 1]) for x in (self.coulomb, self.viscous))
        return np.where(v == 0, 0.0, coulomb * np.sign(v) + viscous * v)

    def plot(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Forces less weight over speed for each actuator, with the law, and the weight of each run: Figures 6.2 and 6.4."""
        return draw_friction(self.load.actuators, self.runs, self.mass, self.force, file)

    def plot_places(self, kinematics: Kinematics, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Where the tool is in the middle of each run, by kinematics of the robot: Figure 6.3."""
        return draw_places(kinematics.fk(self.runs.q)[0], file)

    def __repr__(self) -> str:
        deviation = self.deviations
        lines = [f"<Friction of {self.load.name}: mass {self.mass:.4g} kg, deviation {deviation['mass']:.2g}"]
        for i, name in enumerate(self.load.actuators):
            c, d = self.coulomb[i], self.viscous[i]
            lines.append(
                f"  {name}: f_c {c[0]:.2f} / {c[1]:.2f}, f_v {d[0]:.2f} / {d[1]:.2f}  (forth / back)"
            )
        lines += [f"  most symmetric by {norm}: {value:.4g} kg" for norm, value in self.symmetric.items()]
        return "\n".join([*lines, *(f"  {finding}" for finding in self.findings)]) + ">"
