"""Lines of sight: whether obstacles or the bars of a robot stand between a device and what it looks at."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, instance, number
from gantrytau.describing.record import Record
from gantrytau.kinematics.workspace.obstacles import Obstacle, between_segments, segment_distance

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Bars(Record):
    """Round bars that move with the robot, such as its links: they hide what is behind them.

    start, end: (N, k, 3) in m, world, one row for each pose; (k, 3) for bars that stand still. radius: m.
    Raises ModelError for other shapes and for a radius that is not above zero.
    """

    start: Any
    end: Any
    radius: float

    def __post_init__(self):
        number("Bars", "radius", self.radius, above=0.0)
        start, end = (
            array("Bars", name, getattr(self, name), (None, None, 3), (None, 3)) for name in ("start", "end")
        )
        if start.shape != end.shape:
            raise ModelError(
                f"Bars: found start of shape {start.shape} and end of {end.shape}, expected the same for both"
            )
        object.__setattr__(self, "start", start if start.ndim == 3 else start[None])
        object.__setattr__(self, "end", end if end.ndim == 3 else end[None])

    def hide(self, eye: Array, points: Array) -> Array:
        """Whether a bar is between eye (3,) and each of points (N, 3), (N,).

        Bars end at the plate that carries the target: what touches the target, within two radii, does not hide it.
        """
        if len(self.start) not in (1, len(points)):
            raise ModelError(
                f"Bars: found {len(self.start)} rows for {len(points)} poses, expected one for each, or one for all"
            )
        way = points - eye
        length = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
        short = points - way * np.minimum(2 * self.radius / length, 1.0)
        apart = between_segments(
            np.broadcast_to(eye, (len(points), 1, 3)), short[:, None], self.start, self.end
        )
        return np.any(apart < self.radius, axis=1)


def clear(eye: Array, points: Array, obstacles: Sequence[Obstacle], bars: Bars | None = None) -> Array:
    """Whether nothing stands between eye (3,) and each of points (N, 3), both in m in the world, (N,)."""
    free = np.ones(len(points), dtype=bool)
    if bars is not None:
        free &= ~instance("sees", "bars", bars, Bars).hide(eye, points)
    for obstacle in obstacles:
        free &= segment_distance(obstacle, np.broadcast_to(eye, points.shape), points) > 0
    return free
