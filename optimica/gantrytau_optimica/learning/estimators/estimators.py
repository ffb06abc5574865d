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
from gantrytau.border.refusal import Given
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

    One of hz, or the last of several, serves the axes behind it. Raises ModelError for what is no frequency.
    """

    hz: float | Sequence[float] = (4.50, 2.63)
    order: int = 2
    reads = ("z", "a")

    def __post_init__(self):
        ZeroPhase.butterworth(self.order, self.hz)
        if np.size(self.hz) > 3:
            expected = "expected a frequency in Hz, or one for each of x, y and z"
            raise ModelError(expected, place="Complementary", found=Given("hz", self.hz))

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        z, a = signals["z"], signals["a"]
        low = ZeroPhase.butterworth(self.order, self.hz)
        found = np.empty_like(z)
        for i in range(z.shape[1]):
            own = ZeroPhase((low.axes[min(i, len(low.axes) - 1)],))
            found[:, i] = complementary(z[:, i], a[:, i], own, period)
        return found


@dataclass(frozen=True)
class Measured(Estimator):
    """The tool where gauges see it, which are set to where stiff arms would hold it at rest before the motion."""

    reads = ("r",)

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        return signals["r"]


def complementary(z: np.ndarray, a: np.ndarray, low: ZeroPhase, period: float) -> np.ndarray:
    """G z + (1 - G) / s^2 a as one filter over frequencies; z (N, ...) in m, a (N, ...) in m/s2 without bias, from rest.

    The record is continued evenly before its beginning, where it rests, and reflected in its last point, as speeds are the
    same behind it as before: it is a sum of cosines (2 k + 1) pi t / (2 T) about that point, T its length, none constant.
    """
    from scipy.fft import dct, idct

    count = len(z) - 1
    hz = (2 * np.arange(count) + 1) / (4 * count * period)
    gain = low.magnitude(hz, period)[0]
    over = (slice(None), *[None] * (z.ndim - 1))
    kinematic, integrated = gain[over], ((gain - 1) / (2 * np.pi * hz) ** 2)[over]
    spectrum = kinematic * dct(z[:-1] - z[-1], type=3, axis=0) + integrated * dct(a[:-1], type=3, axis=0)
    return np.concatenate([idct(spectrum, type=3, axis=0) + z[-1], z[-1:]])
