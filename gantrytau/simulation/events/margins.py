"""What switches in the equations of motion: its modes, which are constant between two events, and its margins."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.language.piecewise import Turn
from gantrytau.language.symbols import time
from gantrytau.simulation.between.rounding import rounding
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.singular_poses import Point

JUMP = 1e-6  # of the largest rate or algebraic: less is no jump
ALGEBRAICS = 8  # times rounding, to which they solve their equations
ROUNDING = 8 * np.finfo(float).eps  # of the terms of a margin, below which it is zero
SETTLED = 4 * np.finfo(float).eps  # of the largest algebraic, to which all of them are known


@dataclass(frozen=True)
class SwitchMargins:
    """Margins at some places, each (places, switches): values, their rates in 1/s, and what rounding makes of zero."""

    values: np.ndarray
    rates: np.ndarray
    noise: np.ndarray

    def blurred(self, errors: np.ndarray | float) -> "SwitchMargins":
        """The same, known no better than by some errors."""
        return SwitchMargins(self.values, self.rates, np.maximum(self.noise, errors))

    @property
    def below(self) -> np.ndarray:
        """Whether each is below zero."""
        return self.values < -self.noise

    def until(self, count: int) -> "SwitchMargins":
        """The same at the first places."""
        return SwitchMargins(self.values[:count], self.rates[:count], self.noise[:count])


class Switches:
    """What turns where its margin passes zero (or a whole number, if it counts).

    turns: in an order in which a margin holds modes before it only; timed: whether a margin depends on time and on
    modes alone; derived: whether a mode follows from Discretes and modes, where none hangs on one behind it.
    """

    def __init__(self, turns: Sequence[Turn], arguments: Sequence[ca.SX], ode: ca.SX, algebraic: ca.SX):
        """arguments: x, z, time, t0, w; ode: x' = ode; algebraic: 0 = algebraic, which gives z."""
        x, z, _, t0, _ = arguments
        self.turns = tuple(turns)
        self._closed = np.array([turn.closed for turn in turns], dtype=bool)
        self._counts = np.array([turn.counts for turn in turns], dtype=bool)
        margins = ca.densify(ca.vertcat(*(turn.margin for turn in turns))) if turns else ca.SX(0, 1)
        moving = ca.vertcat(x, z, t0)
        self.timed = [
            not ca.depends_on(turn.margin, moving) and ca.depends_on(turn.margin, time) for turn in turns
        ]
        point = ca.vertcat(x, z, time, t0)
        modes = ca.vertcat(*(turn.mode for turn in turns))
        holds = np.array(ca.DM(ca.jacobian_sparsity(margins, modes), 1)) != 0 if turns else np.zeros((0, 0))
        looped = np.triu(holds).any(axis=0)  # modes in margins of switches before them, or in their own
        alone = [not ca.depends_on(turn.margin, point) for turn in turns]
        self.derived = ~looped & np.array(alone, dtype=bool)
        self._logic = ca.Function("logic", [point, arguments[-1]], [margins])
        self.margins = margins
        self._size = ca.SX.sym("size", x.numel())
        by_x, by_z, by_t = (ca.jacobian(margins, symbol) for symbol in (x, z, time))
        along = by_t + (by_x @ ode if x.numel() else 0)
        terms = ca.fabs(by_x) @ ca.fmax(ca.fabs(x), self._size) if x.numel() else ca.SX(len(turns), 1)
        terms += ca.fabs(by_z) @ ca.fabs(z) + ca.fabs(by_t * time) if z.numel() else ca.fabs(by_t * time)
        by_algebraics = by_x @ ca.jacobian(ode, z) if x.numel() and z.numel() else ca.SX(len(turns), 1)
        found = [margins, along, terms, ca.sum2(ca.fabs(by_algebraics))]
        self._of_algebraics = bool(by_z.nnz())
        if self._of_algebraics:  # z' = -(dg/dz)^-1 (dg/dx x' + dg/dt)
            change = ca.jacobian(algebraic, time) + (ca.jacobian(algebraic, x) @ ode if x.numel() else 0)
            found += [by_z, ca.jacobian(algebraic, z), change]
        dense = [ca.densify(e) for e in found]
        self._moves = AtPlaces(ca.Function("moves", list(arguments), [ca.densify(ode)]))
        self._slopes = ca.Function("slopes", list(arguments), [ca.densify(by_x)])
        self._exact = list(arguments), margins, algebraic
        self._look = AtPlaces(ca.Function("margins", [*arguments, self._size], dense, {"cse": True}))

    def __len__(self) -> int:
        return len(self.turns)

    def look(
        self, x: np.ndarray, z: np.ndarray, t: np.ndarray, w: np.ndarray, size: np.ndarray
    ) -> SwitchMargins:
        """The margins at places: x (places, n), z (places, m), t (places,), w (places, k); size: of states, (n,)."""
        places = len(t)
        found = self._look(x, z, t, t, w, size[None])
        values, rates, terms, gains = found[:4]
        if self._of_algebraics:
            m = z.shape[1]
            by_z = found[4].reshape(places, m, len(self)).transpose(0, 2, 1)
            inner = found[5].reshape(places, m, m).transpose(0, 2, 1)
            change = found[6][:, :, None]
            # what a margin loses by a singular matrix is found in more steps
            with contextlib.suppress(np.linalg.LinAlgError):
                rates -= (by_z @ np.linalg.solve(inner, change))[:, :, 0]
        rates[~np.isfinite(rates)] = 0.0  # what only the other side may ask
        # algebraics are known to rounding of the largest of them: at rest no side follows from less
        rates[np.abs(rates) <= SETTLED * np.abs(z).max(axis=1, initial=0.0, keepdims=True) * gains] = 0.0
        noise = ROUNDING * terms + 8 * np.spacing(np.abs(t))[:, None] * np.abs(rates)
        return SwitchMargins(values, rates, noise)

    @cached_property
    def _rounding(self) -> AtPlaces:
        arguments, margins, algebraic = self._exact
        return AtPlaces(rounding(arguments, ca.vertcat(margins, algebraic)))

    def rounding(self, x: np.ndarray, z: np.ndarray, t: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Rounding errors of the margins at places, from all their terms, (places, switches)."""
        [found] = self._rounding(x, z, t, t, w)
        own, inner = np.split(np.nan_to_num(found), [len(self)], axis=1)
        if self._of_algebraics:
            by_z, jacobian = (
                a.reshape(len(t), z.shape[1], -1).transpose(0, 2, 1)
                for a in self._look(x, z, t, t, w, np.ones((1, x.shape[1])))[4:6]
            )
            own += (np.abs(by_z @ np.linalg.pinv(np.nan_to_num(jacobian))) @ inner[:, :, None])[:, :, 0]
        return ALGEBRAICS * own

    def jumped(self, before: Point, after: Point) -> bool:
        """Whether rates or algebraics differ at two places of one instant; at a kink they do not."""
        moves = [
            np.append(self._moves(x[None], z[None], t, t, w[None])[0], z) for x, z, t, w in (before, after)
        ]
        size = np.abs(moves).max(initial=0.0)
        return bool(np.any(np.abs(moves[1] - moves[0]) > JUMP * size))

    def written(self, margins: np.ndarray) -> np.ndarray:
        """The modes that belong to margins as the model writes it."""
        on = np.where(self._closed, margins >= 0, margins > 0)
        return np.where(self._counts, np.floor(margins), on)

    def concluded(self, modes: np.ndarray, w: np.ndarray) -> np.ndarray:
        """The same modes, the derived ones computed from the others; w: inputs and modes of a point."""
        w, modes = w.copy(), modes.copy()
        for _ in range(len(self)):
            w[w.size - modes.size :] = modes
            margins = np.array(self._logic(0, w)).ravel()
            follow = np.where(self.derived, self.written(margins), modes)
            if np.array_equal(follow, modes):
                break
            modes = follow
        return modes

    def whole(self, margins: np.ndarray) -> np.ndarray:
        """Where margins turn: at the nearest whole number, if they count, else at zero."""
        return np.where(self._counts, np.round(margins), 0.0)

    def following(self, margins: SwitchMargins, before: np.ndarray | None = None) -> np.ndarray:
        """The modes just after one place: where a margin is zero, its rate decides, or those `before` stay."""
        values, rates, noise = margins.values[0], margins.rates[0], margins.noise[0]
        whole = self.whole(values)
        rest = values - whole
        turning = (np.abs(rest) <= noise) & (rates != 0)
        after = np.where(self._counts, whole - (rates < 0), rates > 0)
        if before is not None:
            after = np.where(
                self._counts & (before != whole), whole - 1, np.where(self._counts, whole, before)
            )
        return np.where(turning, after, self.written(values))

    def gaps(self, margins: SwitchMargins, modes: np.ndarray) -> SwitchMargins:
        """How far from its next turn each switch is: below zero the modes do not hold; two columns for one that counts."""
        sign = np.where(self._counts, 1.0, 2 * modes - 1)
        first = sign * margins.values - np.where(self._counts, modes, 0.0)
        counts = self._counts
        if not counts.any():
            return SwitchMargins(first, sign * margins.rates, margins.noise)
        second = modes[..., counts] + 1 - margins.values[:, counts]
        return SwitchMargins(
            np.hstack([first, second]),
            np.hstack([sign * margins.rates, -margins.rates[:, counts]]),
            np.hstack([margins.noise, margins.noise[:, counts]]),
        )

    def of_gaps(self, chosen: np.ndarray) -> np.ndarray:
        """The switches of some columns of `gaps`."""
        return np.append(np.arange(len(self)), np.flatnonzero(self._counts))[chosen]

    def behind(self, gap: int, point: Point, modes: np.ndarray, size: np.ndarray) -> np.ndarray:
        """The states moved by the shortest way to just behind where a gap is zero."""
        x, z, t, w = point
        index = int(self.of_gaps(np.array([gap]))[0])
        slopes = np.array(self._slopes(x, z, t, t, w))[index]
        for _ in range(2):
            margins = self.look(x[None], z[None], np.array([t]), w[None], size)
            left = self.gaps(margins, modes)
            sign = 1.0 if gap >= len(self) or not (self._counts[index] or modes[index]) else -1.0
            x = x + sign * slopes * (left.values[0, gap] + 2 * left.noise[0, gap]) / (slopes @ slopes)
        return x
