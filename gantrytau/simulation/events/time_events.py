"""When what switches by the time alone does so, which is known before the integration comes there."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.language.symbols import time
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.events.margins import Switches
from gantrytau.simulation.events.phases import moved, phases_along

DENSE = 20_000  # steps of the run in which a margin that is not linear in time is looked for zeros, at least
FIRST = 200  # of them at once, then more
GROWTH = 4
ROUNDS = 30  # until a window suits how fast phases move in it
WITHIN = 64  # parts of such a step, where a margin turns round in it
HALVINGS = 60


class TimeEvents:
    """Turns of the switches of a run from `begin` to `end` whose margins depend on time, and on modes, alone.

    all_foreseen: whether there are no others.
    """

    def __init__(self, switches: Switches, w: ca.SX, begin: float, end: float):
        chosen = [i for i, timed in enumerate(switches.timed) if timed]
        margins = switches.margins[chosen]
        rates = ca.jacobian(margins, time)
        self.begin, self.end = begin, end
        self.all_foreseen = len(chosen) == len(switches) and not any(switches.turns[i].counts for i in chosen)
        self._counts = np.array([switches.turns[i].counts for i in chosen], dtype=bool)
        self._linear = np.array([not ca.depends_on(r, time) for r in rates.elements()], dtype=bool)
        self._function = AtPlaces(ca.Function("by_time", [time, w], [ca.densify(margins), ca.densify(rates)]))
        self._alone = [
            AtPlaces(ca.Function("margin", [time, w], [ca.densify(margin), ca.densify(rate)]))
            for margin, rate in zip(margins.elements(), rates.elements(), strict=True)
        ]
        self._of = [np.flatnonzero(ca.which_depends(m, w)) for m in margins.elements()]
        self._phases = [phases_along(m, [time, w], time, ca.SX(1)) for m in margins.elements()]
        self._windows: dict[tuple[int, bytes], _Window] = {}

    def next(self, t: float, w: np.ndarray) -> float | None:
        """The next of them after t, s, while the inputs and modes are w; None if there is none before the end."""
        if not self._linear.size:
            return None
        least = t + 8 * np.spacing(max(abs(t), abs(self.end)))
        found, offsets, slopes = [], *(f[0] for f in self._function(np.zeros(1), w[None]))
        for i in np.flatnonzero(self._linear & (slopes != 0)):
            level = 0.0
            if self._counts[i]:  # the next whole number
                now = offsets[i] + slopes[i] * least
                level = np.ceil(now) if slopes[i] > 0 else np.floor(now)
            found.append((level - offsets[i]) / slopes[i])
        zeros = [self._next_zero(int(i), w, least) for i in np.flatnonzero(~self._linear & ~self._counts)]
        found += [zero for zero in zeros if zero is not None]
        return min((at for at in found if least < at < self.end), default=None)

    def _next_zero(self, i: int, w: np.ndarray, least: float) -> float | None:
        """The first time after one at which a margin passes zero while what it depends on stays as it is, s."""
        key = i, w[self._of[i]].tobytes()
        window = self._windows.get(key)
        if window is None or not window.begin <= least < window.end:
            window = self._search(i, w, least, FIRST)
        while True:
            self._windows[key] = window
            k = int(np.searchsorted(window.zeros, least, side="right"))
            if k < window.zeros.size or window.end >= self.end:
                return float(window.zeros[k]) if k < window.zeros.size else None
            window = self._search(i, w, window.end, min(GROWTH * window.looks, DENSE))

    def _search(self, i: int, w: np.ndarray, begin: float, looks: int) -> "_Window":
        """The zeros of a margin in some time from `begin` on, with about so many looks at it."""

        def at(times: np.ndarray) -> list[np.ndarray]:
            return self._alone[i](times, w[None])

        t = np.linspace(begin, min(begin + looks * (self.end - self.begin) / DENSE, self.end), looks + 1)
        phases = self._phases[i]
        if phases is not None:
            t = _closer(t, lambda times: phases(times, w[None]), looks)
        values, rates = (f[:, 0] for f in at(t))
        round_ = (values[:-1] * rates[:-1] < 0) & (values[1:] * rates[1:] > 0)
        inside = [np.linspace(t[k], t[k + 1], WITHIN + 1)[1:-1] for k in np.flatnonzero(round_)]
        if inside:
            t = np.union1d(t, np.concatenate(inside))
            values = at(t)[0][:, 0]
        passed = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
        low, high, side = t[passed], t[passed + 1], values[passed] > 0
        for _ in range(HALVINGS if passed.size else 0):
            middle = (low + high) / 2
            same = (at(middle)[0][:, 0] > 0) == side
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return _Window(begin, float(t[-1]), looks, high)


@dataclass(frozen=True)
class _Window:
    """The zeros of a margin in a time from begin to end, s."""

    begin: float
    end: float
    looks: int
    zeros: np.ndarray


def _closer(t: np.ndarray, phases: Callable[[np.ndarray], list[np.ndarray]], most: int) -> np.ndarray:
    """Times between which phases move by no more than a share of their periods: the first of t, with as many looks."""
    for _ in range(ROUNDS):
        parts = np.maximum(np.ceil(moved(np.diff(t), *phases(t))), 1).astype(int)
        ahead = np.cumsum(parts)
        if ahead[-1] == parts.size:
            break
        count = max(1, int(np.searchsorted(ahead, most)))
        if parts[0] > most:
            t = np.array([t[0], t[0] + (t[1] - t[0]) * most / parts[0]])
            continue
        t = np.interp(np.arange(ahead[count - 1] + 1), np.append(0, ahead[:count]), t[: count + 1])
    return t
