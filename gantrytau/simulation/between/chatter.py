"""Chattering: switches that turn again and again without leaving zero, or ever faster, so that no integrator gets past."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np

from gantrytau.simulation.events.crossings import at_zero
from gantrytau.simulation.events.margins import SwitchMargins

CHATTERS = 50  # hops of a switch one after another: what holds on either side leads back to the other
MANY = tuple(2**n for n in range(11, 40))  # turns, after which is asked whether they accumulate
HALVES = 5
SHRINKING = 0.42  # of an interval between turns to that after half as many turns; 1 / k gives 1 / 2
CROWD = 8  # turns of a switch within a short time, after which its margin may be nothing but rounding
CLOSE = 0.05  # of a run: a short time
HOPS = 3  # of a when, one after another
HOP = 1000  # times rounding: a margin that stays nearer to zero turns by rounding


class Chatter:
    """Counts and times of the turns of each switch."""

    def __init__(self):
        self._turned: dict[int, tuple[int, list[float]]] = {}  # switch: hops, times

    def found(
        self, t: float, changed: np.ndarray, before: SwitchMargins, whole: np.ndarray
    ) -> tuple[np.ndarray, Literal["", "chattering", "accumulating"]]:
        """Switches that turn at an instant, and whether they chatter or accumulate; before: margins; whole: turns."""
        turned = np.flatnonzero(changed if changed.any() else at_zero(before, t, whole))
        for i in turned.tolist():
            hops, times = self._turned.setdefault(i, (0, []))
            last = times[-1] if times else -np.inf
            # of a parabola: the farthest
            near = abs(before.rates[0, i]) / 4 < HOP * before.noise[0, i] / (t - last) if t > last else True
            hops = hops + 1 if near else 0
            times.append(t)
            self._turned[i] = hops, times
            if hops >= CHATTERS:
                return turned, "chattering"
            if len(times) in MANY and accumulate(times):
                return turned, "accumulating"
        return turned, ""

    def crowded(self, turned: np.ndarray, span: float) -> bool:
        """Whether one of some switches has turned several times within a short time of a run of `span`, s."""
        times = [self._turned[i][1] for i in turned.tolist()]
        return any(len(own) % CROWD == 0 and own[-1] - own[-CROWD] < CLOSE * span for own in times)


class Hops:
    """Actions of whens whose margins hardly left zero in between."""

    def __init__(self):
        self._acted: dict[int, tuple[float, np.ndarray, int]] = {}  # when: last time, rates behind it, hops

    def found(
        self,
        acting: Sequence[int],
        of: Sequence[Sequence[int]],
        t: float,
        before: SwitchMargins,
        after: SwitchMargins,
        whole: np.ndarray,
    ) -> int | None:
        """A when that acts again and again, if there is one; of: switches of each when; whole: where margins turn."""
        rates, noise = before.rates[0], before.noise[0]
        passed = at_zero(before, t, whole) & (rates != 0)
        for i in acting:
            own = [k for k in of[i] if passed[k]]
            last, began, hops = self._acted.get(i, (-np.inf, rates, 0))
            if t == last:  # another round of one instant
                continue
            away = np.maximum(np.abs(began[own]), np.abs(rates[own])) * (t - last) / 4  # of a parabola
            hops = hops + 1 if own and np.all(away < HOP * noise[own]) else 0
            if hops >= HOPS:
                return i
            self._acted[i] = t, after.rates[0].copy(), hops
        return None


def accumulate(times: Sequence[float]) -> bool:
    """Whether intervals shrink faster than 1 / k, at k and at each half of it, so that their sum has a limit."""
    last = [times[(len(times) >> n) - 1] - times[(len(times) >> n) - 2] for n in range(HALVES + 1)]
    return all(later < SHRINKING * earlier for later, earlier in pairwise(last))
