"""Devices that watch a motion: what they read at their own rate, and what a predictor makes of late readings."""

from dataclasses import KW_ONLY, dataclass, replace

import numpy as np

from gantrytau import ModelError, Result
from gantrytau_optimica.calibration.devices.devices import Array, Device
from gantrytau_optimica.calibration.devices.gauges import LengthGauge

ROUNDING = 1e-9  # of a sample: a last instant that rounding puts behind the end is still read
EVEN = 1e-3  # of the distance of two outputs, by which they may differ


def instants(result: Result, rate: float) -> Array:
    """When a device with this rate in Hz reads, from the first time of a result to its last, (N,) in s.

    A rate that does not divide the duration leaves an unread rest. ModelError for a rate that is not above zero, and for
    a result whose outputs lie farther apart than two readings: straight lines between them are not what moved.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise ModelError(f"measure: found rate={rate!r}, expected a number above 0 in Hz, such as 1000.0")
    first, last = result.time[[0, -1]]
    apart = float(np.max(np.diff(result.time), initial=0.0))
    if apart * rate > 1 + EVEN:
        raise ModelError(
            f"measure: found a result with outputs {apart:.3g} s apart, expected {1 / rate:.3g} s or less for readings at "
            f"{rate:g} Hz; simulate with points={int(np.ceil((last - first) * rate)) + 1} or more"
        )
    count = int(np.floor((last - first) * rate + ROUNDING)) + 1
    return np.minimum(first + np.arange(count) / rate, last)


@dataclass(frozen=True, eq=False)
class SampledDevice:
    """A device such as LaserTracker or LengthGauge that reads a motion again and again.

    device: what reads; position: name of the watched point in the result, a vector in m whose axes do not turn. play: half
    the width in m by which the tip of a length gauge stays behind after each reversal, as friction holds it.
    """

    device: Device
    _: KW_ONLY
    position: str = "tool.r"
    play: float = 0.0

    def __post_init__(self):
        if not (np.isfinite(self.play) and self.play >= 0):
            raise ModelError(
                f"SampledDevice: found play={self.play!r}, expected a number that is not negative, in m"
            )
        if self.play and not isinstance(self.device, LengthGauge):
            raise ModelError(
                f"SampledDevice: found play={self.play!r} and a {type(self.device).__name__}, expected a LengthGauge; "
                "nothing else touches what it measures"
            )

    def measure(self, result: Result, *, rate: float, seed: int = 0) -> Result:
        """What the device reads of a simulated motion at a rate in Hz: its readings, position `r` in m, `seen`.

        Values of what it does not see are NaN; behind a jump it reads what is there then. Equal seeds give equal series.
        Raises ModelError for a rate that is not above zero and for a position that the result does not have.
        """
        t = instants(result, rate)
        found = self.device.measure(result.at(t, self.position), seed=seed)
        readings = found.readings
        if self.play and isinstance(self.device, LengthGauge):
            # friction remembers reversals between two readings: all times of the result count
            times = np.union1d(t, result.time)
            exact = replace(self.device, noise=0.0).measure(result.at(times, self.position)).readings[:, 0]
            held = _played(exact, self.play)[np.searchsorted(times, t)]
            readings = readings + (held - exact[np.searchsorted(times, t)])[:, None]
        columns = [name.rstrip("]").split(" [") for name in found.names]
        values = {name: readings[:, k] for k, (name, _) in enumerate(columns)}
        units = dict(columns)
        if found.r is not None:
            values |= {f"r[{k}]": found.r[:, k] for k in range(3)}
            units["r"] = "m"
        values["seen"] = found.seen.astype(float)
        return Result(t, values, units=units, title=f"{type(self.device).__name__} at {rate:g} Hz")


def predict_late(readings: Result, name: str, *, latency: float, degree: int = 1) -> Array:
    """What a predictor says of a scalar now, as readings come late by a latency in s: (N,), NaN at the beginning.

    The polynomial of this degree through the last readings that have arrived is continued: 0 holds, 1 goes on with
    constant speed. A motion with acceleration a is missed by a h2 d (d + 1) / 2 at degree 1, with h s between readings
    and d readings under way. Raises ModelError for fewer readings than the first prediction needs, or uneven times.
    """
    t, x = readings.time, readings[name]
    if not (np.isfinite(latency) and latency >= 0) or degree not in (0, 1, 2):
        raise ModelError(
            f"predict_late: found latency={latency!r}, degree={degree!r}, expected a latency in s that is not negative "
            "and a degree of 0, 1 or 2"
        )
    h = (t[-1] - t[0]) / max(len(t) - 1, 1)
    if np.any(np.abs(np.diff(t) - h) > 1e-6 * h):
        raise ModelError("predict_late: found uneven times, expected readings at one rate, as of `measure`")
    late = int(np.ceil(latency / h - ROUNDING)) if h else 0
    if len(t) <= late + degree:
        raise ModelError(
            f"predict_late: found {len(t)} readings, expected more than {late + degree} for a latency of {latency:g} s"
        )
    # Lagrange's polynomials through the nodes 0, -1, ... of the arrived readings, at `late` steps ahead
    nodes = -np.arange(degree + 1.0)
    weights = [np.prod([(late - b) / (a - b) for b in nodes if b != a]) if degree else 1.0 for a in nodes]
    told = np.full(len(t), np.nan)
    first = late + degree
    told[first:] = sum(w * x[first - late - k : len(t) - late - k] for k, w in enumerate(weights))
    return told


def _played(x: Array, play: float) -> Array:
    """What friction holds back: it follows x only where x is more than `play` away; unseen values are skipped."""
    held = np.full_like(x, np.nan)
    last = np.nan
    for k, value in enumerate(x):
        if np.isfinite(value):
            last = value if np.isnan(last) else min(max(last, value - play), value + play)
            held[k] = last
    return held
