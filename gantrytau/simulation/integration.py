"""One run over a grid: in chunks, held to the constraints, from event to event, watched for singular poses."""

from collections.abc import Mapping

import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.interruption import on_interrupt
from gantrytau.progress import Progress
from gantrytau.results.run_statistics import BESIDE, RunStatistics
from gantrytau.simulation import simulation_errors as run_ends
from gantrytau.simulation.between.across import across, lay, left_at
from gantrytau.simulation.between.narrow_forces import NarrowForces
from gantrytau.simulation.between.pulses import functions_of_time, pulses
from gantrytau.simulation.events.changes import Changes
from gantrytau.simulation.events.crossings import Crossing, first_crossing, located
from gantrytau.simulation.events.looks import LEAST_INTERVAL, Looks
from gantrytau.simulation.events.margins import ROUNDING, SwitchMargins
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.integrators import MOST_STEPS, WALKED_STEPS, Integrators
from gantrytau.simulation.memory.past_values import PastValues
from gantrytau.simulation.sampling.sampler import Sampler
from gantrytau.simulation.signals import Signal
from gantrytau.simulation.singular_poses import Approach, Look, Point, approach, doubtful
from gantrytau.simulation.time_grid import LEAST_STEPS, Trail

CHUNK = 10  # output intervals between two looks for what switches
STRETCH = 50  # between two projections onto the constraints
FORESIGHT = 4.0  # intervals within which a margin that falls to zero may be why an integration fails
REST = 10.0  # times the tolerance: what may be left of a margin
PARTS = 2  # of a smooth run: in each the integrator starts anew, in steps of first order
GROWTH = 10  # of a stretch in which nothing has switched
OFTEN = 1e-2  # of a step's tolerance, where an integrator starts anew at hundreds of instants, in steps of first order
SOMETIMES = 0.1  # the same, where it starts anew at events
SMOOTHLY = 0.02  # the same, else: the errors of all steps then add up to a few times the tolerance of a run
# below this tolerance of a step their number grows as tolerance**(-1 / (ORDER + 1)), and errors with it
USUAL, ORDER = (1e-9, 5)
LEAST = 1e-13  # of a step: rounding
STARTING = 60  # steps of the integrator after it starts anew


