"""Measured places beside those of a reference that is better: a laser tracker, or the truth. Thesis section 5.5."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import motion

Array = np.ndarray
LEAST = 4  # places: three always fit
MILLIMETRES = 100.0  # times as large as the others, from which places are in other units
THIRD = 3  # of the places are the middle, as many the border


@dataclass(frozen=True, eq=False)
class Comparison(Record):
    """How places miss those of a reference after the best motion.

    error: r moved less reference, (N, 3) in m in the axes of the reference, NaN where either is missing; reference: (N, 3)
    in m; R (3, 3), t (3,): the motion, reference = scale R r + t; scale: 1 unless it was fitted.
    """

    error: Array = field(repr=False)
    reference: Array = field(repr=False)
    R: Array = field(repr=False)
    t: Array = field(repr=False)
    scale: float = 1.0

    @property
    def distances(self) -> Array:
        """Amounts of the errors, (N,) in m."""
        return np.linalg.norm(self.error, axis=1)

    @property
    def mean(self) -> float:
        """Mean amount, m: 1.7 mm in the thesis."""
        return float(np.nanmean(self.distances))

    @property
    def axes(self) -> Array:
        """Root mean squares along the axes of the reference, (3,) in m."""
        return np.sqrt(np.nanmean(self.error**2, axis=0))

    @cached_property
    def border_ratio(self) -> float:
        """Mean amount in the middle third of the places by that in the outer third: below 1 the border is worse."""
        away = np.linalg.norm(self.reference - np.nanmean(self.reference, axis=0), axis=1)
        known = np.flatnonzero(np.isfinite(self.distances))
        known = known[np.argsort(away[known])]
        part = max(1, len(known) // THIRD)
        return float(self.distances[known[:part]].mean() / self.distances[known[-part:]].mean())

    def __str__(self) -> str:
        x, y, z = 1e3 * self.axes
        known = self.distances[np.isfinite(self.distances)]
        scaled = "" if self.scale == 1.0 else f", scale {self.scale:.5f}"
        return (
            f"{len(known)} places: mean {1e3 * self.mean:.3g} mm, largest {1e3 * known.max():.3g} mm; rms along x {x:.3g}, "
            f"y {y:.3g}, z {z:.3g} mm; middle by border {self.border_ratio:.2f}{scaled}"
        )


def compare(r: Any, reference: Any, *, scale: bool = False) -> Comparison:
    """Places r (N, 3) beside those of a reference (N, 3), both in m, moved onto it as well as that can be.

    scale: whether the scale is fitted as well, as from the laser in thesis section 5.5. Rows that are NaN in either are left
    out. Raises ModelError for other shapes, fewer than four places, places on one line and other units.
    """
    a = array("compare", "r", r, (None, 3), finite=False)
    b = array("compare", "reference", reference, a.shape, finite=False)
    known = np.asarray(np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1))
    if known.sum() < LEAST:
        raise ModelError(f"compare: found {known.sum()} places that both measured, expected at least {LEAST}")
    a, b = a[known], b[known]
    spread = [np.linalg.svd(each - each.mean(axis=0), compute_uv=False) for each in (a, b)]
    if any(each[1] < 1e-6 * max(each[0], 1e-12) for each in spread):
        raise ModelError(
            "compare: found places on one line, expected some beside it; a turn about it is not determined"
        )
    larger = spread[0][0] / spread[1][0]
    if not 1 / MILLIMETRES < larger < MILLIMETRES:
        raise ModelError(
            f"compare: found r {larger:.3g} times as large as reference, expected both in m; divide mm by 1000"
        )
    R, t = motion(a, b)
    size = 1.0
    if scale:
        turned = (a - a.mean(axis=0)) @ R.T
        size = float(np.sum(turned * (b - b.mean(axis=0))) / np.sum(turned**2))
        t = b.mean(axis=0) - size * R @ a.mean(axis=0)
    error = np.full((len(known), 3), np.nan)
    error[known] = size * a @ R.T + t - b
    places = np.full((len(known), 3), np.nan)
    places[known] = b
    return Comparison(error, places, R, t, size)
