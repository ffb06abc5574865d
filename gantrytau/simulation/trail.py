"""The places of one run: times at which it is looked at or stops, and what was found there."""

from collections.abc import Mapping

import numpy as np

from gantrytau.simulation.events.instants_on_mesh import instants
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.signals import PiecewiseLinear, Signal

LEAST_STEPS = (
    500  # between places at which singular poses and switches are looked for, whatever points are asked for
)


class Trail:
    """Places in order of time: t (n,) in s, which repeats where something jumps, before and behind; x, z: states and
    algebraics, a row each; held: what is held from there on, sampled variables, then modes; due: which of the former
    are sampled there; stops: whether an integration ends there; kept: places of the output points.
    """

    def __init__(
        self, coordinates: Coordinates, signals: Mapping[str, Signal], grid: np.ndarray, spans: np.ndarray
    ):
        """spans: of time, (n, 2) in s, at whose ends an integration ends."""
        samples = {n: s for n, s in signals.items() if isinstance(s, PiecewiseLinear)}
        self.samples = [samples[n] for n in coordinates.sampled]
        knots = np.concatenate([s.times for s in self.samples]) if self.samples else np.array([])
        knots = knots[(knots > grid[0]) & (knots < grid[-1])]
        parts = max(1, -(-LEAST_STEPS // (grid.size - 1)))
        fine = np.interp(np.arange((grid.size - 1) * parts + 1) / parts, np.arange(grid.size), grid)
        fine[::parts] = grid
        watched = coordinates.conditioning.needed or len(coordinates.switches) or len(spans)
        mesh = np.unique(np.concatenate([fine if watched else grid, knots]))
        table, events = coordinates.dae.table, coordinates.dae.flat.sampled
        periods = np.array([table.number(s.period) for s in events])
        found = instants(mesh, coordinates.held, periods)
        self.t, self.due = found.mesh, found.due
        self.stops = np.asarray(self.due.any(axis=1))
        self.stops[-1] = True
        self.stops[np.searchsorted(self.t, spans[:, 0], side="right") - 1] = True
        self.stops[np.minimum(np.searchsorted(self.t, spans[:, 1]), self.last)] = True
        self.kept: np.ndarray = np.searchsorted(self.t, grid)
        size = self.t.size
        self.x = np.full((size, len(coordinates.states)), np.nan)
        self.z = np.full((size, len(coordinates.algebraics)), np.nan)
        self.held = np.full((size, len(coordinates.held) + len(coordinates.switches)), np.nan)
        self.held[0] = [
            *(coordinates.dae.start[n] for n in coordinates.held),
            *(0.0 for _ in coordinates.switches.turns),
        ]

    @property
    def last(self) -> int:
        """The last place."""
        return self.t.size - 1

    def stretch(self, k: int) -> int:
        """Number of intervals from a place to the next stop."""
        return 1 + int(np.argmax(self.stops[k + 1 :]))

    def inputs(self, k: int) -> np.ndarray:
        """Values and slopes of the sampled inputs on the interval behind a place, and what is held there."""
        t = self.t[k]
        h = self.t[min(k + 1, self.last)] - t
        values = np.array([np.interp(t, s.times, s.values) for s in self.samples])
        after = np.array([np.interp(t + h, s.times, s.values) for s in self.samples])
        slopes = (after - values) / h if h > 0 else 0.0 * values
        return np.concatenate([values, slopes, self.held[k]])

    def rows(self, places: np.ndarray) -> np.ndarray:
        """The inputs at places, a row each."""
        return np.array([self.inputs(k) for k in places]) if self.samples else self.held[places]

    def insert(self, k: int, times: np.ndarray, *, stop: bool = False) -> None:
        """Add places behind place k; nothing is known of them yet but what is held from k on."""
        at = np.full(len(times), k + 1)
        self.t = np.insert(self.t, at, times)
        self.stops = np.insert(self.stops, at, stop)
        self.due = np.insert(self.due, at, False, axis=0)
        self.x = np.insert(self.x, at, np.nan, axis=0)
        self.z = np.insert(self.z, at, np.nan, axis=0)
        self.held = np.insert(self.held, at, self.held[k], axis=0)
        self.kept[self.kept > k] += len(times)

    def repeat(self, k: int, *, written: bool) -> None:
        """Give place k a second one behind what jumps there; written: whether results show the first."""
        self.insert(k, self.t[k : k + 1])
        self.x[k + 1], self.z[k + 1] = self.x[k], self.z[k]
        if not written:
            self.kept[self.kept == k] = k + 1

    def stop_at(self, t: float, behind: int) -> None:
        """Let an integration end at a time behind a place."""
        k = behind + int(np.searchsorted(self.t[behind:], t))
        for near in (k - 1, k):
            if behind < near <= self.last and abs(self.t[near] - t) <= 8 * np.spacing(abs(t)):
                self.stops[near] = True
                return
        if k <= self.last:
            self.insert(k - 1, np.array([t]), stop=True)
