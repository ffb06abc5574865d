"""Limits that a motion keeps: speeds, accelerations and forces of actuators, and a box of the tool."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array

SIZES = ("speed", "acceleration", "force")


@dataclass(frozen=True, eq=False)
class ExcitationLimits:
    """speed, acceleration, force (n,) of actuators in SI; low, high (m,): corners of the box in m."""

    speed: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def worst(self, r: np.ndarray, v: np.ndarray, a: np.ndarray, f: np.ndarray) -> dict[str, float]:
        """The largest share of each limit that is used; r (N, m) of the tool, the others (N, n)."""
        half, centre = (self.high - self.low) / 2, (self.high + self.low) / 2
        shares = (np.abs(v) / self.speed, np.abs(a) / self.acceleration, np.abs(f) / self.force)
        return dict(zip(SIZES, (float(np.max(s)) for s in shares), strict=True)) | {
            "box": float(np.max(np.abs(r - centre) / half))
        }


def excitation_limits(limits: Mapping[str, Any], actuators: int, coordinates: int) -> ExcitationLimits:
    """Limits as they were told. Raises ModelError for those that lack or do not fit."""
    if not isinstance(limits, Mapping) or set(limits) != {*SIZES, "box"}:
        found = sorted(limits) if isinstance(limits, Mapping) else limits
        raise ModelError(
            f"design_excitation: found limits {found!r}, expected dict(speed=, acceleration=, force=, box=(low, high)): "
            "m/s, m/s2 and N of the actuators, corners of the tool's box in m",
            argument="limits",
        )
    sizes = []
    for name in SIZES:
        value = array("design_excitation", "limits", limits[name], (), (actuators,))
        if not np.all(value > 0):
            raise ModelError(
                f"found limit {name}={limits[name]!r}, expected a number above 0 or {actuators} of them",
                place="design_excitation",
                argument="limits",
            )
        sizes.append(np.broadcast_to(value, actuators))
    box = array("design_excitation", "limits", limits["box"], (2, coordinates))
    if not np.all(box[0] < box[1]):
        raise ModelError(
            "found a box without extent, expected the lower corner first",
            place="design_excitation",
            argument="limits",
        )
    return ExcitationLimits(*sizes, *box)
