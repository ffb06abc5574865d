"""Length gauges: probes that are pushed in along an axis."""

from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.devices.devices import Array, Device, MeasuredPoses


@dataclass(frozen=True, eq=False)
class LengthGauge(Device):
    """A probe at r that measures along its x axis how far the target is pushed out: backlash, repeatability, drift.

    One reading, in m; no position. face: normal of a flat face at the target in the frame of the tool, (3,), against
    which the probe lies; without it the reading is the coordinate of the target along the axis. stroke: readings that
    the probe can give, m; reach: how far the target may stand beside the axis, m. noise: standard deviation in m,
    0.5 um as for a good incremental probe (assumed); scale: relative error of readings, systematic.
    """

    _: KW_ONLY
    face: Any = None
    stroke: tuple[float, float] = (0.0, 0.03)
    reach: float = 0.02
    noise: float = 0.5e-6
    scale: float = 0.0

    def __post_init__(self):
        self._numbers("reach", "noise", least=0.0)
        self._numbers("scale")
        self._range("stroke")
        if self.face is not None:
            self._direction("face")
        super().__post_init__()

    def _lengths(self, points: Array, R: Array) -> Array:
        """Readings without errors, (N,); a face that the axis never meets gives infinity."""
        away, axis = points - self.r, self.R[:, 0]
        if self.face is None:
            return away @ axis
        normals = R @ self.face
        slope = normals @ axis
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(slope == 0, np.inf, np.einsum("nk,nk->n", normals, away) / slope)

    def _within(self, points: Array, R: Array) -> Array:
        aside = np.linalg.norm(((points - self.r) @ self.R)[:, 1:], axis=1)
        length = self._lengths(points, R)
        return (self.stroke[0] <= length) & (length <= self.stroke[1]) & (aside <= self.reach)

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        length = self._lengths(r + R @ self.target, R)
        readings = (1.0 + self.scale) * length + self.noise * random.standard_normal(len(r))
        return MeasuredPoses(None, None, readings[:, None], ("length [m]",), np.ones(len(r), dtype=bool))
