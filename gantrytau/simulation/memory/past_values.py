"""What delays remember of a run, and the polynomials that they hand to the integrator.

Of each interval between two places the values, rates and second rates at both of its ends are kept. A delayed value follows,
on an interval that is not longer than the delay, the polynomial of order 5 that has those of the history at both ends. What
is not smooth travels: a place is laid a delay behind it, again and again until it has become smooth.
"""

from bisect import bisect_left, insort

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.simulation.events.changes import Changes
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.memory.hermite import quintic, shifted, values_and_rates
from gantrytau.simulation.time_grid import Trail

SMOOTH = 6  # delays behind a kink the solution has so many derivatives more
SAME = 1e-10  # of the shortest delay: two times are one
MOST = 2_000_000  # intervals of one run
JUMP = 1e-9  # of the largest value, that a delayed value changes at one time
LEAST = 1e-9  # of the shortest delay: intervals are laid no closer


class PastValues:
    """The history of all delays of a run. Rows of the trail hold six coefficients for each, in the time behind the place."""

    def __init__(self, coordinates: Coordinates, trail: Trail, tolerance: float):
        self.coordinates, self.trail, self.tolerance = coordinates, trail, tolerance
        flat, table = coordinates.dae.flat, coordinates.dae.table
        self.delays = np.array([table.number(d.time) for d in flat.delays])
        self.shortest = float(self.delays.min())
        span = float(trail.t[-1] - trail.t[0])
        if span / self.shortest > MOST:
            raise ModelError(
                f"{flat.delays[int(np.argmin(self.delays))].name}: {self.shortest:g} s is less than a {MOST}th of the "
                f"{span:g} s of the simulation; take a longer delay or a shorter time"
            )
        self.columns = coordinates.delay_columns
        self.learned = 0  # places whose intervals before them are known
        self.size = np.zeros(self.delays.size)  # of the values
        self._ends = np.empty((2, 1024))  # of intervals, s
        self._data = np.empty((1024, 2, self.delays.size, 3))  # at both ends
        self._count = 0
        self._kinks: list[float] = []
        self._levels: dict[float, int] = {}

    def begin(self) -> None:
        """Before the start everything is as it is there."""
        self._first = np.zeros((self.delays.size, 3))
        self._first[:, 0] = self._rows(0)[:, 0]
        for course in self.trail.courses:
            for knot in course.times[(course.times >= self.trail.t[0]) & (course.times < self.trail.t[-1])]:
                self._travel(float(knot), 0, 0)

    def enter(self, here: int, changes: Changes) -> int:
        """Take note of what lies behind a place, and let delayed values jump there; the last place at this time."""
        trail, t = self.trail, float(self.trail.t[here])
        self._learn(here)
        if here == trail.last:
            return here
        level = self._level(t)
        if here == 0 or trail.stops[here] or trail.t[here - 1] == t:
            level = 0 if level is None else level
        if level is None:
            return here
        now = self._delayed(np.array([t]), np.array([trail.t[here + 1]]))[0, :, 0]
        before = self._rows(here)[:, 0]
        if np.any(np.abs(now - before) > JUMP * np.maximum(self.size, np.abs(now))) and trail.t[here + 1] > t:
            level = 0
            trail.repeat(here, written=True)
            here += 1
            self.learned = here
            self._fill(here, 1)
            trail.show(here - 1, here)
            w = trail.rows(np.array([here]))
            trail.z[here] = self.coordinates.settle(
                trail.x[here][None], trail.z[here][None], trail.t[here : here + 1], w
            )[0]
            here = changes.turn(here)
            self.learned = here
        self._travel(t, level, here)
        return here

    def ahead(self, here: int, count: int) -> int:
        """How many of some intervals the history covers, with their polynomials; perhaps places are laid closer."""
        trail = self.trail
        length = float(trail.t[here + 1] - trail.t[here])
        if length > self.shortest * (1 + SAME):
            parts = int(np.ceil(length / self.shortest))
            trail.insert(here, np.linspace(trail.t[here], trail.t[here + 1], parts + 1)[1:-1])
        reach = trail.t[here] + self.shortest * (1 + SAME)
        count = max(
            1, min(count, int(np.searchsorted(trail.t[here : here + count + 1], reach, side="right")) - 1)
        )
        trail.held[here + 1 : here + count + 1] = trail.held[here]
        self._fill(here, count)
        return count

    def too_wide(self, here: int, count: int) -> bool:
        """Whether places that were reached lie too far apart for polynomials between them; if so, more are laid."""
        trail = self.trail
        places = np.arange(here, here + count)
        h = np.diff(trail.t[here : here + count + 1])
        begin, end = self._along(places, places), self._along(places + 1, places)
        values = np.abs(np.concatenate([begin[..., 0], end[..., 0]])).max(axis=0)
        size = np.maximum(self.size, values)
        # between the cubic and the quintic in the middle; the error of the latter is about the 3/2 power of this
        h = h[:, None]
        apart = h**2 * (begin[..., 2] + end[..., 2]) - 2 * h * (end[..., 1] - begin[..., 1])
        apart = np.abs(apart) / 64 / np.where(size > 0, size, 1.0)
        wide = np.any(apart**1.5 > self.tolerance, axis=1) & (h[:, 0] > LEAST * self.shortest)
        for k in reversed(np.flatnonzero(wide).tolist()):
            place = here + k
            trail.insert(place, np.array([trail.t[place] + h[k, 0] / 2]))
        return bool(wide.any())

    def _along(self, places: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The delayed expressions at places as the rows of other places continue to them, (places, delays, 3)."""
        trail = self.trail
        return self.coordinates.delayed.at(
            trail.x[places], trail.z[places], trail.t[places], trail.t[rows], trail.rows(rows)
        )

    def _learn(self, here: int) -> None:
        """Keep what is known of the intervals up to a place."""
        trail = self.trail
        places = np.arange(self.learned, here)
        places = places[trail.t[places + 1] > trail.t[places]]
        self.learned = here
        if not places.size:
            return
        found = np.stack([self._along(places, places), self._along(places + 1, places)], axis=1)
        self.size = np.maximum(self.size, np.abs(found[..., 0]).max(axis=(0, 1)))
        while self._count + places.size > len(self._data):
            self._data = np.concatenate([self._data, np.empty_like(self._data)])
            self._ends = np.concatenate([self._ends, np.empty_like(self._ends)], axis=1)
        new = slice(self._count, self._count + places.size)
        self._data[new], self._ends[:, new] = found, [trail.t[places], trail.t[places + 1]]
        self._count += places.size

    def _fill(self, here: int, count: int) -> None:
        """Lay the polynomials of some intervals into the trail, and the last one on to the place where it ends."""
        t = self.trail.t[here : here + count + 1]
        h = np.diff(t)
        begin, end = self._delayed(t[:-1], t[1:]), self._delayed(t[1:], t[:-1])
        found = np.stack([quintic(begin[:, d], end[:, d], h) for d in range(self.delays.size)], axis=1)
        last = shifted(found[-1], h[-1])
        self._set(np.arange(here, here + count + 1), np.concatenate([found, last[None]]))

    def _delayed(self, times: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Value, rate and second rate of the delayed values at times, on the side of others, (n, delays, 3)."""
        found = np.empty((times.size, self.delays.size, 3))
        starts, ends = self._ends[:, : self._count]
        for d, delay in enumerate(self.delays):
            at = times - delay
            side = np.clip(towards - times, -SAME * self.shortest, SAME * self.shortest)
            k = np.searchsorted(starts, at + 2 * side, side="right") - 1
            found[:, d] = self._first[d]
            old = (k >= 0) & (self._count > 0)
            if not old.any():
                continue
            k = k[old]
            begin, end = self._data[k, 0, d], self._data[k, 1, d]
            s = np.clip(at[old] - starts[k], 0.0, ends[k] - starts[k])
            found[old, d] = values_and_rates(quintic(begin, end, ends[k] - starts[k]), s)
        return found

    def _rows(self, k: int) -> np.ndarray:
        return self.trail.held[k, self.columns].reshape(self.delays.size, -1)

    def _set(self, places: np.ndarray, coefficients: np.ndarray) -> None:
        self.trail.held[places, self.columns] = coefficients.reshape(places.size, -1)

    def _level(self, t: float) -> int | None:
        """How many delays ago something was not smooth at a time, None if nothing was."""
        k = bisect_left(self._kinks, t - SAME * self.shortest)
        near = k < len(self._kinks) and self._kinks[k] <= t + SAME * self.shortest
        return self._levels[self._kinks[k]] if near else None

    def _travel(self, t: float, level: int, here: int) -> None:
        """Lay places a delay behind a time at which something is not smooth, and remember them."""
        for delay in np.unique(self.delays).tolist() if level < SMOOTH else ():
            then = t + delay
            if not then < self.trail.t[-1] * (1 - 1e-15):
                continue
            known = self._level(then)
            if known is None:
                self.trail.stop_at(then, here)
                insort(self._kinks, then)
                self._levels[then] = level + 1
            elif known > level + 1:
                k = bisect_left(self._kinks, then - SAME * self.shortest)
                self._levels[self._kinks[k]] = level + 1
