"""Singular poses crossed with the speeds before them.

In a pose where constraints become dependent, ways to move cross, and forces are not determined. A smooth motion is continued
by the polynomial of degree 5 through states and rates at three places before the pose, to as far behind it, and is accepted
if the constraints and the equations of motion hold there to the error of the polynomial.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.simulation.integrators import Integrators
from gantrytau.simulation.singular_poses import Approach, Point
from gantrytau.simulation.time_grid import Trail

AWAY = 0.02  # distance from the pose, relative to that of the measure, at which the motion is left and taken up again
FINER = 1e-3  # of the tolerance, between the three places: extrapolation enlarges errors some hundred times
MISSED = 1e-5  # of a state, or of its size: correction of the polynomial by the constraints
BENT = 1e-2  # of the largest rate of the three places: error of the rates behind the pose


@dataclass(frozen=True)
class Across:
    """Polynomial across a pose: times (4,) in s, three before it and one behind, and the coefficients of the states."""

    t: np.ndarray
    coefficients: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """States at times, (times, n)."""
        return np.vander((t - self.t[0]) / (self.t[1] - self.t[0]), 6, increasing=True) @ self.coefficients


def left_at(found: Approach) -> float:
    """Time of the first of the three places before a pose, s; -inf where the time of the pose is not known."""
    part = _part(found)
    return found.zero - 3 * part if part > 0 else -np.inf


def _part(found: Approach) -> float:
    """Time, s, from where the motion is left to the pose."""
    wait = found.zero - found.point[2]
    return AWAY / found.distance * wait if wait > 0 and found.distance > 0 else 0.0


def across(found: Approach, begin: Point, integrators: Integrators) -> tuple[Across, Point] | None:
    """Polynomial across a pose from a point before it, and the point behind the pose; None if the motion does not go on."""
    c, part, points = integrators.coordinates, _part(found), [begin]
    fine = Integrators(
        c, FINER * integrators.tolerance, integrators.longest, integrators.interval, integrators.work
    )
    try:
        for count in (3, 2, 1):
            points.append(fine.step(points[-1], found.zero - count * part - points[-1][2]))
    except (RuntimeError, SolveError):
        return None
    x, z, _, w = (np.array(p) for p in zip(*points[1:], strict=True))
    t = found.zero + part * np.array([-3.0, -2.0, -1.0, 1.0])
    rates = c.rates(x, z, t[:3, None], t[:3, None], w)[0]
    s = np.arange(3.0)
    powers = np.vander(s, 6, increasing=True)
    slopes = np.hstack([np.zeros((3, 1)), powers[:, :5] * np.arange(1, 6)])
    way = Across(t, np.linalg.solve(np.vstack([powers, slopes]), np.vstack([x, part * rates])))
    far, when = way.at(t[3:]), t[3:]
    try:
        there = c.project(far, when, w[2:])
    except SolveError:
        return None
    size = np.maximum(np.abs(x).max(axis=0), integrators.sizes)
    forces = c.settle(there, z[2:], when, w[2:])
    now = c.rates(there, forces, when[:, None], when[:, None], w[2:])[0]
    foretold = (np.append(0.0, 4.0 ** np.arange(5) * np.arange(1, 6)) @ way.coefficients) / part
    missed = np.max(np.abs(there - far) / size)
    bent = np.max(np.abs(now - foretold) / np.maximum(np.abs(rates).max(axis=0), integrators.sizes))
    if not (missed <= MISSED and bent <= BENT):
        return None
    return way, (there[0], forces[0], float(when[0]), w[2])


def lay(trail: Trail, k: int, way: Across, behind: Point) -> int:
    """Fill a trail from place k up to the point behind the pose; the place of this point."""
    end = k + int(np.searchsorted(trail.t[k:], behind[2]))
    trail.insert(end - 1, np.array([behind[2]]), stop=True)
    trail.stops[min(end + 1, trail.last)] = True  # the interval behind it is shorter than others
    places = np.arange(k + 1, end + 1)
    trail.held[places] = trail.held[k]
    trail.x[places] = way.at(trail.t[places])
    share = ((trail.t[places] - trail.t[k]) / (behind[2] - trail.t[k]))[:, None]
    trail.z[places] = (1 - share) * trail.z[k] + share * behind[1]  # forces are not determined in the pose
    trail.x[end], trail.z[end] = behind[:2]
    return end
