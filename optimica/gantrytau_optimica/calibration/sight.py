"""Lines of sight: whether obstacles or the bars of a robot stand between a device and what it looks at."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from gantrytau import ModelError

Array = np.ndarray
STEP = 1e-3  # m, the shortest step along a line of sight: thinner obstacles may be stepped over
TOUCH = 1e-9  # m, a line that comes nearer than this to an obstacle is interrupted


class Obstacle(Protocol):
    """Anything that knows how far points are from it."""

    def distance(self, points: Array, /) -> Array:
        """Distances of points (N, 3) in m, (N,), not above the true ones; negative or zero inside."""
        ...


@dataclass(frozen=True, eq=False)
class Bars:
    """Round bars that move with the robot, such as its links: they hide what is behind them.

    start, end: (N, k, 3) in m, world, one row for each pose; (k, 3) for bars that stand still. radius: m.
    Raises ModelError for other shapes and for a radius that is not above zero.
    """

    start: Any
    end: Any
    radius: float

    def __post_init__(self):
        start, end = np.asarray(self.start, dtype=float), np.asarray(self.end, dtype=float)
        if start.shape != end.shape or start.ndim not in (2, 3) or start.shape[-1] != 3:
            raise ModelError(
                f"Bars: found ends of shapes {start.shape} and {end.shape}, expected (N, k, 3) for both, or (k, 3)"
            )
        if not self.radius > 0:
            raise ModelError(f"Bars: found radius={self.radius!r}, expected a length above 0 in m")
        object.__setattr__(self, "start", start if start.ndim == 3 else start[None])
        object.__setattr__(self, "end", end if end.ndim == 3 else end[None])

    def hide(self, eye: Array, points: Array) -> Array:
        """Whether a bar is between eye (3,) and each of points (N, 3), (N,). The last radius before a point is free.

        Bars end at the plate that carries the target; what touches the target does not hide it.
        """
        if len(self.start) not in (1, len(points)):
            raise ModelError(
                f"Bars: found {len(self.start)} rows for {len(points)} poses, expected one for each, or one for all"
            )
        way = points - eye
        length = np.linalg.norm(way, axis=1, keepdims=True)
        short = points - way / np.maximum(length, TOUCH) * np.minimum(2 * self.radius, length)
        distance = segment_distance(
            np.broadcast_to(eye, points.shape)[:, None], short[:, None], self.start, self.end
        )
        return np.any(distance < self.radius, axis=1)


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances in m of the segments from a to b and from c to d, (..., 3) each, (...,); Ericson (2005), 5.1.9."""
    first, second, between = b - a, d - c, a - c
    aa, bb, ab = _dot(first, first), _dot(second, second), _dot(first, second)
    p, q = _dot(first, between), _dot(second, between)
    area = aa * bb - ab * ab
    parallel = area <= 1e-14 * aa * bb
    s = np.where(parallel, 0.0, np.clip((ab * q - p * bb) / np.where(parallel, 1.0, area), 0.0, 1.0))
    t = (ab * s + q) / np.maximum(bb, 1e-300)
    outside = np.clip(t, 0.0, 1.0)
    s = np.where(t == outside, s, np.clip((ab * outside - p) / np.maximum(aa, 1e-300), 0.0, 1.0))
    apart = between + s[..., None] * first - outside[..., None] * second
    return np.linalg.norm(apart, axis=-1)


def clear(eye: Array, points: Array, obstacles: Sequence[Obstacle], bars: Bars | None = None) -> Array:
    """Whether nothing stands between eye (3,) and each of points (N, 3), both in m in the world, (N,)."""
    free = np.ones(len(points), dtype=bool)
    if bars is not None:
        free &= ~bars.hide(eye, points)
    for obstacle in obstacles:
        rows = np.flatnonzero(free)
        free[rows] = ~_interrupted(eye, points[rows], obstacle)
    return free


def _interrupted(eye: Array, points: Array, obstacle: Obstacle) -> Array:
    """Sphere tracing: steps as long as the obstacle is away cannot jump over it (Hart, 1996)."""
    way = points - eye
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, TOUCH)[:, None]
    travelled, hit = np.zeros(len(points)), np.zeros(len(points), dtype=bool)
    rows = np.arange(len(points))
    while rows.size:
        distance = np.asarray(obstacle.distance(eye + travelled[rows, None] * unit[rows]))
        hit[rows] = distance <= TOUCH
        travelled[rows] += np.maximum(distance, STEP)
        rows = rows[~hit[rows] & (travelled[rows] < length[rows])]
    return hit


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("...k,...k->...", *np.broadcast_arrays(a, b))
