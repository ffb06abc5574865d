"""Obstacles around a robot, and how far its links and plate are from them.

Links and plate are capsules: all points within a radius of a segment. Obstacles are convex, so the signed distance along
a segment is a convex function of the place on it, and its minimum is found by golden section for any of them. Boxes,
cylinders and capsules know most of these minima in closed form.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from gantrytau.border.checks import array, number
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.poses import rotations
from gantrytau.language.self_description.appearance import Ball, Cuboid, Shape, Stick

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_SECTIONS = 30  # of a segment, which leave 0.5e-6 of it
_LEAST = 1e-12  # of a length that is divided by
_TOUCH = 1e-9  # m, below which a segment counts as touching, and closed forms as exact
_REMEDY = "give numbers in m, in the axes of the base"


class Obstacle(Protocol):
    """What has a signed distance: a convex body."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points (..., 3) from the surface in m, negative inside: (...)."""
        ...


@dataclass(frozen=True, eq=False)
class Box(Record):
    """A box between two corners, low and high, (3,) in m; R (3, 3) turns it about its centre."""

    low: Any
    high: Any
    R: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self):
        low, high = (array("Box", name, getattr(self, name), (3,), unit="m") for name in ("low", "high"))
        if not (low < high).all():
            raise ModelError(
                f"Box: found low {low.tolist()} and high {high.tolist()}, expected low < high; {_REMEDY}"
            )
        for name, value in (
            ("low", low),
            ("high", high),
            ("R", rotations("Box", "R", self.R, 1).reshape(3, 3)),
        ):
            object.__setattr__(self, name, value)

    def shapes(self) -> Iterator[Shape]:
        """How pictures show it."""
        yield Cuboid(at=(self.low + self.high) / 2, size=self.high - self.low, R=self.R)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See Obstacle."""
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        beyond = np.abs((points - middle) @ self.R) - half
        outside = np.maximum(beyond, 0.0)
        return np.sqrt((outside**2).sum(-1)) + np.minimum(beyond.max(-1), 0.0)

    def from_segment(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """See `segment_distance`: the slope of the squared distance rises piecewise linearly, and its zero is known."""
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        at, way = (start - middle) @ self.R, (end - start) @ self.R
        with np.errstate(divide="ignore", invalid="ignore"):
            passed = np.stack([(sign * half - at) / way for sign in (1, -1)])
        passed = np.where(way == 0, 0.0, np.clip(passed, 0.0, 1.0))  # along a face it is never passed
        ends = np.zeros((2, *way.shape[:-1]))
        ends[1] = 1.0
        place = np.concatenate([*np.moveaxis(passed, -1, 0), ends])
        slope = np.zeros_like(place)
        for k in range(3):
            point = at[..., k] + place * way[..., k]
            slope += (point - np.clip(point, -half[k], half[k])) * way[..., k]
        falls = slope < 0
        t0, t1 = np.where(falls, place, 0.0).max(axis=0), np.where(falls, 1.0, place).min(axis=0)
        g0, g1 = np.where(falls, slope, -np.inf).max(axis=0), np.where(falls, np.inf, slope).min(axis=0)
        with np.errstate(invalid="ignore"):
            between = t0 + (t1 - t0) * g0 / (g0 - g1)
        least = np.where(np.isfinite(g0) & np.isfinite(g1), between, np.where(g0 < 0, t0, t1))
        nearest = at + least[..., None] * way
        found = np.linalg.norm(nearest - np.clip(nearest, -half, half), axis=-1)
        within = found < _TOUCH
        if within.any():
            found[within] = _deepest(at[within], way[within], half)
        return found


def _deepest(at: np.ndarray, way: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Least of max(|x| - half) for x = at + t way, (n, 3), t from 0 to 1: where two of these lines meet, or at an end."""
    value, slope = (
        np.concatenate([sign * x.T - shift for sign in (1, -1)])
        for x, shift in ((at, half[:, None]), (way, 0.0))
    )
    first, second = np.triu_indices(6, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = (value[second] - value[first]) / (slope[first] - slope[second])
    ends = np.zeros((2, len(at)))
    ends[1] = 1.0
    place = np.concatenate([np.clip(np.nan_to_num(place), 0.0, 1.0), ends])
    return np.max([value[k] + place * slope[k] for k in range(6)], axis=0).min(axis=0)


@dataclass(frozen=True, eq=False)
class Cylinder(Record):
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

    def shapes(self) -> Iterator[Shape]:
        """How pictures show it."""
        yield Stick(a=self.start, b=self.end, radius=self.radius)

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

    def from_segment(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """See `segment_distance`: the capsule around the cylinder is no farther, and as near beside its round face."""
        place, apart = _nearest(start, end, self.start, self.end)
        found = self.distance(start + place[..., None] * (end - start))
        return _searched(self, start, end, found, found > apart - self.radius + _TOUCH)


@dataclass(frozen=True, eq=False)
class Capsule(Record):
    """All points within a radius of the segment from start to end, (3,) in m; a sphere where these are the same."""

    start: Any
    end: Any
    radius: float

    def __post_init__(self):
        _hold_segment(self, "Capsule")

    def shapes(self) -> Iterator[Shape]:
        """How pictures show it."""
        yield Stick(a=self.start, b=self.end, radius=self.radius)
        yield Ball(at=self.start, radius=self.radius)
        yield Ball(at=self.end, radius=self.radius)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """See Obstacle."""
        axis = self.end - self.start
        gap = points - self.start
        place = np.clip((gap @ axis) / max(axis @ axis, _LEAST), 0.0, 1.0)
        return np.linalg.norm(gap - place[..., None] * axis, axis=-1) - self.radius

    def from_segment(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """See `segment_distance`."""
        return between_segments(start, end, self.start, self.end) - self.radius


def _hold_segment(body: Any, kind: str) -> None:
    object.__setattr__(body, "radius", number(kind, "radius", body.radius, unit="m", above=0.0))
    for name in ("start", "end"):
        object.__setattr__(body, name, array(kind, name, getattr(body, name), (3,), unit="m"))


def segment_distance(obstacle: Obstacle, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Least signed distance of segments, start and end (..., 3), from a convex obstacle: (...) in m.

    It is too large by no more than 0.5e-6 of the length of a segment. NaN ends give NaN.
    """
    if not isinstance(obstacle, (Box, Cylinder, Capsule)):
        return _golden_section(obstacle, start, end)
    start, end = np.broadcast_arrays(start, end)
    found = obstacle.from_segment(start.reshape(-1, 3), end.reshape(-1, 3))
    return found.reshape(start.shape[:-1])[()]


def _searched(
    obstacle: Obstacle, start: np.ndarray, end: np.ndarray, found: np.ndarray, unsure: np.ndarray
) -> np.ndarray:
    """Distances (n,) of n segments, those that are not sure by search."""
    if unsure.any():
        found[unsure] = _golden_section(obstacle, start[unsure], end[unsure])
    return found


def _golden_section(obstacle: Obstacle, start: np.ndarray, end: np.ndarray) -> np.ndarray:
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
    return _nearest(a, b, c, d)[1]


def _nearest(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of segments from a to b and from c to d: the place on the first, 0 to 1, where they are nearest, and how far apart."""
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
    return on_first, np.linalg.norm(apart, axis=-1)
