"""A closer look at what a motion does between two points: whether it meets a singular pose there.

The distance from a singular pose falls to zero along a straight line and rises again behind it, while a
determinant changes its sign. Two ways to assemble may cross in that pose: an integrator that steps over it may come
out on the other way, where the determinant has its old sign. Then only the distance tells, and only to one who
walks up to the pose in steps that end before it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau.errors import SolveError
from gantrytau.simulation.conditioning import CLOSE, Look
from gantrytau.simulation.full_coordinates import Point

FORESIGHT = 1.5  # intervals over which a fall of the distance is led on: it may become steeper
SHARE = (
    0.5  # of the way to where the distance would be zero, or to where nothing was found, taken in one step
)
PROBE = 1e-4  # of the interval: a first step, which says how fast the distance falls
LONGEST = 0.25  # step, of the interval
SHORTEST = 2.0**-14  # step, of the interval, to come near to where the integration stops
SURPRISE = 0.25  # of the distance, by which it may miss what its fall had led to expect
MOST = 400  # steps; past a pose that is not met a motion needs about twenty


@dataclass(frozen=True)
class Approach:
    """What a walk towards a point found.

    point: the last one before the singular pose, or the end; distance: there; zero: time at which that distance
    would be zero, s; arrived: whether the end was reached; met: whether a singular point was seen on the way.
    """

    point: Point
    distance: float
    zero: float
    arrived: bool
    met: bool

    @property
    def singular(self) -> bool:
        """Whether a singular pose stands in the way."""
        return not self.arrived and (self.met or self.distance < 5 * CLOSE)


def doubtful(t: np.ndarray, look: Look) -> np.ndarray:
    """Whether a singular pose may lie between successive points, (points - 1,).

    t: times, (points,) in s. The distance is led on from both sides: it may have risen again within the interval.
    """
    d, h = look.distance, np.diff(t)
    rates = np.diff(d) / h
    falls = h * np.concatenate([[0.0], -rates[:-1]])  # what it loses in the interval if it goes on as before
    rises = h * np.concatenate([rates[1:], [0.0]])
    straight = np.minimum(d[:-1] - FORESIGHT * falls, d[1:] - FORESIGHT * rises) < CLOSE
    return straight | look.near[1:] | (look.side[:-1] * look.side[1:] < 0)


def approach(
    point: Point, end: float, step: Callable[[Point, float], Point], look: Callable[[Point], Look]
) -> Approach:
    """Walk from a point to the time `end`, or to just before the singular pose on the way.

    step: the point some seconds later, RuntimeError or SolveError where there is none. A step takes half of the way
    to where the distance would be zero, and is taken back where the distance is not what its fall led to expect.
    """
    length = end - point[2]
    distance, fall, size, arrived, met = float(look(point).distance[0]), 0.0, PROBE * length, False, False
    for _ in range(MOST):
        left = end - point[2]
        size = min(size, LONGEST * length)
        size = min(size, SHARE * distance / fall) if fall > 0 else size
        if arrived or size < min(SHORTEST * length, left):
            break
        size = min(size, left)
        try:
            there = step(point, size)
        except (RuntimeError, SolveError):
            size /= 2
            continue
        new = look(there)
        if new.near[0]:
            size, met = size / 2, True
            continue
        change = float(new.distance[0]) - distance
        if size > PROBE * length and abs(change + fall * size) > SURPRISE * distance:
            size /= 2
            continue
        arrived = size == left
        point, distance, fall, size = there, distance + change, -change / size, 2 * size
    wait = distance / fall if fall > 0 else np.inf
    return Approach(point, distance, point[2] + (wait if wait < length else 0.0), arrived, met)
