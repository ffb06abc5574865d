"""Length gauges: a probe that is pushed in along an axis, and wires or bars that give distances."""

from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.devices.devices import Array, Device, MeasuredPoses, numbers
from gantrytau_optimica.calibration.devices.sight import Bars, clear

ROUNDS = 12  # Newton steps of a trilateration, which converges quadratically
SETTLED = 1e-9  # m, what the last of them may be
TOLD = 1e-3  # of a metre, by which some distance changes for each metre that the target moves, whereto it be


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
        super().__post_init__()
        self._not_negative("reach", "noise")
        self._relative("scale")
        self._range("stroke", self.stroke, "m")
        if self.face is not None and not np.any(self._vector("face", self.face)):
            raise ModelError(f"LengthGauge: found face={self.face!r}, expected a direction")

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


@dataclass(frozen=True, eq=False)
class Wires(Device):
    """Draw wires or telescoping bars from anchors to the target: distances, and from three on the position.

    anchors: (m, 3) in m in the axes of the device; readings: m distances in m. With three and more the position follows
    by least squares, on the side of the anchors where the tool is, which is known to who fastens them; it is NaN where
    distances do not tell it, as near the plane of the anchors. noise: standard deviation in m, 20 um; scale: relative
    error of the distances, a number or (m,), systematic. shortest, longest: m.
    """

    _: KW_ONLY
    anchors: Any
    noise: float = 20e-6
    scale: Any = 0.0
    shortest: float = 0.1
    longest: float = 5.0

    def __post_init__(self):
        super().__post_init__()
        self._not_negative("noise", "shortest")
        self._range("(shortest, longest)", (self.shortest, self.longest), "m")
        anchors = np.atleast_2d(numbers(self.anchors))
        if anchors.ndim != 2 or anchors.shape[1] != 3 or not np.all(np.isfinite(anchors)):
            raise ModelError(f"Wires: found anchors of shape {anchors.shape}, expected (m, 3)")
        if len(anchors) > 2 and np.linalg.matrix_rank(anchors - anchors.mean(axis=0), tol=1e-6) < 2:
            raise ModelError(
                "Wires: found all anchors on one line, expected a triangle; move one off the line"
            )
        self._relative("scale", (len(anchors),))
        object.__setattr__(self, "anchors", anchors)

    def _within(self, points: Array, R: Array) -> Array:
        distances = self._distances((points - self.r) @ self.R)
        return np.all((self.shortest <= distances) & (distances <= self.longest), axis=1)

    def _sees(self, r: Array, R: Array, bars: Bars | None) -> Array:
        points = r + R @ self.target
        seen = self._within(points, R)
        for anchor in self.anchors:  # each wire must be free
            seen &= clear(self.r + self.R @ anchor, points, self.obstacles, bars)
        return seen

    def _read(self, r: Array, R: Array, random: np.random.Generator) -> MeasuredPoses:
        points = (r + R @ self.target - self.r) @ self.R
        distances = self._distances(points)
        readings = distances * (1.0 + np.asarray(self.scale)) + self.noise * random.standard_normal(
            distances.shape
        )
        names = tuple(f"distance {k + 1} [m]" for k in range(len(self.anchors)))
        position = self._position(points, readings) if len(self.anchors) > 2 else None
        return MeasuredPoses(position, None, readings, names, np.ones(len(r), dtype=bool))

    def _distances(self, points: Array) -> Array:
        return np.linalg.norm(points[:, None] - self.anchors, axis=2)

    def _position(self, points: Array, readings: Array) -> Array:
        """Gauss-Newton on all distances, from the side where the tool is; NaN where it does not settle."""
        told = np.ones(len(points), dtype=bool)
        rows, step = np.zeros((len(points), *self.anchors.shape)), np.zeros_like(points)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for _ in range(ROUNDS):
                away = points[:, None] - self.anchors
                distances = np.linalg.norm(away, axis=2)
                rows = away / distances[:, :, None]
                told = np.isfinite(rows).all(axis=(1, 2))
                inverse = np.linalg.pinv(np.where(told[:, None, None], rows, 0.0))
                step = (inverse @ (readings - distances)[:, :, None])[:, :, 0]
                points = points + np.where(told[:, None], step, np.nan)
            told &= np.linalg.svd(np.where(told[:, None, None], rows, 0.0), compute_uv=False)[:, -1] > TOLD
            told &= np.linalg.norm(step, axis=1) < SETTLED
        return np.where(told[:, None], points, np.nan)
