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


def accumulate(times: Sequence[float]) -> bool:
    """Whether intervals shrink faster than 1 / k, at k and at each half of it, so that their sum has a limit."""
    last = [times[(len(times) >> n) - 1] - times[(len(times) >> n) - 2] for n in range(HALVES + 1)]
    return all(later < SHRINKING * earlier for later, earlier in pairwise(last))
