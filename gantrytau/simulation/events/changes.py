"""What changes at one place of a run: what is sampled there, the sides of its switches, and what whens do.

At an instant all that is sampled takes its new values first. Then the switches get the sides that hold behind it, and whens
whose conditions became true act, in rounds: Discretes and states get new values, what follows from them is made
consistent, the switches get their sides anew, until no condition becomes true any more.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.simulation import simulation_errors as run_ends
from gantrytau.simulation.between.chatter import HOP, Chatter, Hops
from gantrytau.simulation.events.crossings import location_errors
from gantrytau.simulation.events.impulses import Impulses, Infinite, possible_impulses
from gantrytau.simulation.events.margins import SwitchMargins
from gantrytau.simulation.events.rounds import MOST, Made
from gantrytau.simulation.events.sticking import HOLDS, WHENS
from gantrytau.simulation.events.time_events import TimeEvents
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.singular_poses import Point
from gantrytau.simulation.time_grid import Trail

MOST_AT_ONCE = 8  # switches of which all choices are tried
LONGEST_CIRCLE = 100  # choices of modes of which one leads to the next


class Changes:
    """Changes at the points of a trail."""

    def __init__(self, coordinates: Coordinates, trail: Trail, sizes: np.ndarray, span: float):
        """sizes: of the states; span: of the run, s."""
        self.coordinates, self.trail, self.sizes, self.span = coordinates, trail, sizes, span
        begin = float(trail.t[0])
        self.by_time = TimeEvents(coordinates.switches, coordinates.w, begin, begin + span)
        self._chatter, self._hops = Chatter(), Hops()
        self._rounded: np.ndarray | float = 0.0  # what rounding made of margins where it decided
        self._cancels = False  # whether a margin is zero by an identity: its slopes do not tell its rounding
        self.ended = ""  # what a when said that ended the run
        dae, pieces = coordinates.dae, coordinates.pieces
        own = (coordinates.substitutions, tuple(coordinates.arguments), coordinates.states)
        found = coordinates.kept("impulses", lambda: possible_impulses(dae, pieces, *own))
        self._impulses: Impulses | None = found
        below = self._impulses.discretes if self._impulses else ()
        self._below = np.array([name in below for name in coordinates.discretes], dtype=bool)
        free = self._impulses is None and not dae.flat.slips
        self._idle = coordinates.idle if free else np.zeros_like(coordinates.idle)
        timed = coordinates.switches.timed
        self._timed = np.array([all(timed[k] for k in conditions) for conditions in coordinates.rounds.of])
        self._thrown = False  # whether states have jumped where something turned last
        self._holding = np.zeros(len(coordinates.rounds.whens), dtype=bool)  # its conditions, last
        self.acts = np.zeros(self._holding.size, dtype=int)  # of each when, counted
        self._unsampled: tuple[int, np.ndarray, np.ndarray] | None = None  # a place before it was sampled

    def modes(self, k: int) -> np.ndarray:
        """The modes of a place, to read and to write."""
        return self.trail.held[k, self.trail.held.shape[1] - len(self.coordinates.switches) :]

    def columns(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """States, algebraics, times and inputs at places."""
        trail = self.trail
        return trail.x[places], trail.z[places], trail.t[places], trail.rows(places)

    def point(self, k: int) -> Point:
        """A place as a point."""
        return self.trail.x[k], self.trail.z[k], float(self.trail.t[k]), self.trail.inputs(k)

    def margins(self, places: np.ndarray) -> SwitchMargins:
        """The margins at places."""
        return self.look(*self.columns(places))

    def look(self, x: np.ndarray, z: np.ndarray, t: np.ndarray, w: np.ndarray) -> SwitchMargins:
        """The margins at states, algebraics, times and inputs, known no better than rounding lets them be."""
        switches = self.coordinates.switches
        found = switches.look(x, z, t, w, self.sizes).blurred(self._rounded)
        return found.blurred(switches.rounding(x, z, t, w)) if self._cancels else found

    def conditions(self, switches: np.ndarray) -> list[str]:
        """Conditions of some switches, in the model's names."""
        turns, pieces = self.coordinates.switches.turns, self.coordinates.pieces
        found = [pieces.asked(turns[int(i)].mode.name(), self.coordinates.dae) for i in switches]
        return list(dict.fromkeys(found))

    def begin(self) -> int:
        """The first place: what is true there has not become so, but for whens that act initially. The last place there."""
        trail = self.trail
        trail.x[0], trail.z[0], own = self.coordinates.start(trail.t[0], trail.inputs(0))
        trail.held[0, trail.held.shape[1] - own.size :] = own
        self._holding[:] = [not one.initially for one in self.coordinates.rounds.whens]
        if self.coordinates.dae.flat.slips:
            self._begin_sliding()
        self.renew(0)
        return self.turn(0)

    def _begin_sliding(self) -> None:
        """Let frictions slide where there is a speed at the start, and break away where they cannot hold."""
        slips, trail = self.coordinates.slips, self.trail
        own = self._slip_modes(0)
        self._holding[slips.first :] = False  # what is sampled at the start may push more
        trail.held[0, own] = slips.sliding(trail.x[0], float(trail.t[0]), trail.inputs(0), self.sizes)
        self._break_away(0, trail.held[0, own] == 0, trail.held[0, own].copy())
        trail.x[0] = slips.held(trail.x[:1], trail.t[:1], trail.inputs(0)[None])[0]
        trail.z[0] = self._settled(0)

    def renew(self, k: int) -> None:
        """Give new values to what is sampled at a place, all from the values just before."""
        trail, due = self.trail, self.trail.due[k]
        if not due.any():
            return
        t = float(trail.t[k])
        if self._holding.size:
            self._unsampled = k, trail.held[k].copy(), trail.z[k].copy()
        new = np.array(self.coordinates.renewed(trail.x[k], trail.z[k], t, t, trail.inputs(k))).ravel()
        for law in self.coordinates.dae.flat.laws:
            law.obeyed(t, self.coordinates.held, due, new)
        for name, value, now in zip(self.coordinates.held, new, due, strict=True):
            if now and not np.isfinite(value):
                raise run_ends.sampled_badly(self.coordinates.dae, t, name)
        trail.held[k, : due.size][due] = new[due]
        trail.z[k] = self._settled(k)

    def was_sampled(self, k: int) -> None:
        """Keep what was at a place before its variables got their new values, for whens that act there."""
        trail = self.trail
        if not (self._holding.size and trail.due[k].any() and k > 0):
            return
        held, trail.held[k] = trail.held[k].copy(), trail.held[k - 1]
        self._unsampled = k, trail.held[k].copy(), self._settled(k)
        trail.held[k] = held

    def behind_inputs(self, k: int) -> int:
        """From the place before a jump of inputs to that behind it, which is returned, with the modes that samples see."""
        trail = self.trail
        trail.x[k + 1], trail.z[k + 1], trail.held[k + 1] = trail.x[k], trail.z[k], trail.held[k]
        trail.z[k + 1] = self._settled(k + 1)
        if len(self.coordinates.switches):
            modes = self.coordinates.switches.following(self.margins(np.array([k + 1])), self.modes(k))
            if not np.array_equal(modes, self.modes(k)):
                self._agree(k + 1, modes)
        return k + 1

    def turn(self, k: int, *, by_states: bool = False) -> int:
        """Find the modes and values that hold from a place on, and lay a second place there if they are others.

        The last place at this instant is returned.
        """
        switches, trail, left = self.coordinates.switches, self.trail, k
        if not len(switches) and not self._holding.size:
            return k
        first = self.modes(k).copy()
        if len(switches):
            margins = self.margins(np.array([k]))
            modes = switches.following(margins)
            self._refuse_outside(k, modes)
            if not np.array_equal(modes, first):
                if k > 0:
                    trail.repeat(k, written=np.array_equal(switches.written(margins.values[0]), first))
                    k = k + 1
                idle = self._idle[trail.held.shape[1] - modes.size :][modes != first].all()
                if idle:
                    self.modes(k)[:] = modes
                else:
                    self._agree(k, modes)
                sampled = trail.due[left].any()  # results have the side behind only
                jumped = not idle and (self._thrown or switches.jumped(self.point(left), self.point(k)))
                if k > left and not sampled and jumped:
                    trail.show(left, k)
            if by_states:
                self._watch_chatter(k, self.modes(k) != first, margins)
        k = self._act(left, k)
        end = self.by_time.next(float(trail.t[k]), trail.inputs(k))
        if end is not None and not self.ended:
            trail.stop_at(end, k)
        return k

    def _refuse_outside(self, k: int, modes: np.ndarray) -> None:
        """SolveError if a table that is not defined beyond its ends is left at a place that gets these modes."""
        if not self.coordinates.dae.flat.ranges:
            return
        x, z, t, w = self.point(k)
        w = np.concatenate([w[: w.size - modes.size], modes])
        for number in np.flatnonzero(np.array(self.coordinates.rounds.left(x, z, t, t, w)).ravel()):
            raise run_ends.left_table(self.coordinates.dae, t, self.coordinates.dae.flat.ranges[int(number)])

    def _act(self, left: int, k: int) -> int:
        """Let whens act whose conditions became true, in rounds; left: the first place at this instant."""
        rounds, trail = self.coordinates.rounds, self.trail
        rose = self._holding
        if not rose.size:
            return k
        for _ in range(MOST):
            now = rounds.holding(self.point(k))
            rose, self._holding = rounds.rising(now, self._holding)
            if not rose.any() or self.ended:
                return k
            if self.coordinates.dae.flat.slips:
                waits = self.coordinates.slips.postponed(rose, self.point(k))
                rose, self._holding = rose & ~waits, self._holding & ~waits
            made = rounds.made(self.point(k), rose)
            self.acts += made.acts != 0
            acting = [rounds.whens[i] for i in np.flatnonzero(made.acts)]
            for one in acting:
                if one.failure:
                    raise run_ends.undecided(self.coordinates.dae, float(trail.t[k]), one)
            if bad := rounds.not_finite(made, self.coordinates.discretes, self.coordinates.states):
                labels = rounds.labels(made.acts)
                raise run_ends.set_badly(self.coordinates.dae, float(trail.t[k]), bad, labels)
            if k == left:
                trail.repeat(k, written=True)
                k = k + 1
            if self._unsampled is not None and self._unsampled[0] == left:
                _, trail.held[left], trail.z[left] = self._unsampled
            trail.show(left, k)
            self._make(made, k)
        raise run_ends.endless_rounds(self.coordinates.dae, float(trail.t[k]), rounds.labels(rose))

    def _make(self, made: Made, k: int) -> None:
        """Give a place the values of a round, and what follows from them."""
        coordinates, trail = self.coordinates, self.trail
        t, held = float(trail.t[k]), len(coordinates.held)
        first, acting = trail.held[k].copy(), [coordinates.rounds.whens[i] for i in np.flatnonzero(made.acts)]
        self.ended = "; ".join(one.message for one in acting if one.message)
        own = slice(held, held + len(coordinates.discretes))
        idle = (self._idle[own] | (made.discretes == first[own])).all() and self._timed[made.acts != 0].all()
        idle = idle and not any(one.reinits for one in acting)
        before = self.margins(np.array([k])) if len(coordinates.switches) and not idle else None
        earlier = self.point(k)[3].copy()
        trail.held[k, own] = made.discretes
        if idle:
            return
        if coordinates.rounds.places.size:
            trail.x[k, coordinates.rounds.places] = made.states
            try:
                trail.x[k] = coordinates.followed(trail.x[k], t, trail.inputs(k))
            except SolveError as error:
                labels = coordinates.rounds.labels(made.acts)
                raise run_ends.inconsistent(coordinates.dae, t, labels, error) from error
        if coordinates.dae.flat.slips:
            if any(one.reinits for one in acting):
                self._slide_on(k, np.ones(len(coordinates.slips), dtype=bool))
            self._lock(k, first)
        steps = (made.discretes != first[own])[self._below].any()
        left = (trail.x[k].copy(), trail.z[k].copy(), t, earlier) if steps else None
        trail.z[k] = self._settled(k)
        if before is None and left is not None:
            self._led_to(k, self.modes(k).copy(), 0.0, left)
        if before is not None:
            after = self.margins(np.array([k]))
            models = np.arange(made.acts.size) < made.acts.size - WHENS * len(coordinates.dae.flat.slips)
            self._watch_hops((made.acts != 0) & models, t, before, after)
            errors = location_errors(before, after, t, coordinates.switches.whole(before.values))
            modes = coordinates.switches.following(after.blurred(errors))
            if left is not None or not np.array_equal(modes, self.modes(k)):
                self._agree(k, modes, errors, left)

    def _lock(self, k: int, first: np.ndarray) -> None:
        """Hold what has come to rest, but what breaks away again at once: that turns back; first: what was held before."""
        slips, trail, own = self.coordinates.slips, self.trail, self._slip_modes(k)
        self._break_away(k, (first[own] != 0) & (trail.held[k, own] == 0), first[own])
        trail.x[k] = slips.held(trail.x[[k]], trail.t[[k]], trail.inputs(k)[None])[0]

    def _slide_on(self, k: int, which: np.ndarray) -> None:
        """Let some frictions slide whose speeds have jumped."""
        trail, own = self.trail, self._slip_modes(k)
        sliding = self.coordinates.slips.sliding(trail.x[k], float(trail.t[k]), trail.inputs(k), self.sizes)
        trail.held[k, own] = np.where(which & (sliding != 0), sliding, trail.held[k, own])

    def _break_away(self, k: int, stuck: np.ndarray, before: np.ndarray) -> None:
        """Let those of some frictions slide that cannot hold, the worst first; before: their modes, if they have slid."""
        trail, own = self.trail, self._slip_modes(k)
        while stuck.any():
            trail.z[k] = self._settled(k)
            loads = self.coordinates.slips.loaded(self.point(k))
            size = np.where(np.isfinite(loads), np.abs(loads), np.inf) * stuck
            worst = int(np.argmax(size))
            if not size[worst] > HOLDS:
                return
            stuck[worst] = False
            # where no force of it stops the motion, that goes on as it came
            ways = np.where(np.isfinite(loads), np.sign(loads), -before)
            trail.held[k, own.start + worst] = ways[worst]

    def _slip_modes(self, k: int) -> slice:
        """Where the modes of frictions stand in what is held at a place."""
        slips = self.coordinates.slips
        ahead = self.trail.held.shape[1] - self.trail.inputs(k).size
        return slice(slips.modes.start + ahead, slips.modes.stop + ahead)

    def _watch_hops(self, acts: np.ndarray, t: float, before: SwitchMargins, after: SwitchMargins) -> None:
        """SolveError where a when acts again and again and its margin hardly leaves zero: rounding would decide."""
        whole, rounds = self.coordinates.switches.whole(before.values), self.coordinates.rounds
        found = self._hops.found(np.flatnonzero(acts).tolist(), rounds.of, t, before, after, whole)
        if found is not None:
            raise run_ends.accumulating(self.coordinates.dae, t, rounds.whens[found].label)

    def _settled(self, k: int) -> np.ndarray:
        """The algebraics of a place."""
        places, trail = slice(k, k + 1), self.trail
        w = trail.inputs(k)[None]
        return self.coordinates.settle(trail.x[places], trail.z[places], trail.t[places], w)[0]

    def _agree(self, k: int, modes: np.ndarray, errors: Any = 0.0, left: Point | None = None) -> None:
        """Give a place modes that agree with the margins they lead to, from these on; SolveError if there are none.

        errors: by which margins are known at least; left: the point before Discretes of differentiated equations jumped.
        """
        (x, z, t, w), dae = self.point(k), self.coordinates.dae
        before = left or (x.copy(), z.copy(), t, w.copy())
        tried = [] if left else [self.modes(k).copy()]
        while not any(np.array_equal(modes, old) for old in tried):
            tried.append(modes)
            modes = self._led_to(k, modes, errors, before)
            if np.array_equal(modes, tried[-1]):
                return
            if len(tried) > LONGEST_CIRCLE:  # each leads further away, as floor(x) with a gain above one
                raise run_ends.no_side(dae, float(t), self.conditions(np.flatnonzero(modes != tried[0])))
        # one leads to another in a circle: all choices of what changed, the nearest to the first first
        switches, changing = self.coordinates.switches, np.flatnonzero(np.ptp(tried, axis=0) > 0)
        chosen = changing[~switches.derived[changing]]  # the others follow from these
        if chosen.size <= MOST_AT_ONCE:
            choices = product(*(np.unique([old[i] for old in tried]).tolist() for i in chosen))
            for choice in sorted(choices, key=lambda c: np.abs(c - tried[0][chosen]).sum()):
                modes = tried[0].copy()
                modes[chosen] = choice
                modes = switches.concluded(modes, w)
                if np.array_equal(self._led_to(k, modes, errors, before), modes):
                    return
        # margins may follow from large numbers that cancel: then rates decide
        known, self._rounded = self._rounded, np.maximum(self._rounded, self._rounding(k, tried, before))
        if np.any(self._rounded > known):
            self.trail.x[k], self.trail.z[k] = before[:2]
            self._agree(k, tried[1], errors, left)
            return
        raise run_ends.no_side(dae, float(t), self.conditions(changing))

    def _rounding(self, k: int, tried: Sequence[np.ndarray], before: Point) -> np.ndarray:
        """What rounding makes of the margins of a place, (switches,), the most in some modes."""
        found = []
        for modes in tried:
            self._led_to(k, modes, 0.0, before)
            found.append(self.coordinates.switches.rounding(*self.columns(np.array([k])))[0])
        self.modes(k)[:] = tried[0]
        return np.max(found, axis=0)

    def _led_to(self, k: int, modes: np.ndarray, errors: np.ndarray | float, before: Point) -> np.ndarray:
        """The modes that belong to the margins of a place that gets these modes; before: what it was before them."""
        trail, places = self.trail, slice(k, k + 1)
        self.modes(k)[:] = modes
        coordinates = self.coordinates
        if self._impulses:
            self._throw(k, before, self._impulses)
        if coordinates.dae.flat.slips:
            self._slide_on(k, trail.held[k, self._slip_modes(k)] == 0)
        drifted, z, t, w = (a.copy() for a in self.columns(np.array([k])))
        trail.x[k] = coordinates.project(drifted, t, w)[0]
        if self._impulses:  # margins are known no better than constraints
            near, far = (
                coordinates.switches.look(x, z, t, w, self.sizes).values for x in (drifted, trail.x[places])
            )
            errors = np.maximum(errors, 1.1 * np.abs(far - near)[0])
        trail.z[k] = self._settled(k)
        return coordinates.switches.following(self.margins(np.array([k])).blurred(errors))

    def _throw(self, k: int, before: Point, impulses: Impulses) -> None:
        """Let the states of a place jump with what its modes turn; at the start what is told of them holds behind it."""
        coordinates, trail, (x, _, t, w) = self.coordinates, self.trail, before
        self._thrown = False
        if k == 0:
            trail.x[k] = coordinates.followed(x, t, trail.inputs(k))
            return
        turned = self.conditions(np.flatnonzero(self.modes(k) != w[w.size - self.modes(k).size :]))
        turned = turned or impulses.discretes
        behind = trail.inputs(k).copy()
        slips = coordinates.dae.flat.slips
        if slips:  # the impulse of a friction is finite as its force is
            behind[coordinates.slips.modes] = 1.0
        try:
            found = impulses.behind(before, behind, self.span + abs(t))
        except Infinite as error:
            raise run_ends.infinite(coordinates.dae, t, turned, error) from None
        except np.linalg.LinAlgError:
            raise run_ends.undetermined_jump(coordinates.dae, t, turned) from None
        self._thrown = found is not None
        trail.x[k] = x if found is None else found
        if slips and found is not None:
            self._slide_on(k, np.ones(len(coordinates.slips), dtype=bool))

    def _watch_chatter(self, k: int, changed: np.ndarray, before: SwitchMargins) -> None:
        """SolveError if what states made switch turns again and again, and does not leave zero in between or accumulates."""
        dae, t = self.coordinates.dae, float(self.trail.t[k])
        turned, what = self._chatter.found(t, changed, before, self.coordinates.switches.whole(before.values))
        if what:
            told = run_ends.chattering if what == "chattering" else run_ends.never_past
            raise told(dae, t, self.conditions(turned))
        if not self._cancels and self._chatter.crowded(turned, self.span):
            rounded = self.coordinates.switches.rounding(*self.columns(np.array([k])))
            self._cancels = bool(np.any(rounded[0, turned] > HOP * before.noise[0, turned]))
