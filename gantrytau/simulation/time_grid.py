"""The places of one run: times at which it is looked at or stops, and what was found there."""

from collections.abc import Mapping

import numpy as np

from gantrytau.simulation.events.instants_on_mesh import instants, on_mesh
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.memory.hermite import ORDER, shifted
from gantrytau.simulation.signals import SampledCourse, Signal

NEAR = 64  # times the rounding of time, within which a jump is that of an output point
LEAST_STEPS = 500  # of a run between looks for singular poses and switches, whatever points are asked for


class Trail:
    """Places in order of time: t (n,) in s, which repeats where something jumps, before and behind; x, z: states and
    algebraics, a row each; held: what is held from there on, sampled variables, discretes, then modes; due: which of the
    first are sampled there; periods: of these, s; driven: inputs that are given by samples, behind their jumps; stops:
    whether an integration ends there; kept: whether results show a place.
    """

    def __init__(
        self, coordinates: Coordinates, signals: Mapping[str, Signal], grid: np.ndarray, spans: np.ndarray
    ):
        """spans: of time, (n, 2) in s, at whose ends an integration ends."""
        self.courses = [s for n in coordinates.sampled if isinstance(s := signals[n], SampledCourse)]
        self._constant = np.array([s.held for s in self.courses], dtype=bool)
        self._knots = [on_mesh(grid, s.times) for s in self.courses]
        knots = np.concatenate([grid[:1], *self._knots])
        knots = knots[(knots > grid[0]) & (knots < grid[-1])]
        parts = max(1, -(-LEAST_STEPS // (grid.size - 1)))
        fine = np.interp(np.arange((grid.size - 1) * parts + 1) / parts, np.arange(grid.size), grid)
        fine[::parts] = grid
        self._rooms: dict[str, np.ndarray] = {}  # of the rows, with some to spare
        self._past, past = coordinates.delay_columns, len(coordinates.dae.flat.delays) > 0
        watched = coordinates.conditioning.needed or len(coordinates.switches) or len(spans) or past
        watched = watched or coordinates.curved
        mesh = np.unique(np.concatenate([fine if watched else grid, knots]))
        table, events = coordinates.dae.table, coordinates.dae.flat.sampled
        self.periods = coordinates.kept("periods", lambda: np.array([table.number(s.period) for s in events]))
        found = instants(mesh, coordinates.held, self.periods)
        self.t, self.due = found.mesh, found.due
        self.driven = self._values(self.t)
        before = self._doubled(max(grid.size, LEAST_STEPS), len(coordinates.switches) > 0)
        self.stops = np.asarray(self.due.any(axis=1))
        self.stops[-1] = True
        self.stops[before] = True
        self.stops[np.searchsorted(self.t, spans[:, 0], side="right") - 1] = True
        self.stops[np.minimum(np.searchsorted(self.t, spans[:, 1]), self.last)] = True
        size = self.t.size
        self.kept = np.zeros(size, dtype=bool)
        self.kept[np.searchsorted(self.t, grid, side="right") - 1] = True
        if before.size <= max(grid.size, LEAST_STEPS):
            self.kept[before] = self.kept[before + 1] = True
        self.x = np.full((size, len(coordinates.states)), np.nan)
        self.z = np.full((size, len(coordinates.algebraics)), np.nan)
        names = (*coordinates.held, *coordinates.discretes)
        past = (ORDER + 1) * len(coordinates.dae.flat.delays)
        self.held = np.full((size, len(names) + past + len(coordinates.switches)), np.nan)
        self.held[0] = [
            *(coordinates.dae.start[n] for n in names),
            *(0.0 for _ in range(past)),
            *(0.0 for _ in coordinates.switches.turns),
        ]

    @property
    def last(self) -> int:
        """The last place."""
        return self.t.size - 1

    def stretch(self, k: int) -> int:
        """Number of intervals from a place to the next stop."""
        return 1 + int(np.argmax(self.stops[k + 1 :]))

    def twice(self, k: int) -> bool:
        """Whether there is a second place at this time, behind a jump of the inputs."""
        return k < self.last and bool(self.t[k + 1] == self.t[k])

    def shown(self, first: int, last: int) -> np.ndarray:
        """The places behind the first that results show, and the last."""
        return np.append(first + 1 + np.flatnonzero(self.kept[first + 1 : last]), last)

    def inputs(self, k: int) -> np.ndarray:
        """Values and slopes of the sampled inputs on the interval behind a place, and what is held there."""
        return self.rows(np.array([k]))[0] if self.courses else self.held[k].copy()

    def rows(self, places: np.ndarray) -> np.ndarray:
        """The inputs at places, a row each."""
        if not self.courses:
            return self.held[places]
        after = np.minimum(places + 1, self.last)
        h = (self.t[after] - self.t[places])[:, None]
        rise = np.where(self._constant, 0.0, self.driven[after] - self.driven[places])
        slopes = np.divide(rise, h, out=np.zeros_like(rise), where=h > 0)
        return np.hstack([self.driven[places], slopes, self.held[places]])

    def _values(self, times: np.ndarray) -> np.ndarray:
        """The sampled inputs at times, (n, inputs), behind their jumps."""
        found = np.empty((times.size, len(self.courses)))
        for column, (course, knots) in enumerate(zip(self.courses, self._knots, strict=True)):
            row = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, None)
            found[:, column] = course.values[row] if course.held else np.interp(times, knots, course.values)
        return found

    def _doubled(self, most: int, always: bool) -> np.ndarray:
        """Lay a place before each one in which an input jumps, unless there are too many to be shown; where they are.

        always: lay them anyway, for what switches by inputs.
        """
        jumps = 1 + np.flatnonzero(np.any(np.diff(self.driven[:, self._constant], axis=0) != 0, axis=1))
        if jumps.size > most and not always:
            return np.zeros(0, dtype=int)
        before = np.where(self._constant, self.driven[jumps - 1], self.driven[jumps])
        self.t = np.insert(self.t, jumps, self.t[jumps])
        self.due = np.insert(self.due, jumps, False, axis=0)
        self.driven = np.insert(self.driven, jumps, before, axis=0)
        return jumps + np.arange(jumps.size)

    def insert(self, k: int, times: np.ndarray, *, stop: bool = False) -> None:
        """Add places behind place k; nothing is known of them yet but what is held from k on."""
        new, before = slice(k + 1, k + 1 + len(times)), self.t[k]
        self._make_room(k + 1, len(times))
        self.t[new], self.stops[new], self.due[new], self.kept[new] = times, stop, False, False
        if self.courses:
            self.driven[new] = np.where(self._constant, self.driven[k], self._values(times))
        self.held[new] = self.held[k]
        if self._past.stop > self._past.start:
            past = self.held[new, self._past].reshape(len(times), -1, ORDER + 1)
            self.held[new, self._past] = shifted(past, (times - before)[:, None]).reshape(len(times), -1)

    def _make_room(self, k: int, count: int) -> None:
        """Move the places from k on; of those ahead nothing is known but times and what is to be done there."""
        size, room = self.t.size, len(self._rooms.get("t", ()))
        if size + count > room:
            for name in ("t", "stops", "due", "kept", "driven", "x", "z", "held"):
                old = getattr(self, name)
                self._rooms[name] = np.empty((2 * (size + count), *old.shape[1:]), dtype=old.dtype)
                self._rooms[name][:size] = old
        for name, rows in self._rooms.items():
            if name in ("t", "stops", "due", "kept", "driven"):
                rows[k + count : size + count] = rows[k:size]
            setattr(self, name, rows[: size + count])

    def repeat(self, k: int, *, written: bool) -> None:
        """Give place k a second one behind what jumps there; written: whether results show the first."""
        self.insert(k, self.t[k : k + 1])
        self.x[k + 1], self.z[k + 1] = self.x[k], self.z[k]
        if not written:
            self.kept[k : k + 2] = False, self.kept[k]

    def show(self, before: int, behind: int) -> None:
        """Let results have both sides of a jump; where rounding put it behind an output point, it is there."""
        near = max(before - 1, 0)
        if self.kept[near] and self.t[before] - self.t[near] <= NEAR * np.spacing(abs(self.t[before])):
            self.t[before : behind + 1] = self.t[near]
            before = near
        self.kept[[before, behind]] = True

    def stop_at(self, t: float, behind: int) -> None:
        """Let an integration end at a time behind a place."""
        k = behind + int(np.searchsorted(self.t[behind:], t))
        for near in (k - 1, k):
            if behind < near <= self.last and abs(self.t[near] - t) <= 8 * np.spacing(abs(t)):
                self.stops[near] = True
                return
        if k <= self.last:
            self.insert(k - 1, np.array([t]), stop=True)