class Run:
    """One integration over a grid, in chunks."""

    def __init__(
        self,
        coordinates: Coordinates,
        signals: Mapping[str, Signal],
        grid: np.ndarray,
        tolerance: float,
        longest: float | None = None,
        crosses: bool = False,
        work: RunStatistics | None = None,
    ):
        """tolerance: of one step; longest: step of the integrator, s; crosses: whether it crosses singular poses; work:
        what it takes, counted.
        """
        self.coordinates = coordinates
        self.work = work or RunStatistics()
        begin, end = float(grid[0]), float(grid[-1])
        self.span = end - begin
        if coordinates.pieces.switched.smooth:  # whose pieces nothing keeps a long step from jumping over
            longest = min(longest or np.inf, self.span / LEAST_STEPS)
        of_time = coordinates.kept("of time", lambda: functions_of_time(coordinates))
        self.pulses = pulses(of_time, begin, end, longest)
        self.trail = Trail(coordinates, signals, grid, self.pulses.spans)
        self.narrow = NarrowForces(coordinates)
        interval = float(np.diff(self.trail.t).max())
        often = coordinates.dae.flat.sampled or coordinates.dae.flat.delays
        smooth = not (often or len(coordinates.switches) or coordinates.rounds.whens)
        small = min(1.0, tolerance / USUAL) ** (1 / ORDER)
        own = OFTEN if often else SMOOTHLY * small if smooth else SOMETIMES
        exact = max(own * tolerance, min(LEAST, tolerance))
        self.enough = tolerance if smooth else exact  # where rounding keeps the integrator from more
        self.integrators = Integrators(coordinates, exact, longest, interval, self.work)
        self.crosses, self.crossed = crosses, list[float]()  # times, s
        self.integrators.most = WALKED_STEPS if crosses else MOST_STEPS  # soon given up before a pose
        self.done = 0
        self.seen = -1  # the last interval that was looked at closely
        self.changes = Changes(coordinates, self.trail, self.integrators.sizes, self.span)
        self.looks = Looks(coordinates, self.trail)
        sampler = Sampler(coordinates, tolerance, self.integrators.sizes, longest, self.work)
        self.history = PastValues(coordinates, self.trail, tolerance) if coordinates.dae.flat.delays else None
        self.sampler = sampler if sampler.suits else None

    def so_far(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Times, states, algebraics, and what is sampled and held, at the output points that were reached."""
        trail = self.trail
        kept = np.flatnonzero(trail.kept[: self.done + 1])
        return trail.t[kept], trail.x[kept], trail.z[kept], trail.rows(kept)

    def instants(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Times at which something was sampled or shown so far, and what is held from there on; None if all are shown."""
        trail, so_far = self.trail, slice(self.done + 1)
        due = trail.due[so_far].any(axis=1)
        if not np.any(due & ~trail.kept[so_far]):
            return None
        places = np.flatnonzero(due | trail.kept[so_far])
        return trail.t[places], trail.rows(places)

    def count_events(self) -> None:
        """Add to the statistics how often each condition turned so far, each when acted, and each clock sampled."""
        whens, own = self.coordinates.rounds.whens, self.coordinates.rounds.of
        asked = {k for conditions in own for k in conditions}
        size = len(self.coordinates.switches)
        modes = self.trail.held[: self.done + 1, self.trail.held.shape[1] - size :]
        turns = np.count_nonzero(np.diff(modes, axis=0), axis=0).tolist()
        for k in range(size):
            if turns[k] and k not in asked:
                self.work.count(self.changes.conditions(np.array([k]))[0], turns[k])
        for when, acts in zip(whens, self.changes.acts.tolist(), strict=True):
            self.work.count(when.label, acts)
        due, periods = self.trail.due[: self.done + 1], self.trail.periods
        for period in np.unique(periods).tolist():
            instants = int(np.count_nonzero(due[:, periods == period].any(axis=1)))
            self.work.samples[period] = self.work.samples.get(period, 0) + instants

    @property
    def ended(self) -> str:
        """Why it ended: "stop", or what a when said."""
        return self.changes.ended or "stop"

    def go(self) -> None:
        trail = self.trail
        self.done = self.changes.begin()
        if self.history:
            self.history.begin()
        with (
            Progress("simulate", trail.t[0], trail.t[-1]) as progress,
            on_interrupt(self.integrators.interrupt),
            self.work.spent_on(BESIDE),
        ):
            size = most = self._longest()
            while self.done < trail.last and not self.changes.ended:
                progress.at(trail.t[self.done])
                if self.integrators.pressed:
                    raise KeyboardInterrupt
                if self._sampled():
                    continue
                if self.history:
                    self.done = self.history.enter(self.done, self.changes)
                before, count = self.done, min(size, trail.stretch(self.done))
                try:
                    turned = self._advance(count)
                except RuntimeError as error:
                    if self.integrators.rounded(error, trail.z[self.done]):
                        continue
                    if self.integrators.tolerance < self.enough:
                        self.integrators.tolerance = self.enough
                        continue
                    if count == 1 and not self._nearer() and not self._across():
                        raise self._stopped(error) from error
                    size, most = 1, most if len(self.coordinates.switches) else 1
                    continue
                size = min(CHUNK if turned else size * GROWTH, most)
                forward = self.done > before  # else places were only laid closer: nothing is sampled twice
                stopped = forward and bool(trail.stops[self.done])
                if stopped and trail.twice(self.done):
                    self.done = self.changes.behind_inputs(self.done)
                if turned or stopped:
                    if forward:
                        self.changes.renew(self.done)
                    self.done = self.changes.turn(self.done, by_states=turned)
            if self.integrators.pressed:
                raise KeyboardInterrupt

    def _sampled(self) -> bool:
        """Go on from sample to sample in explicit steps; whether that led on."""
        here = self.done
        found = self.sampler.over(self.trail, here, self._shorter()) if self.sampler else 0
        if self.sampler is None or not found:
            return False
        self.done = here + found
        self._watch(here, self.done)
        self._hold_together(self.trail.shown(here, self.done))
        if self.trail.twice(self.done):
            self.done = self.changes.behind_inputs(self.done)
            self.changes.renew(self.done)
        if self.sampler.leaves_switches:
            self.changes.was_sampled(self.done)
            self.done = self.changes.turn(self.done)
        return True

    def _shorter(self) -> float | None:
        """The longest step of what lies ahead, s, where a function of time changes after it was at rest, or forces are
        narrow along the path.
        """
        t = self.trail.t[self.done : self.done + 2]
        steps = [self.narrow.longest(float(t[0]))]
        steps += [self.pulses.step] if self.pulses.within(float(t.sum()) / 2) else []
        return min(steps) if np.isfinite(min(steps)) else None

    def _hold_together(self, places: np.ndarray) -> None:
        """SolveError if constraints that were left out as redundant no longer hold at places."""
        trail = self.trail
        opened = self.coordinates.opened(trail.x[places], trail.t[places], trail.rows(places))
        if opened is not None and places[opened[0]] - 1 < self.done:
            self.done = int(places[opened[0]]) - 1
            raise run_ends.opened(self.coordinates.dae, float(trail.t[self.done]), opened[1])

    def _longest(self) -> int:
        """The most intervals that are integrated at once."""
        coordinates, last = self.coordinates, self.trail.last
        if coordinates.sampled or coordinates.held or self.history:
            return min(CHUNK, last)
        if coordinates.constrained:
            return min(CHUNK if len(coordinates.switches) else STRETCH, last)
        if len(coordinates.switches):
            return CHUNK * GROWTH
        return max(CHUNK, last // PARTS)

    def _nearer(self) -> bool:
        """Whether something is about to switch where the integration fails: then the next place is laid nearer.

        Where no more than the tolerance is left of a margin, the states are put just behind it.
        """
        switches, trail, k = self.coordinates.switches, self.trail, self.done
        if not len(switches):
            return False
        margins = self.changes.margins(np.array([k]))
        gaps = switches.gaps(margins, self.changes.modes(k))
        left, rates, scale = (a[0] for a in (gaps.values, gaps.rates, gaps.noise / ROUNDING))
        h = trail.t[k + 1] - trail.t[k]
        closing = (rates < 0) & (left <= -FORESIGHT * h * rates)
        if not closing.any():
            return False
        close = closing & (left <= REST * self.integrators.tolerance * scale)
        if not close.any():
            wide = h > LEAST_INTERVAL * np.spacing(abs(trail.t[k + 1]))
            if wide:
                trail.insert(k, np.array([trail.t[k] + h / 2]))
            return bool(wide)
        for gap in np.flatnonzero(close):
            trail.x[k] = switches.behind(
                int(gap), self.changes.point(k), self.changes.modes(k), self.changes.sizes
            )
        self.integrators.by_modes = True
        self.done = self.changes.turn(k, by_states=True)
        return True

    def _advance(self, count: int) -> bool:
        """Integrate some intervals, or up to where something switches; whether it does."""
        trail, here = self.trail, self.done
        if self.history:
            count = self.history.ahead(here, count)
        else:
            trail.held[here + 1 : here + count + 1] = trail.held[here]
        ahead = np.arange(here, here + count + 1)
        courses = self._courses(here, count) if self.coordinates.stepwise else None
        self.integrators.shorter = self._shorter()
        x, z = self.integrators.over(trail.x[here], trail.z[here], trail.t[ahead], courses)
        steps = self.integrators.steps - STARTING * (count if self.history else 1)
        least = self.integrators.shorter or 0.0  # steps kept short say nothing
        steps -= (trail.t[here + count] - trail.t[here]) / least if least else 0.0
        if self.looks.by_steps(here, count, steps, least):
            return False
        reached = ahead[1:]
        inputs = trail.rows(reached)
        try:
            trail.x[reached] = self.coordinates.project(x, trail.t[reached], inputs)
        except SolveError as error:  # perhaps only for want of shorter stretches
            raise RuntimeError("the constraints cannot be met any more") from error
        trail.z[reached] = self.coordinates.settle(trail.x[reached], z, trail.t[reached], inputs)
        if self.history and self.history.too_wide(here, count):
            return False
        if self.narrow.stepped_over(trail, here, count, self.integrators.steps, self.integrators.sizes):
            return False
        gaps = self._gaps(ahead)
        found = None if gaps is None else first_crossing(trail.t[ahead], gaps)
        if gaps is not None and self.looks.by_margins(ahead, gaps, found):
            return False
        self.done = here + count if found is None else here + found.place
        if self._watch(here, self.done):
            return False
        self._hold_together(reached)
        return found is not None and self._cross(found)

    def _courses(self, here: int, count: int) -> np.ndarray:
        """Arguments of the integrator for each interval: start, length, number, and the inputs."""
        trail = self.trail
        h = np.diff(trail.t[here : here + count + 1])
        # nothing changes, so that nothing starts anew
        if not (trail.courses or self.history) and np.ptp(h) <= 1e-9 * h[0]:
            length = (trail.t[here + count] - trail.t[here]) / count
            return np.repeat(np.array([[trail.t[here], length, 0, *trail.held[here]]]).T, count, axis=1)
        inputs = trail.rows(np.arange(here, here + count)).T
        return np.vstack([trail.t[here : here + count], h, np.arange(count), inputs])

    def _gaps(self, places: np.ndarray) -> SwitchMargins | None:
        """Margins of the switches at successive points: distance of each from its next turn."""
        if self.changes.by_time.all_foreseen:
            return None
        return self.coordinates.switches.gaps(self.changes.margins(places), self.changes.modes(places[0]))

    def _cross(self, found: Crossing) -> bool:
        """Lay a place just behind a crossing, or where a margin is lowest; whether something switches there."""
        trail, k, switches = self.trail, self.done, self.coordinates.switches
        low, modes = self.changes.point(k), self.changes.modes(k).copy()

        def look(point: Point) -> SwitchMargins:
            x, z, t, w = point
            return switches.gaps(self.changes.look(x[None], z[None], np.array([t]), w[None]), modes)

        far = self.changes.point(k + 1) if found.certain else self.integrators.step(low, found.guess - low[2])
        turned = found.certain or look(far).below.any()
        there = located(low, far, found.guess, self.integrators.step, look) if turned else far
        if there is None:
            conditions = self.changes.conditions(switches.of_gaps(look(far).below[0]))
            raise RuntimeError(f"no step leads to where {' and '.join(conditions)} turns")
        if there[2] < trail.t[k + 1]:
            trail.insert(k, np.array([there[2]]))
        trail.x[k + 1], trail.z[k + 1] = there[:2]
        self.done = k + 1
        return bool(turned)

    def _watch(self, first: int, last: int) -> bool:
        """Whether a singular pose between two places was crossed; else SolveError, with `done` the last before it."""
        if not self.coordinates.conditioning.needed:
            return False
        trail = self.trail
        first = max(first - 1, 0)  # the rise behind a pose may show in the next stretch only
        places = np.arange(first, last + 1)
        places = places[np.append(np.diff(trail.t[places]) > 0, True)]
        times = np.arange(float(trail.t[places[0]]), float(trail.t[last]), self.span / LEAST_STEPS)
        some = places[np.unique(np.append(np.searchsorted(trail.t[places[:-1]], times), places.size - 1))]
        if 2 * some.size < places.size and not self._doubts(some).any():
            return False
        for k in places[:-1][self._doubts(places)]:
            if k <= self.seen:
                continue
            self.done = self.seen = int(k)
            found = self._approach()
            weakest = [] if found.arrived else self._weakest(found.point)
            if found.singular or weakest:
                if not self._across(found):
                    raise run_ends.singular_pose(self.coordinates.dae, found.zero, weakest)
                return True
        self.done = last  # passed at a distance, or only the choice of coordinates fails there
        return False

    def _across(self, found: Approach | None = None) -> bool:
        """Whether a singular pose is crossed, if it may be: `done` is then behind it."""
        if not self.crosses:
            return False
        found = found or self._approach()
        begin = int(np.searchsorted(self.trail.t[: self.done + 1], left_at(found))) - 1
        way = across(found, self.changes.point(begin), self.integrators) if begin >= 0 else None
        if way is None:
            return False
        self.done = self.seen = lay(self.trail, begin, *way)
        self.crossed.append(found.zero)
        return True

    def _doubts(self, places: np.ndarray) -> np.ndarray:
        """Whether a singular pose may lie between successive places."""
        columns = self.changes.columns(places)
        look = self._look(*columns)
        sides = self.coordinates.conditioning.sides(columns[-1])
        alike = np.all(sides[1:] == sides[:-1], axis=1)  # else there is no measure in common
        return doubtful(columns[2], look) & (alike | look.near[1:])

    def _look(self, x: np.ndarray, z: np.ndarray, t: np.ndarray, w: np.ndarray) -> Look:
        return self.coordinates.conditioning.look(x, z, t, t, w)

    def _weakest(self, point: Point) -> list[str]:
        """What degenerates at a point, though it was sound behind the last event."""
        sides = self.coordinates.conditioning.sides(self.trail.rows(np.arange(self.done + 1)))
        turned = np.flatnonzero(np.any(sides[1:] != sides[:-1], axis=1))
        return self.coordinates.weakest(point, self.changes.point(int(turned[-1]) + 1 if turned.size else 0))

    def _stopped(self, error: Exception) -> SolveError:
        found = self._approach()
        weakest = self._weakest(found.point)
        if weakest:
            return run_ends.singular_pose(self.coordinates.dae, found.zero, weakest)
        step = float(self.trail.t[min(self.done + 1, self.trail.last)]) - found.point[2]
        endless = self.coordinates.not_finite(found.point, step)
        return run_ends.stopped(self.coordinates.dae, found.point[2], error, endless)

    def _approach(self) -> Approach:
        """Walk from the last place to the next, or to a singular pose before it."""

        def look(at: Point) -> Look:
            x, z, t, w = at
            return self._look(x[None], z[None], np.array([t]), w[None])

        k = self.done
        end = float(self.trail.t[min(k + 1, self.trail.last)])
        return approach(self.changes.point(k), end, self.integrators.step, look)
