"""The way of a model that samples along the places of its trail, hundreds in one call, as far as nothing else happens.

Where the explicit method needs too many steps, or something switches between two instants, the integrator takes over.
"""

from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.results.run_statistics import BESIDE, INTEGRATION, RunStatistics
from gantrytau.simulation.events.crossings import first_crossing
from gantrytau.simulation.events.margins import SwitchMargins
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.sampling.buffers import Passages, StepsTaken
from gantrytau.simulation.sampling.runge_kutta import ORDER, STAGES
from gantrytau.simulation.sampling.sampling_interval import linear
from gantrytau.simulation.time_grid import Trail

MOST = 256  # steps from place to place: with more, an implicit method is quicker, though it starts anew
FIRST = 8  # passages in a first call, and times more in the next
FULL = 1.5  # times the passages that are wanted, a call may be of so many
SAFETY = 0.9  # of the step that the last error suggests
SHRINK, GROW = 0.2, 5.0  # of a step, at once
TRIALS = 12  # of one step
FAR = 2.0  # times what a gap moves by in the longest step: none that stays farther from zero turns
LONGEST_WAIT = 1000  # stretches of the integrator


class Sampler:
    """Goes along a trail in explicit steps.

    tolerance: of one step, relative, and absolute in units of sizes (n,) of the states; longest: step, s; work: what the
    steps take, counted.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        tolerance: float,
        sizes: np.ndarray,
        longest: float | None,
        work: RunStatistics,
    ):
        self.coordinates, self.tolerance, self.sizes, self.work = coordinates, tolerance, sizes, work
        self.longest = np.inf if longest is None else longest
        self.step = np.inf  # s, that the last errors allow
        self.most = FIRST  # passages in the next call
        self.wait = self.waited = 0  # asked in vain, times, before and since the last trial
        self.passages = Passages(coordinates)

    @cached_property
    def _asks_inputs(self) -> bool:
        """Whether the condition of a `when` may become true where inputs jump, so that it is asked behind each jump."""
        c = self.coordinates
        asked = {k for own in c.rounds.of for k in own}
        margins = ca.vertcat(ca.SX(0, 1), *(c.switches.turns[k].margin for k in asked))
        return bool(ca.depends_on(margins, ca.vertcat(c.w[: 2 * len(c.sampled), :], c.z)))

    @property
    def suits(self) -> bool:
        """Whether the model can go this way: it samples, or is given samples, and has no friction that sticks, delays, laws
        or unknowns that are iterated.
        """
        c = self.coordinates
        if not (c.held or c.sampled) or not c.states or c.dae.flat.slips:
            return False
        if c.dae.flat.delays or c.dae.flat.laws:
            return False
        # from few corners to the next an integrator is quicker than steps that solve systems of equations
        if c.algebraics and not (c.held and c.kept("linear", lambda: linear(c))):
            return False
        switches, half = c.switches, 2 * len(c.sampled)
        timed = ca.vertcat(
            *(turn.margin for turn, by_time in zip(switches.turns, switches.timed, strict=True) if by_time)
        )
        changing = c.w[: half + len(c.held) + len(c.discretes), :]
        return not (timed.numel() and ca.depends_on(ca.SX(timed), changing))

    def over(self, trail: Trail, here: int, shorter: float | None) -> int:
        """Fill the places behind `here` with states and what is held from there on; how many were reached.

        shorter: step, s, while a function of time changes after it was at rest. 0 where this way does not lead on.
        """
        if self.waited < self.wait:
            self.waited += 1
            return 0
        longest = min(self.longest, np.inf if shorter is None else shorter)
        last = self._last(trail, here)
        for _ in range(TRIALS):
            reached, turned = self._call(trail, here, last, min(self.step, longest))
            if reached and not self._held_to_constraints(trail, here, here + reached):
                break
            if reached:
                self.wait = self.waited = 0
            if reached or turned:
                return reached
            if trail.t[here + 1] - trail.t[here] > MOST * min(self.step, longest):
                break
        self.step, self.most = np.inf, FIRST
        self.wait, self.waited = min(max(1, 2 * self.wait), LONGEST_WAIT), 0
        return 0

    @property
    def leaves_switches(self) -> bool:
        """Whether anything switches, or a when asks, that does not follow what is held: that is not seen to here."""
        return bool(self._live.any() or self.coordinates.rounds.whens)

    @property
    def _live(self) -> np.ndarray:
        turns = len(self.coordinates.switches)
        return np.array([k not in self.passages.one.by_held for k in range(turns)], dtype=bool)

    def _held_to_constraints(self, trail: Trail, first: int, last: int) -> bool:
        """Project the places that results show, and the last; False where that fails: the integrator may come nearer."""
        places, c = trail.shown(first, last), self.coordinates
        t, w = trail.t[places], trail.rows(places)
        try:
            trail.x[places] = c.project(trail.x[places], t, w)
        except SolveError:
            return False
        trail.z[places] = c.settle(trail.x[places], trail.z[places], t, w)
        return True

    def _last(self, trail: Trail, here: int) -> int:
        """The next place at which an integration ends, but for what is due or inputs that jump, or the last."""
        jumps = np.diff(trail.t[here + 1 :], append=np.inf) == 0
        ends = trail.stops[here + 1 :] & (self._asks_inputs | ~jumps) & ~trail.due[here + 1 :].any(axis=1)
        return here + 1 + int(np.argmax(ends)) if ends.any() else trail.last

    def _call(self, trail: Trail, here: int, last: int, step: float) -> tuple[int, bool]:
        """Places reached by one call, and whether it ended early because something switches."""
        t = trail.t[here : min(last, here + 2 * self.most) + 1]
        parts = np.ceil(np.diff(t) / step * (1 - 1e-12)).astype(int)
        # where inputs jump, the step before goes on behind the jump
        parts = np.maximum(parts, np.diff(t) > 0)
        parts[0] = max(parts[0], 1)
        ends = np.cumsum(parts)
        wanted = max(min(int(ends[-1]), self.most), int(parts[0]))
        calls = self.passages.calls
        # what is left of a larger call stands still, and costs less than further calls
        sizes = [k for k in calls if parts[0] <= k <= FULL * wanted] or [k for k in calls if k >= wanted][:1]
        if not sizes:
            return 0, False
        size = sizes[-1]
        count = int(np.searchsorted(ends, size, side="right"))
        parts, ends = parts[:count], ends[:count]
        places = np.arange(here, here + count + 1)
        told = self._told(trail, places, parts)
        first = np.concatenate([trail.x[here], trail.held[here]])
        with self.work.spent_on(INTEGRATION, BESIDE):
            found = self.passages.steps(first, told, size, (trail.last - here) * len(told) / count)
        error = self._error(found, told[:, 1])
        good = int(np.argmax(error > 1)) if np.any(error > 1) else error.size
        self._adapt(error[: good + 1], told[:, 1])
        accepted = int(np.searchsorted(ends, good, side="right"))
        self.work.rejected += int(good < error.size)
        turn = self._first_turn(found, told, int(ends[accepted - 1]) if accepted else 0)
        reached = accepted if turn is None else int(np.searchsorted(ends, turn, side="right"))
        steps = int(ends[reached - 1]) if reached else 0
        self.work.steps += steps
        self.work.evaluations += len(STAGES) * (steps + int(good < error.size))
        n, rows, filled = self.sizes.size, ends[:reached] - 1, places[1 : reached + 1]
        trail.x[filled], trail.held[filled] = found.after[rows, :n], found.after[rows, n:]
        trail.z[filled] = found.algebraics[rows]
        before = np.append(parts[1:] == 0, False)[:reached]
        trail.held[filled[before]] = found.before[rows[before], n:]
        self.most = min(size * FIRST, calls[-1]) if reached == count else max(1, size // FIRST)
        return reached, turn is not None

    def _told(self, trail: Trail, places: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """What the passages between places are told, a row each; parts: steps between these, none where inputs jump."""
        t, half = trail.t[places], 2 * len(self.coordinates.sampled)
        interval = np.repeat(np.arange(parts.size), parts)
        inner = np.arange(interval.size) - np.repeat(np.cumsum(parts) - parts, parts)
        h, begin = (np.diff(t) / np.maximum(parts, 1))[interval], t[interval]
        behind = interval + 1 + np.append(parts[1:] == 0, False)[interval]
        last = (inner == parts[interval] - 1)[:, None]
        due, jumps = trail.due[places[behind]] & last, (t[behind] == t[behind - 1])[:, None] & last
        w = trail.rows(places)[:, :half]
        return np.hstack(
            [np.stack([begin + inner * h, h, begin], axis=1), due, w[interval], w[behind], jumps]
        )

    def _error(self, found: StepsTaken, h: np.ndarray) -> np.ndarray:
        """Estimates of the errors of the steps, in tolerances; inf where they are not finite."""
        n = self.sizes.size
        with np.errstate(invalid="ignore", over="ignore"):
            largest = np.maximum(np.abs(found.before[:, :n]), np.abs(found.after[:, :n]))
            scale = self.tolerance * (self.sizes + largest)
            third, fifth = (np.abs(e / scale).max(axis=1) for e in (found.third, found.fifth))
            whole = np.sqrt(fifth**2 + 0.01 * third**2)
            error = h * fifth**2 / np.where(whole > 0, whole, 1.0)
        return np.where(
            np.isfinite(error)
            & np.isfinite(found.after).all(axis=1)
            & np.isfinite(found.algebraics).all(axis=1),
            error,
            np.inf,
        )

    def _adapt(self, error: np.ndarray, h: np.ndarray) -> None:
        """Choose the next step from errors, of which the last may be above the tolerance."""
        k = int(np.argmax(error))
        if h[: error.size].max() == 0:  # nothing but a jump of inputs
            return
        if error[k] > 1:
            self.step = h[error.size - 1] * max(SHRINK, SAFETY * error[-1] ** (-1 / ORDER))
        elif error[k] > 0:
            self.step = h.max() * min(GROW, max(1.0, SAFETY * error[k] ** (-1 / ORDER)))
        else:
            self.step = GROW * h.max()

    def _first_turn(self, found: StepsTaken, told: np.ndarray, count: int) -> int | None:
        """The first of `count` steps in which something switches that does not follow what is held; None if none does."""
        if not self._live.any() or not count:
            return None
        n, told = self.sizes.size, told[:count]
        behind = self._gaps(found, found.after[:count, :n], told, told[:, 1])
        within = told[:, 1].max() * np.abs(behind.rates).max(axis=0)
        if np.all(behind.values.min(axis=0) > FAR * within + behind.noise.max(axis=0)):
            return None
        before = self._gaps(found, found.before[:count, :n], told, 0.0)
        at = np.stack([told[:, 0], told[:, 0] + told[:, 1]], axis=1).ravel()  # before and behind each step
        pairs = ((getattr(gaps, name) for gaps in (before, behind)) for name in ("values", "rates", "noise"))
        first = first_crossing(
            at, SwitchMargins(*(np.stack([*p], axis=1).reshape(2 * count, -1) for p in pairs))
        )
        return None if first is None else (first.place + 1) // 2

    def _gaps(
        self, found: StepsTaken, x: np.ndarray, told: np.ndarray, later: np.ndarray | float
    ) -> SwitchMargins:
        """Gaps of what does not follow what is held, at states x in steps, some time behind their begins, s."""
        c, switches = self.coordinates, self.coordinates.switches
        half, m = len(c.sampled), len(c.held)
        at, own = told[:, 0] + later, found.before[: len(told), self.sizes.size :]
        values, slopes = told[:, 3 + m : 3 + m + half], told[:, 3 + m + half : 3 + m + 2 * half]
        w = np.hstack([values + slopes * (at - told[:, 2])[:, None], slopes, own])
        z = c.settle(x, found.algebraics[: len(told)], at, w)
        gaps = switches.gaps(switches.look(x, z, at, w, self.sizes), own[:, m + len(c.discretes) :])
        chosen = np.concatenate([self._live, self._live[[turn.counts for turn in switches.turns]]])
        return SwitchMargins(*(a[:, chosen] for a in (gaps.values, gaps.rates, gaps.noise)))
