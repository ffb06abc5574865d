"""Looks: times at which margins of switches are evaluated, close enough to see each switch turn.

The argument of a sine, a cosine or a tangent within a margin moves by less than a share of its period from one look to the
next, and the cubic through the values and rates at two looks foretells the one between them.
"""

import casadi as ca
import numpy as np

from gantrytau.language.symbols import time
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.events.crossings import Crossing
from gantrytau.simulation.events.margins import SwitchMargins
from gantrytau.simulation.events.phases import SHARE, moved, phases_along
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.time_grid import Trail

STEPS_BETWEEN = 8  # of the integrator between two looks: more, and they are laid closer
AHEAD = 50  # intervals that are divided as well
FINER = 4  # parts of an interval across which a margin goes otherwise than foretold
RESOLVED = 1e6  # times rounding: a margin that is no larger foretells nothing
LEAST_INTERVAL = 64  # times the rounding of time: two looks are farther apart
MOST_PARTS = 1000  # of an interval at once


class Looks:
    """The places of a trail at which switches are looked at, laid closer where that is needed."""

    def __init__(self, coordinates: Coordinates, trail: Trail):
        self.trail, self.switches = trail, len(coordinates.switches)
        self._phases = coordinates.kept("phases", lambda: _phases_of(coordinates)) if self.switches else None

    def by_steps(self, here: int, count: int, steps: float, least: float) -> bool:
        """Lay places ahead closer if an integrator took many steps for some intervals; whether it did.

        least: how close at most, s.
        """
        parts = int(steps // (STEPS_BETWEEN * count))
        if parts < 2 or not self.switches:
            return False
        return self._divide(here, np.full(min(max(count, AHEAD), self.trail.last - here), parts), least)

    def by_margins(self, places: np.ndarray, gaps: SwitchMargins, found: Crossing | None) -> bool:
        """Lay places closer if gaps may turn more than once in an interval up to a crossing; whether they did."""
        trail = self.trail
        last = places.size - 1 if found is None else found.place + 1
        t = trail.t[places]
        with np.errstate(invalid="ignore", over="ignore"):  # behind a crossing the motion is none
            parts = np.where(unforeseen(t[: last + 2], gaps.until(last + 2))[:last], FINER, 1)
        ahead = np.zeros(0, dtype=int)
        if self._phases is not None:
            values, rates = self._phases(trail.x[places], trail.z[places], t, t, trail.rows(places))
            parts = np.maximum(parts, np.ceil(moved(np.diff(t), values, rates)[:last]).astype(int))
            if np.any(parts > 1):  # those behind are likely to need it, too
                h = np.diff(trail.t[places[last] : places[last] + AHEAD + 1])
                ahead = np.ceil(h * np.abs(np.nan_to_num(rates[last])).max() / SHARE).astype(int)
        if not np.any(parts > 1):
            return False
        return self._divide(int(places[0]), np.concatenate([parts, ahead]), 0.0)

    def _divide(self, first: int, parts: np.ndarray, least: float) -> bool:
        """Divide the intervals behind a place into parts that are longer than `least`, s, and than rounding."""
        trail, before = self.trail, self.trail.last
        for k in reversed(range(parts.size)):
            begin, end = trail.t[first + k : first + k + 2]
            count = min(int(parts[k]), MOST_PARTS)
            if count > 1 and (end - begin) / count > max(least, LEAST_INTERVAL * np.spacing(abs(end))):
                trail.insert(first + k, np.linspace(begin, end, count + 1)[1:-1])
        return trail.last > before


def _phases_of(coordinates: Coordinates) -> AtPlaces | None:
    """Phases within what switches by states."""
    c = coordinates
    by_states = [i for i, timed in enumerate(c.switches.timed) if not timed]
    within = ca.vertcat(ca.SX(0, 1), c.switches.margins[by_states])
    within = ca.vertcat(within, c.algebraic) if ca.depends_on(within, c.z) else within
    moving, along = ca.vertcat(c.x, c.z, time), ca.vertcat(c.ode, ca.SX(c.z.numel(), 1), 1)
    return phases_along(within, c.arguments, moving, along)


def unforeseen(t: np.ndarray, gaps: SwitchMargins) -> np.ndarray:
    """Intervals between times t (n,) in s, (n - 1,), across which gaps do not go as those beside them lead to expect."""
    found = np.zeros(t.size - 1, dtype=bool)
    h, g, rates = (t[2:] - t[:-2])[:, None], gaps.values, gaps.rates
    s = np.diff(t)[:-1, None] / h
    b, e, rise = h * rates[:-2], h * rates[2:], g[2:] - g[:-2]
    c, d = 3 * rise - 2 * b - e, b + e - 2 * rise
    missed = np.abs(g[:-2] + s * (b + s * (c + s * d)) - g[1:-1])
    bent = np.abs(b + s * (2 * c + s * 3 * d) - h * rates[1:-1]) / 4
    size = np.abs([g[:-2], g[1:-1], g[2:]]).max(axis=0) + RESOLVED * gaps.noise[1:-1]
    bad = np.any(np.maximum(missed, bent) > size, axis=1)
    found[:-1] |= bad
    found[1:] |= bad
    return found
