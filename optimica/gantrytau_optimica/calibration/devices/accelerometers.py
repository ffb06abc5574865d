"""Accelerometers: what they feel of a motion, and how they are turned on the tool, estimated from it."""

from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import array, number
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.devices.devices import Array, checked_rotation
from gantrytau_optimica.calibration.devices.sampled_devices import instants

# steps for each period of the bandwidth, between which the acceleration is taken as a straight line
FINE = 40
TOLD = 1e-6  # of the squares of what is felt: less across the main direction does not tell a turn about it


@dataclass(frozen=True, eq=False)
class Accelerometer(Record):
    """Three axes on a plate that does not turn: they feel R^T (a - g), filtered, with noise, up to a range.

    acceleration: its name in the result, a vector in m/s2 without gravity, in the world; R: axes in the world, (3, 3);
    noise: spectral density in m/s2/sqrt(Hz), white; 0.07 m/s2 at 250 Hz (assumed). range: largest reading in m/s2.
    bandwidth: Hz, where a low pass of second order (Butterworth) is at -3 dB. gravity: in the world, (3,) in m/s2.
    """

    _: KW_ONLY
    acceleration: str = "accelerometer.a"
    R: Any = field(default_factory=lambda: np.eye(3))
    noise: float = 0.07 / np.sqrt(125.0)
    range: float = 50.0
    bandwidth: float = 100.0
    gravity: Any = (0.0, 0.0, -9.81)

    def __post_init__(self):
        number("Accelerometer", "noise", self.noise, least=0.0)
        number("Accelerometer", "range", self.range, above=0.0)
        number("Accelerometer", "bandwidth", self.bandwidth, above=0.0)
        object.__setattr__(self, "R", checked_rotation("Accelerometer", self.R))
        object.__setattr__(self, "gravity", array("Accelerometer", "gravity", self.gravity, (3,)))

    def measure(self, result: Result, *, rate: float, seed: int = 0) -> Result:
        """Readings `a` (N, 3) in m/s2 in its own axes at a rate in Hz, and whether one is `saturated`.

        Equal seeds give equal series. Raises ModelError for a rate that is not above zero, and for a result without
        the acceleration.
        """
        t = instants(result, rate)
        random = np.random.default_rng(seed)
        deviation = self.noise * np.sqrt(rate / 2)  # white up to half of the rate
        felt = self._felt(result, t, rate) @ self.R + deviation * random.standard_normal((len(t), 3))
        saturated = np.any(np.abs(felt) >= self.range, axis=1)
        felt = np.clip(felt, -self.range, self.range)
        values = {f"a[{k}]": felt[:, k] for k in range(3)} | {"saturated": saturated.astype(float)}
        return Result(t, values, units={"a": "m/s2"}, title=f"Accelerometer at {rate:g} Hz")

    def orientation(self, readings: Result, result: Result) -> tuple[Array, Array]:
        """Axes in the world (3, 3), and the covariance (3, 3) in rad2 of their rotation vector in the world.

        From gravity and motion (Wahba's problem); `R` is not used. Saturated readings are left out, deviations come from
        what is left over. Raises ModelError where gravity and motion have one direction, about which a turn is not told.
        """
        t = readings.time
        good = readings["saturated"] == 0
        if np.count_nonzero(good) < 3:
            raise ModelError(
                f"Accelerometer: found {np.count_nonzero(good)} readings within the range, expected 3 and more; "
                "move more slowly"
            )
        felt = self._felt(result, t, (len(t) - 1) / (t[-1] - t[0]))[good]
        read = readings["a"][good]
        information = np.sum(felt**2) * np.eye(3) - felt.T @ felt
        sizes = np.linalg.eigvalsh(information)
        if sizes[0] < TOLD * sizes[-1]:
            raise ModelError(
                "Accelerometer: found gravity and motion along one direction, expected accelerations across gravity as "
                "well; a turn about that direction is not told"
            )
        U, _, Vt = np.linalg.svd(felt.T @ read)
        R = U @ np.diag([1.0, 1.0, np.linalg.det(U) * np.linalg.det(Vt)]) @ Vt
        variance = np.sum((felt @ R - read) ** 2) / (read.size - 3)
        return R, variance * np.linalg.inv(information)

    def _felt(self, result: Result, t: Array, rate: float) -> Array:
        """Specific force behind the low pass at the times t, in the world, (N, 3); at rest before it starts."""
        from scipy import signal

        parts = max(1, int(np.ceil(FINE * self.bandwidth / rate)))
        fine = np.minimum(t[0] + np.arange((len(t) - 1) * parts + 1) / (rate * parts), result.time[-1])
        force = result.at(fine, self.acceleration) - self.gravity
        if len(fine) == 1:
            return force
        w = 2 * np.pi * self.bandwidth
        A, B = np.array([[0.0, 1.0], [-(w**2), -np.sqrt(2) * w]]), np.array([[0.0], [w**2]])
        system = signal.StateSpace(A, B, np.array([[1.0, 0.0]]), np.zeros((1, 1)))
        even = np.arange(len(fine)) / (rate * parts)
        columns = [signal.lsim(system, u, even, X0=[u[0], 0.0])[1] for u in force.T]
        return np.column_stack(columns)[::parts]
