"""Estimates of what is learnt from: positions of the actuators, or of the tool by what was measured.

Actuators      zhat = q                                                     case 1 of Dressler (2012), section 7.3
Kinematic      zhat = z_c, forward kinematics of the measured q
Complementary  zhat = G z_c + (1 - G) z_a, z_a twice integrated             case 2A, (7.17), (7.18)
Measured       zhat = z_m, what gauges read                                 case 3
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.kinematics import Kinematics
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase

REST = 0.5  # s before the motion, in which sensors are set to zero


class Estimator(Protocol):
    """An estimate by a run; joints: whether it is of the actuators, else of the tool."""

    joints: bool

    def estimate(self, run: Result, kinematics: Kinematics) -> np.ndarray:
        """Positions (N, n) of actuators, or (N, 3) of the tool, in m."""
        ...


@dataclass(frozen=True)
class Actuators:
    """Measured positions of the actuators, each of which learns for itself."""

    joints: bool = True

    def estimate(self, run: Result, kinematics: Kinematics) -> np.ndarray:
        return sensor(run, "measured.q", self)


@dataclass(frozen=True)
class Kinematic:
    """The tool where stiff arms would hold it: forward kinematics of the measured actuators."""

    joints: bool = False

    def estimate(self, run: Result, kinematics: Kinematics) -> np.ndarray:
        return calculated(run, kinematics, self)


@dataclass(frozen=True)
class Complementary:
    """Kinematics at low frequencies, an accelerometer twice integrated at high ones; hz: where they meet, by axis."""

    hz: Sequence[float] = (4.50, 2.63, 2.63)
    order: int = 2
    joints: bool = False

    def estimate(self, run: Result, kinematics: Kinematics) -> np.ndarray:
        z, a = calculated(run, kinematics, self), sensor(run, "measured.a", self)
        period = float(np.median(np.diff(run.time)))
        a = a - a[at_rest(run)].mean(axis=0)
        hz = [*self.hz, *[self.hz[-1]] * (z.shape[1] - len(self.hz))]
        found = np.empty_like(z)
        for i, cut in enumerate(hz[: z.shape[1]]):
            found[:, i] = complementary(z[:, i], a[:, i], ZeroPhase.butterworth(self.order, cut), period)
        return found


@dataclass(frozen=True)
class Measured:
    """The tool where gauges see it, which are set to where stiff arms would hold it at rest before the motion."""

    joints: bool = False

    def estimate(self, run: Result, kinematics: Kinematics) -> np.ndarray:
        z, r = calculated(run, kinematics, self), sensor(run, "measured.r", self)
        return r + np.mean((z - r)[at_rest(run)], axis=0)


def complementary(z: np.ndarray, a: np.ndarray, low: ZeroPhase, period: float) -> np.ndarray:
    """G z + (1 - G) / s^2 a as one filter over frequencies, zero at rest; z (N,), a (N,) without bias.

    The record is continued evenly at both ends, so that nothing wraps around.
    """
    count = len(z)
    hz = np.fft.rfftfreq(2 * count - 2, period)
    gain = low.magnitude(hz, period)[0]
    w = 2 * np.pi * hz
    # exact for samples: second differences are divided by those of an oscillation
    square = np.where(w > 0, (2 - 2 * np.cos(w * period)) / period**2, 1.0)
    rest = np.where(w > 0, (gain - 1) / square, 0.0)
    both = [np.concatenate([x, x[-2:0:-1]]) for x in (z, a)]
    spectra = [np.fft.rfft(x) for x in both]
    return np.fft.irfft(gain * spectra[0] + rest * spectra[1], 2 * count - 2)[:count]


def at_rest(run: Result) -> np.ndarray:
    """Samples before the motion, (N,)."""
    return run.time <= run.time[0] + REST


def calculated(run: Result, kinematics: Kinematics, asking: object) -> np.ndarray:
    """Forward kinematics of the measured actuators, (N, 3) in m."""
    r, _ = kinematics.fk(sensor(run, "measured.q", asking))
    return r


def sensor(run: Result, name: str, asking: object) -> np.ndarray:
    """What a run holds of a sensor. Raises ModelError where it has none."""
    if name not in run.arrays:
        there = ", ".join(sorted(n for n in run.arrays if n.startswith("measured."))) or "nothing measured"
        raise ModelError(
            f"{type(asking).__name__}: found a run with {there}, expected {name}; take a robot with this sensor, or another "
            "estimator",
            argument="estimator",
        )
    return np.asarray(run[name])
