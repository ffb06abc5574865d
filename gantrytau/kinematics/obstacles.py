"""Obstacles around a robot, and how far its links and plate are from them.

Links and plate are capsules: all points within a radius of a segment. Obstacles are convex, so the signed distance along
a segment is a convex function of the place on it, and its minimum is found by golden section for any of them.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from gantrytau.errors import ModelError
from gantrytau.kinematics.poses import floats, real, told

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_SECTIONS = 30  # of a segment, which leave 0.5e-6 of it
_LEAST = 1e-12  # of a length that is divided by
_REMEDY = "give numbers in m, in the axes of the base"


class Obstacle(Protocol):
    """What has a signed distance: a convex body."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points (..., 3) from the surface in m, negative inside: (...)."""
        ...


@dataclass(frozen=True, eq=False)
class Box:
    """A box between two corners, low and high, (3,) in m; R (3, 3) turns it about its centre."""

    low: Any
    high: Any
    R: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self):
        low, high = _vector("Box.low", self.low), _vector("Box.high", self.high)
        if not (low < high).all():
            raise ModelError(
                f"Box: found low {low.tolist()} and high {high.tolist()}, expected low < high; {_REMEDY}"
            )
        R = floats(self.R)
        if R.shape != (3, 3) or not np.allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-6):
            raise ModelError(f"Box.R: found {told(self.R)}, expected a rotation matrix (3, 3)")
        for name, value in (("low", low), ("high", high), ("R", R)):
            object.__setattr__(self, name, value)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See Obstacle."""
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        beyond = np.abs((points - middle) @ self.R) - half
        outside = np.maximum(beyond, 0.0)
        return np.sqrt((outside**2).sum(-1)) + np.minimum(beyond.max(-1), 0.0)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder with flat ends: its axis from start to end, (3,) in m, and its radius in m."""

    start: Any
    end: Any
    radius: float

    def __post_init__(self):
        _hold_segment(self, "Cylinder")
        if np.linalg.norm(self.end - self.start) < _LEAST:
            raise ModelError(
                f"Cylinder: found start and end at {self.start.tolist()}, expected a length; {_REMEDY}"
            )

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See Obstacle."""
        axis = self.end - self.start
        length = np.linalg.norm(axis)
        gap = points - (self.start + self.end) / 2
        along = gap @ (axis / length)
        across = np.sqrt(np.maximum((gap**2).sum(-1) - along**2, 0.0))
        beyond = np.stack([np.abs(along) - length / 2, across - self.radius])
        outside = np.maximum(beyond, 0.0)
        return np.sqrt((outside**2).sum(0)) + np.minimum(beyond.max(0), 0.0)


@dataclass(frozen=True, eq=False)
class Capsule:
    """All points within a radius of the segment from start to end, (3,) in m; a sphere where these are the same."""

    start: Any
    end: Any
    radius: float

    def __post_init__(self):
        _hold_segment(self, "Capsule")

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See Obstacle."""
        axis = self.end - self.start
        gap = points - self.start
        place = np.clip((gap @ axis) / max(axis @ axis, _LEAST), 0.0, 1.0)
        return np.linalg.norm(gap - place[..., None] * axis, axis=-1) - self.radius


def _hold_segment(body: Any, kind: str) -> None:
    for name in ("start", "end"):
        object.__setattr__(body, name, _vector(f"{kind}.{name}", getattr(body, name)))
    if not 0 < real(body.radius) < np.inf:
        raise ModelError(f"{kind}.radius: found {body.radius!r}, expected a length above 0 m; {_REMEDY}")


def _vector(place: str, value: Any) -> np.ndarray:
    vector = floats(value)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ModelError(f"{place}: found {told(value)}, expected three finite numbers; {_REMEDY}")
    return vector


def segment_distance(obstacle: Obstacle, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Least signed distance of segments, start and end (..., 3), from a convex obstacle: (...) in m.

    It is too large by no more than 0.5e-6 of the length of a segment. NaN ends give NaN.
    """
    way = end - start

    def at(place: np.ndarray) -> np.ndarray:
        return obstacle.distance(start + place[..., None] * way)

    low, high = np.zeros(way.shape[:-1]), np.ones(way.shape[:-1])
    left, right = high - _GOLDEN, low + _GOLDEN
    of_left, of_right = at(left), at(right)
    least = np.minimum(at(low), at(high))
    for _ in range(_SECTIONS):
        nearer = of_left < of_right  # the minimum is not beyond the farther of the two
        low, high = np.where(nearer, low, left), np.where(nearer, right, high)
        width = _GOLDEN * (high - low)
        place = np.where(nearer, high - width, low + width)
        value = at(place)
        left, right = np.where(nearer, place, right), np.where(nearer, left, place)
        of_left, of_right = np.where(nearer, value, of_right), np.where(nearer, of_left, value)
    return np.minimum(least, np.minimum(of_left, of_right))


def between_segments(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Distance of segments from a to b and from c to d, all (..., 3): (...) in m."""
    first, second, gap = b - a, d - c, a - c
    aa, bb = np.maximum((first**2).sum(-1), _LEAST), np.maximum((second**2).sum(-1), _LEAST)
    ab, ag, bg = (first * second).sum(-1), (first * gap).sum(-1), (second * gap).sum(-1)
    determinant = aa * bb - ab**2
    parallel = determinant < _LEAST * aa * bb
    on_first = np.where(parallel, 0.0, (ab * bg - bb * ag) / np.where(parallel, 1.0, determinant))
    on_first = np.clip(on_first, 0.0, 1.0)
    # the nearest place on the other segment, and from there the nearest one on this
    on_second = np.clip((ab * on_first + bg) / bb, 0.0, 1.0)
    on_first = np.clip((ab * on_second - ag) / aa, 0.0, 1.0)
    apart = gap + on_first[..., None] * first - on_second[..., None] * second
    return np.linalg.norm(apart, axis=-1)
