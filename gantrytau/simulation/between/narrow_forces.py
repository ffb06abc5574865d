"""Narrow forces: rates between two places that an integrator in long steps does not see.

The cubic through states and rates at two places has rates between them, which are compared with those of the equations:
in the middle, where a smooth motion has its rate to fourth order, and in more points where a state goes far in few steps.
Where they differ by more than a share of the motion, the interval is integrated again in short steps.
"""

import casadi as ca
import numpy as np

from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.time_grid import Trail

LOST = 1e-3  # of a state, or of its size: what an interval may lose by rates that were not seen
ASIDE = 0.05  # the same beside the middle, where the rate of the cubic is one of third order
APART = 0.02  # of the size of a state, about the distance of points between places
MOST_LOOKS = 100  # points between two places
SEEN = 2  # steps of the integrator in an interval: rates in it were seen
STARTING = 30  # steps of the integrator after it starts anew
PARTS = 4  # steps at least in an interval in which rates were not seen
AROUND = 2  # intervals behind such a one


class NarrowForces:
    """The intervals of a run in which steps are kept short, `until` a time, s, to `step`, s."""

    def __init__(self, coordinates: Coordinates):
        self.coordinates = coordinates
        self.begin = self.until = -np.inf
        self.step = np.inf

    def longest(self, t: float) -> float:
        """The longest step behind a time, s."""
        return self.step if self.begin <= t < self.until else np.inf

    def stepped_over(self, trail: Trail, here: int, count: int, steps: int, sizes: np.ndarray) -> bool:
        """Whether rates were stepped over in some intervals behind a place, which took so many steps; then they are short
        around the first of these. sizes: of the states.
        """
        c = self.coordinates
        if not c.curved or steps - STARTING > SEEN * count or self.longest(float(trail.t[here])) < np.inf:
            return False
        places = np.arange(here, here + count + 1)
        lost, looks = self._lost(trail, places, sizes, 0.5, LOST), 1
        if steps - STARTING <= count:
            moved = np.nanmax(np.abs(np.diff(trail.x[places], axis=0)) / sizes, initial=0.0)
            looks = int(min(max(moved / APART, 1.0), MOST_LOOKS))
            for share in (np.arange(looks) + 1) / (looks + 1) if looks > 1 else ():
                lost |= self._lost(trail, places, sizes, share, ASIDE)
        if not lost.any():
            return False
        first = here + int(np.argmax(lost))
        begin, end = max(first - 1, here), min(first + 1 + AROUND, trail.last)
        self.begin, self.until = float(trail.t[begin]), float(trail.t[end])
        self.step = float(trail.t[first + 1] - trail.t[first]) / max(PARTS, looks)
        trail.stops[[begin, end]] = True
        return True

    def _lost(
        self, trail: Trail, places: np.ndarray, sizes: np.ndarray, share: float, most: float
    ) -> np.ndarray:
        """In which intervals between places rates are others than those of the motion, at a share of the interval."""
        c, s = self.coordinates, share
        x, z, t, w = trail.x[places], trail.z[places], trail.t[places], trail.rows(places)
        h = np.diff(t)[:, None]
        rates = c.rates(x, z, t[:, None], t[:, None], w)[0]
        gone, first, last = np.diff(x, axis=0), rates[:-1], rates[1:]
        inside = x[:-1] + s * s * (3 - 2 * s) * gone + h * s * (1 - s) * ((1 - s) * first - s * last)
        along = 6 * s * (1 - s) * gone / h + (1 - s) * (1 - 3 * s) * first - s * (2 - 3 * s) * last
        begin, at, w = t[:-1], t[:-1] + s * h[:, 0], w[:-1]
        forces = c.settle(inside, (1 - s) * z[:-1] + s * z[1:], at, w)
        point = inside, forces, at[:, None], begin[:, None], w
        defect = h * (c.rates(*point)[0] - along)
        size = np.maximum(np.maximum(np.abs(x[1:]), np.abs(x[:-1])), sizes)
        lost = ~np.all(np.abs(defect) <= most * size, axis=1)
        for k in np.flatnonzero(lost):  # stiff equations make much of small errors of the states
            slopes = self._slopes(*(p[k : k + 1] for p in point))
            found = np.linalg.lstsq(np.eye(len(slopes)) - h[k] / 2 * slopes, defect[k], rcond=None)[0]
            lost[k] = np.any(np.abs(found) > LOST * size[k])
        return lost

    def _slopes(self, *point: np.ndarray) -> np.ndarray:
        """Jacobian of the rates at a point, with what the algebraics make of it."""
        c = self.coordinates
        n, m = len(c.states), len(c.algebraics)
        slopes = [(e, y) for e in (c.ode, c.algebraic) for y in (c.x, c.z)]
        made = c.function("slopes", lambda: [ca.jacobian(*pair) for pair in slopes])
        parts = c.kept("slopes", lambda: AtPlaces(made))(*point)
        shapes = (n, n), (m, n), (n, m), (m, m)  # columns, rows
        by_x, by_z, own, inner = (
            np.nan_to_num(p[0]).reshape(k).T for p, k in zip(parts, shapes, strict=True)
        )
        return by_x - by_z @ np.linalg.lstsq(inner, own, rcond=None)[0] if m else by_x
