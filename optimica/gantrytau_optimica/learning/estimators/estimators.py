"""Estimators of section 7.3 of Dressler (2012) that need no model.

Actuators      zhat = q                                                     case 1
Kinematic      zhat = z_c, forward kinematics of the measured q
Complementary  zhat = G z_c + (1 - G) z_a, z_a twice integrated             case 2A, (7.17), (7.18)
Measured       zhat = z_m, what gauges read                                 case 3
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.learning.estimators.estimator import Estimator
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase


@dataclass(frozen=True)
class Actuators(Estimator):
    """Measured positions of the actuators, each of which learns for itself."""

    joints = True
    reads = ("q",)

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        return signals["q"]


@dataclass(frozen=True)
class Kinematic(Estimator):
    """The tool where stiff arms would hold it: forward kinematics of the measured actuators."""

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        return signals["z"]


@dataclass(frozen=True)
class Complementary(Estimator):
    """Kinematics at low frequencies, an accelerometer twice integrated at high ones; hz: where they meet, by axis.

    The last of hz serves the axes behind it. Raises ModelError for what is no frequency.
    """

    hz: Sequence[float] = (4.50, 2.63)
    order: int = 2
    reads = ("z", "a")

    def __post_init__(self):
        if not len(self.hz):
            raise ModelError("Complementary: found no hz, expected one frequency at least, in Hz")
        ZeroPhase.butterworth(self.order, self.hz)

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        z, a = signals["z"], signals["a"]
        low = ZeroPhase.butterworth(self.order, self.hz)
        found = np.empty_like(z)
        for i in range(z.shape[1]):
            own = ZeroPhase((low.axes[min(i, len(self.hz) - 1)],))
            found[:, i] = complementary(z[:, i], a[:, i], own, period)
        return found


@dataclass(frozen=True)
class Measured(Estimator):
    """The tool where gauges see it, which are set to where stiff arms would hold it at rest before the motion."""

    reads = ("r",)

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        return signals["r"]


def complementary(z: np.ndarray, a: np.ndarray, low: ZeroPhase, period: float) -> np.ndarray:
    """G z + (1 - G) / s^2 a as one filter over frequencies, zero at rest; z (N, ...), a (N, ...) without bias.

    The record is continued evenly at both ends, so that nothing wraps around.
    """
    count = len(z)
    hz = np.fft.rfftfreq(2 * count - 2, period)
    gain = low.magnitude(hz, period)[0]
    w = 2 * np.pi * hz
    # exact for samples: second differences are divided by those of an oscillation
    square = np.where(w > 0, (2 - 2 * np.cos(w * period)) / period**2, 1.0)
    rest = np.where(w > 0, (gain - 1) / square, 0.0)
    over = (slice(None), *[None] * (z.ndim - 1))
    spectra = [np.fft.rfft(np.concatenate([x, x[-2:0:-1]]), axis=0) for x in (z, a)]
    return np.fft.irfft(gain[over] * spectra[0] + rest[over] * spectra[1], 2 * count - 2, axis=0)[:count]
