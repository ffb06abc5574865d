"""Devices that watch a motion: what they read at their own rate."""

from collections.abc import Iterable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.devices.devices import Array, Device
from gantrytau_optimica.calibration.devices.gauges import LengthGauge
from gantrytau_optimica.fitting.finding import DataRows, Finding, agreeing

ROUNDING = 1e-9  # of a sample: a last instant that rounding puts behind the end is still read
BENT = 1e-2  # of their length, by which axes are too short halfway between two rotations 16 degrees apart
EVEN = 1e-3  # of the distance of two outputs, by which they may differ


def instants(result: Result, rate: float) -> Array:
    """When a device with this rate in Hz reads, from the first time of a result to its last, (N,) in s.

    A rate that does not divide the duration leaves an unread rest. ModelError for a rate that is not above zero, and for
    a result whose outputs lie farther apart than two readings: straight lines between them are not what moved.
    """
    rate = number("measure", "rate", rate, above=0.0)
    first, last = result.time[[0, -1]]
    apart = float(np.max(np.diff(result.time), initial=0.0))
    if apart * rate > 1 + EVEN:
        raise ModelError(
            f"measure: found a result with outputs {apart:.3g} s apart, expected {1 / rate:.3g} s or less for readings at "
            f"{rate:g} Hz; simulate with points={int(np.ceil((last - first) * rate)) + 1} or more"
        )
    count = int(np.floor((last - first) * rate + ROUNDING)) + 1
    return np.minimum(first + np.arange(count) / rate, last)


class Readings(Result):
    """What a device read over time, see `Result`; findings: what is to be said of it, rows from 0."""

    def __init__(self, *series: Any, findings: Iterable[Finding] = (), **own: Any):
        super().__init__(*series, **own)
        self.findings = tuple(findings)


@dataclass(frozen=True, eq=False)
class SampledDevice(Record):
    """A device such as LaserTracker, TMac or LengthGauge that reads a motion again and again.

    device: what reads; position: name of the watched point in the result, a vector in m; orientation: name of its axes in
    the world, a matrix; if None the one beside the position, `tool.R` for `tool.r`, and axes that do not turn where the
    result has none. play: half the width in m by which the tip of a length gauge stays behind after each reversal, as
    friction holds it.
    """

    device: Device
    _: KW_ONLY
    position: str = "tool.r"
    orientation: str | None = None
    play: float = 0.0

    def __post_init__(self):
        number("SampledDevice", "play", self.play, least=0.0)
        if self.play and not isinstance(self.device, LengthGauge):
            raise ModelError(
                f"expected a LengthGauge, not a {type(self.device).__name__}; nothing else touches what it measures",
                place="SampledDevice",
                found=Given("play", self.play),
            )

    def measure(self, result: Result, *, rate: float, seed: int = 0) -> Readings:
        """What the device reads of a simulated motion at a rate in Hz: its readings, `seen`, and the pose as it finds it,
        `r` in m and `R`.

        Values of what it does not see are NaN, and `.findings` tell of it (kinds "unseen" and "lost"); behind a jump it
        reads what is there then. Equal seeds give equal series. Raises ModelError for a rate that is not above zero and for
        names that the result does not have.
        """
        t = instants(result, rate)
        found = self.device.measure(*self._poses(result, t), seed=seed)
        readings = found.readings
        if self.play and isinstance(self.device, LengthGauge):
            # friction remembers reversals between two readings: all times of the result count
            times = np.union1d(t, result.time)
            exact = replace(self.device, noise=0.0).measure(*self._poses(result, times)).readings[:, 0]
            held = _played(exact, self.play)[np.searchsorted(times, t)]
            readings = readings + (held - exact[np.searchsorted(times, t)])[:, None]
        columns = [name.rstrip("]").split(" [") for name in found.names]
        values = {name: readings[:, k] for k, (name, _) in enumerate(columns)}
        units = dict(columns)
        if found.r is not None:
            values |= {f"r[{k}]": found.r[:, k] for k in range(3)}
            units["r"] = "m"
        if found.R is not None:
            values |= {f"R[{i},{j}]": found.R[:, i, j] for i, j in np.ndindex(3, 3)}
            units["R"] = "1"
        values["seen"] = found.seen.astype(float)
        title = f"{type(self.device).__name__} at {rate:g} Hz"
        return Readings(t, values, units=units, title=title, findings=self._findings(result, t, found.seen))

    def _poses(self, result: Result, t: Array) -> tuple[Array, Array | None]:
        """Positions (N, 3) and orientations (N, 3, 3), None where the axes do not turn."""
        beside = self.position[:-1] + "R" if self.position.endswith(".r") else None
        name = self.orientation if self.orientation or beside not in result else beside
        if name is None:
            return result.at(t, self.position), None
        R = np.asarray(result.at(t, name))
        if R.shape != (len(t), 3, 3):
            raise ModelError(
                f"of shape {R.shape[1:]}, expected a matrix (3, 3)",
                place="SampledDevice",
                found=Given("orientation", name),
            )
        # straight lines between two rotations leave them by the square of the turn: the nearest rotation
        U, sizes, Vt = np.linalg.svd(R)
        if np.any(np.abs(sizes - 1) > BENT) or np.any(np.linalg.det(R) < 0):
            raise ModelError(
                f"SampledDevice: found {name} that is no rotation at all times, expected one, from the axes of the tool to "
                "the world, and outputs a few degrees apart at most"
            )
        return result.at(t, self.position), U @ Vt

    def _findings(self, result: Result, t: Array, seen: Array) -> Iterator[Finding]:
        lost = np.flatnonzero(~seen)
        if not lost.size:
            return
        name, place = type(self.device).__name__, ", ".join(f"{x:.3g}" for x in self.device.r)
        away = np.linalg.norm(result.at(t[lost], self.position) - self.device.r, axis=1)
        remedy = "look at its place r, its axes R and ranges, its target and what stands in between"
        where = f"{self.position} is then {away.min():.3g} to {away.max():.3g} m away from it; {remedy}"
        if lost.size == len(t):
            yield Finding(
                "unseen", lost, f"the {name} at [{place}] m sees none of {len(t)} readings: {where}"
            )
        else:
            have = agreeing(lost, "are")
            yield Finding(
                "lost",
                lost,
                (DataRows(lost), f" of {len(t)} {have} not seen by the {name} at [{place}] m: {where}"),
            )


def _played(x: Array, play: float) -> Array:
    """What friction holds back: it follows x only where x is more than `play` away; unseen values are skipped."""
    held = np.full_like(x, np.nan)
    last = np.nan
    for k, value in enumerate(x):
        if np.isfinite(value):
            last = value if np.isnan(last) else min(max(last, value - play), value + play)
            held[k] = last
    return held
