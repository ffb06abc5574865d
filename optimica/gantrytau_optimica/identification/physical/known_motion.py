"""What a form is fitted to: the response of a black box, or forces and positions as they were measured."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.answers.linear_systems.responses import frequency_response
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.spectra.sampled_motion import sampled_motion
from gantrytau_optimica.identification.systems.linear_fit import followed

SHIFT = 0.02  # e, of the slowest eigenfrequency
POINTS = 400
FASTEST = 2.0  # of the fastest eigenfrequency, up to which the response is fitted
SLOWEST = 1e-3  # of the fastest eigenfrequency: slower ones are at rest beside it
LEAST = 20  # samples for each coordinate


@dataclass(frozen=True, eq=False)
class KnownResponse:
    """The response G (N, n, n) of a continuous system at points s (N,), with weights (N, n, n).

    Over s = e + j w these squares are, by Parseval, those of impulse responses weighed by exp(-e t): an output error for a
    white input. e > 0 blunts resonances that have no damping. frequency: a typical w in 1/s.
    """

    s: np.ndarray
    G: np.ndarray
    weight: np.ndarray
    frequency: float

    @classmethod
    def of(cls, system: LinearSystem) -> Self:
        """The response over the band of its modes."""
        sizes = np.abs(np.linalg.eigvals(system.A))
        slow, fast = max(sizes.min(), SLOWEST * sizes.max()), FASTEST * sizes.max()
        # even up to the slowest mode, then by ratios, so that modes far apart are all seen
        count = POINTS // 5
        w = np.concatenate(
            [np.linspace(0.0, slow / 2, count, endpoint=False), np.geomspace(slow / 2, fast, POINTS - count)]
        )
        s = SHIFT * slow + 1j * w
        G = np.moveaxis(frequency_response(system.A, system.B, system.C, system.D, s), 2, 0)
        weight = np.sqrt(np.gradient(w))[:, None, None]
        parts = np.linalg.norm(weight * G, axis=0)
        # coordinates in units of their motion, so that stiff ones and angles count as much as others
        units = (np.linalg.norm(parts, axis=0) * np.linalg.norm(parts, axis=1)) ** 0.25
        weight = weight / np.outer(units, units)
        return cls(s, G, weight / np.linalg.norm(weight * G), float(np.median(sizes)))

    def left(self, form: MechanicalForm) -> np.ndarray:
        """Residuals of the response by a form, as real numbers."""
        found = ((form.response(self.s) - self.G) * self.weight).ravel()
        return np.concatenate([np.real(found), np.imag(found)])

    def missed(self, form: MechanicalForm) -> float:
        """Share of the response, by norm, that a form does not explain."""
        return float(np.linalg.norm(self.left(form)))


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """Positions y (N, n) measured every period in s while forces u (N, n) were held in between.

    Where the motion began and what positions are at rest is estimated with each form, as it is linear. frequency: a
    typical one in 1/s.
    """

    u: np.ndarray
    y: np.ndarray
    period: float
    frequency: float

    @classmethod
    def of(cls, measured: Any, system: LinearSystem, frequency: float) -> Self:
        """Checked (u, y) that belong to a sampled system; ModelError for others."""
        name = f"physical_form of {system.title}"
        if system.period is None:
            raise ModelError(
                f"{name}: found measured= for a continuous system, expected one with the period of the samples; give "
                f"system.discrete(period)",
                argument="measured",
            )
        if not isinstance(measured, tuple) or len(measured) != 2:
            raise ModelError(
                f"{name}: found measured={type(measured).__name__}, expected (u, y), forces and positions, (N, n) each",
                argument="measured",
            )
        n = len(system.C)
        u, y = sampled_motion(name, *measured, least=LEAST * n, columns=n)
        return cls(u, y, system.period, frequency)

    def left(self, form: MechanicalForm) -> np.ndarray:
        """Residuals of the positions with the best start and rest, each over its motion about the mean."""
        sampled = form.system.discrete(self.period)
        rest = self.y - followed((sampled.A, sampled.B, sampled.C, sampled.D), self.u, self.y)
        return (rest / np.linalg.norm(self.y - self.y.mean(axis=0), axis=0)).ravel() / np.sqrt(len(form.M))

    def missed(self, form: MechanicalForm) -> float:
        """Share of the motion, by norm, outside of a form and of white noise.

        Second differences of white noise have six times its variance; those of modes far below half of the sampling
        frequency have next to none.
        """
        left = np.reshape(self.left(form), self.y.shape)
        white = np.sum(np.diff(left, 2, axis=0) ** 2) / 6 * len(left) / (len(left) - 2)
        return float(np.sqrt(max(np.sum(left**2) - white, 0.0)))
