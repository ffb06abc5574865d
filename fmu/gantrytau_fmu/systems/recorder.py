"""What a co-simulation found so far, and the result that it becomes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gantrytau.results.result import Result
from gantrytau_fmu.systems.component import dotted
from gantrytau_fmu.systems.connected_system import ConnectedSystem, Place, SignalLink
from gantrytau_fmu.systems.drives import Drive
from gantrytau_fmu.systems.master import Grid, RunningSystem
from gantrytau_fmu.systems.slave import RunEnded

ROWS = 1024  # made room for at first; then always twice as many


class Recorder:
    """Values at the communication points, one row each.

    places: component and scalar of what is asked for; `wanted`: what has to be read of each component for it.
    Connected and driven inputs are not read but computed from what drives them.
    """

    def __init__(self, system: ConnectedSystem, places: Sequence[Place], grid: Grid):
        self.system, self.places, self.grid = system, tuple(places), grid
        self.links: dict[Place, SignalLink] = {link.target: link for link in system.links}
        self.count = 0
        self.ended, self.last = "stop", grid.stop  # why, and when, s
        self.rows = np.empty((0, 0))
        self.columns: dict[Place, int] = {}
        self.held: dict[Place, float] = {}
        read = [place for place in places if not self._input(place)]
        self.wanted = {owner: [name for place, name in read if place == owner] for owner in system.components}

    def begin(self, running: RunningSystem) -> None:
        """Read what never changes, and the first row."""
        free = [
            place
            for place in self.places
            if self._input(place) and place not in self.links and place not in self.system.drives
        ]
        for owner in {owner for owner, _ in free}:
            names = tuple(name for place, name in free if place == owner)
            values = running.parts[owner].get(names)
            self.held.update(((owner, name), value) for name, value in zip(names, values, strict=True))
        for owner, names in running.wanted.items():
            for name in names:
                self.columns[owner, name] = len(self.columns)
        self.rows = np.empty((min(ROWS, self.grid.count + 1), len(self.columns)))
        self.add(running)

    def add(self, running: RunningSystem) -> None:
        """The values of now as one more row."""
        if self.count == len(self.rows):
            more = min(2 * self.count, self.grid.count + 1) - self.count
            self.rows = np.concatenate([self.rows, np.empty((more, len(self.columns)))])
        self.rows[self.count] = [value for values in running.values.values() for value in values]
        self.count += 1

    def end(self, running: RunningSystem, ended: RunEnded) -> None:
        """A component has ended the run: one more row, at that time, if no other has gone on beyond or stayed behind."""
        self.ended = ended.reason
        if len(running.values) == 1:
            running.values[ended.owner] = ended.values
            self.add(running)
            self.last = ended.time

    def result(self) -> Result | None:
        """What there is, or None before the first row."""
        return self.complete() if self.count else None

    def complete(self) -> Result:
        """The result by dotted names."""
        times = np.array([min(self.grid.time(k), self.last) for k in range(self.count)])
        values, aliases, units, words = {}, {}, {}, {}
        for place in self.places:
            name, scalar = dotted(*place), self.system.components[place[0]].scalars[place[1]]
            link = self.links.get(place)
            if link and (link.factor, link.offset) == (1.0, 0.0) and link.source in self.places:
                aliases[name] = dotted(*link.source)
            else:
                values[name] = self._values(place, link, times)
            units[name], words[name] = scalar.unit, scalar.description
        title = f"co-simulation of {', '.join(self.system.components)}"
        if "" in self.system.components:  # one that is alone
            title = Path(self.system.components[""].file).stem
        return Result(
            times, values, units=units, descriptions=words, title=title, aliases=aliases, ended=self.ended
        )

    def _values(self, place: Place, link: SignalLink | None, times: np.ndarray) -> np.ndarray:
        if link:
            return self.rows[: self.count, self.columns[link.source]] * link.factor + link.offset
        drive: Drive | None = self.system.drives.get(place)
        if drive:
            return np.array([drive(t) for t in times])
        if place in self.held:
            return np.full(self.count, self.held[place])
        return self.rows[: self.count, self.columns[place]].copy()

    def _input(self, place: Place) -> bool:
        return self.system.components[place[0]].scalars[place[1]].causality == "input"
