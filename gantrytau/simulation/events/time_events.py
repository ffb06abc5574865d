"""When what switches by the time alone does so, which is known before the integration comes there."""

import casadi as ca
import numpy as np

from gantrytau.language.symbols import time
from gantrytau.simulation.events.margins import Switches

DENSE = 20_000  # steps of the run in which a margin that is not linear in time is looked for zeros
WITHIN = 64  # parts of such a step, where a margin turns round in it
HALVINGS = 60


class TimeEvents:
    """The turns of the switches of a run from `begin` to `end` whose margins depend on time, and on modes, alone."""

    def __init__(self, switches: Switches, w: ca.SX, begin: float, end: float):
        chosen = [i for i, timed in enumerate(switches.timed) if timed]
        margins = switches.margins[chosen]
        rates = ca.jacobian(margins, time)
        self.begin, self.end = begin, end
        self._counts = np.array([switches.turns[i].counts for i in chosen], dtype=bool)
        self._linear = np.array([not ca.depends_on(r, time) for r in rates.elements()], dtype=bool)
        self._function = ca.Function("by_time", [time, w], [ca.densify(margins), ca.densify(rates)])
        self._alone = [
            ca.Function("margin", [time, w], [ca.densify(margin), ca.densify(rate)])
            for margin, rate in zip(margins.elements(), rates.elements(), strict=True)
        ]
        self._of = [np.flatnonzero(ca.which_depends(m, w)) for m in margins.elements()]
        self._zeros: dict[tuple[int, bytes], np.ndarray] = {}

    def next(self, t: float, w: np.ndarray) -> float | None:
        """The next of them after t, s, while the inputs and modes are w; None if there is none before the end."""
        if not self._linear.size:
            return None
        least = t + 8 * np.spacing(max(abs(t), abs(self.end)))
        found = []
        offsets, slopes = (np.array(f).ravel() for f in self._function(0.0, w))
        for i in np.flatnonzero(self._linear & (slopes != 0)):
            level = 0.0
            if self._counts[i]:  # the next whole number
                now = offsets[i] + slopes[i] * least
                level = np.ceil(now) if slopes[i] > 0 else np.floor(now)
            found.append((level - offsets[i]) / slopes[i])
        for i in np.flatnonzero(~self._linear & ~self._counts):
            zeros = self._all_zeros(int(i), w)
            found += zeros[zeros > least][:1].tolist()
        return min((at for at in found if least < at < self.end), default=None)

    def _all_zeros(self, i: int, w: np.ndarray) -> np.ndarray:
        """All times of the run at which a margin passes zero while what it depends on stays as it is."""
        key = i, w[self._of[i]].tobytes()
        if key not in self._zeros:
            self._zeros[key] = self._search(i, w)
        return self._zeros[key]

    def _search(self, i: int, w: np.ndarray) -> np.ndarray:
        def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            inputs = np.repeat(w[:, None], times.size, axis=1)
            values, rates = (np.array(f)[0] for f in self._alone[i].map(times.size)(times[None], inputs))
            return values, rates

        t = np.linspace(self.begin, self.end, DENSE + 1)
        values, rates = at(t)
        round_ = (values[:-1] * rates[:-1] < 0) & (values[1:] * rates[1:] > 0)
        inside = [np.linspace(t[k], t[k + 1], WITHIN + 1)[1:-1] for k in np.flatnonzero(round_)]
        if inside:
            t = np.union1d(t, np.concatenate(inside))
            values, _ = at(t)
        passed = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
        low, high, side = t[passed], t[passed + 1], values[passed] > 0
        for _ in range(HALVINGS if passed.size else 0):
            middle = (low + high) / 2
            same = (at(middle)[0] > 0) == side
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return high
