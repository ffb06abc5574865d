"""Impulses: what jumps where a condition turns that stands in what the index reduction differentiated.

Pryce's offsets say that equation i is differentiated c_i times, and that d_j is the highest derivative of unknown j. The
jump Y_j(k) of the derivative d_j - k follows, for k = 1 and, where places jump, before that for larger k, from

    J Y(k) = b,    J = d F_i^(c_i) / d y_j^(d_j), the Jacobian that gives the accelerations,
    c_i >= k:      b_i = -F_i^(c_i - k), what the constraint of that level lacks behind the turn,
    c_i < k:       b_i = 0 but for derivatives of what jumps at a lower order: the balance of impulses.

For a mechanism these are G v+ = its rate and M (v+ - v-) = G^T p, for a circuit the balance of charges. J is that behind
the turn: impacts are plastic. Where J changes by the jump itself, it is led along the jump in proportion to b.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import Substitution, column
from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import derivative_name, split_derivative, time
from gantrytau.simulation.events.modes import InModes
from gantrytau.simulation.singular_poses import Point

NOTHING = 1e-12  # of the terms and their change in the run: less is how well a turn is located, no jump
ROUNDING = 1e-9  # of its terms: a smaller impulse is none
SAME = 1e-11  # of a jump: how well it is led along its way


class Infinite(Exception):
    """Names of what jumps, and of what would have to be more than an impulse for it; law: it stands in no linear law."""

    def __init__(self, jumping: Sequence[str], infinite: Sequence[str], law: bool = False):
        super().__init__(*infinite)
        self.jumping, self.infinite, self.law = jumping, infinite, law


def stepping(dae: Translated, pieces: InModes) -> list[str]:
    """The Discretes that stand below the highest derivatives: where these take new values, there may be impulses."""
    leaves = {leaf.name() for leaf in ca.symvar(column(_below(dae, pieces)))}
    return [name for name in dae.flat.discretes if name in leaves]


def _below(dae: Translated, pieces: InModes) -> list[ca.SX]:
    """The equations that the index reduction differentiated, before it did."""
    return [e for (i, m), e in pieces.residuals.items() if m < dae.indexed.counts[i]]


def turning(dae: Translated, pieces: InModes) -> list[ca.SX]:
    """The modes of the equations, if some stand below the highest derivatives: where these turn, there may be impulses."""
    below = _below(dae, pieces)
    for name, e in pieces.known.items():
        base, order = split_derivative(name)
        if derivative_name(base, order + 1) in pieces.known:
            below.append(e)
    modes = {turn.mode.name() for turn in pieces.switched.switches}

    def within(expressions: Sequence[ca.SX]) -> set[str]:
        return modes & {leaf.name() for leaf in ca.symvar(column(expressions))}

    found = within(below)
    found |= within(list(pieces.residuals.values())) if found else set()
    return [turn.mode for turn in pieces.switched.switches if turn.mode.name() in found]


class Levels:
    """The equations of jumps in reduced symbols: `unknowns`, and all their derivatives, `names`.

    orders: d_j; counts: c_i; ends: places of the highest derivatives among all symbols; symbols: all, and what is known;
    jacobian: J.
    """

    def __init__(self, dae: Translated, residuals: Mapping[Key, ca.SX], known: Sequence[str]):
        """residuals: with modes; known: names of what is known."""
        self.residuals, self.known = residuals, tuple(known)
        self.names = dae.indexed.unknown_symbols()
        self.unknowns = list(dae.indexed.orders)
        self.orders = np.array(list(dae.indexed.orders.values()), dtype=int)
        self.counts = np.array(dae.indexed.counts, dtype=int)
        self.ends = np.cumsum(self.orders + 1) - 1
        self.symbols = tuple(
            column([dae.reduced.chains.named(n) for n in names]) for names in (self.names, known)
        )
        last = column([residuals[i, int(c)] for i, c in enumerate(self.counts)])
        self.jacobian = ca.jacobian(last, self.symbols[0][self.ends.tolist()])

    def places(self, k: int) -> np.ndarray:
        """Places of the derivatives that jump at a level, -1 for impulses."""
        return np.where(self.orders >= k, self.ends - k, -1)

    def lacking(self, k: int) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Of the constraints of a level: residuals, sizes of their terms, and of the rates of these in 1/s; else zeros."""
        rows = [self.residuals[i, int(c) - k] if c >= k else ca.SX(0) for i, c in enumerate(self.counts)]
        residual, terms, rates = column(rows), ca.SX(len(rows), 1), ca.fabs(ca.jacobian(column(rows), time))
        for symbols, names in zip(self.symbols, (self.names, self.known), strict=True):
            slopes, named = (
                ca.fabs(ca.jacobian(residual, symbols)),
                dict(zip(names, symbols.elements(), strict=True)),
            )
            further = [derivative_name(b, order + 1) for b, order in map(split_derivative, names)]
            terms += slopes @ ca.fabs(symbols)
            rates += slopes @ ca.fabs(column([named.get(name, ca.SX(0)) for name in further]))
        return residual, terms, rates

    def balance(self, k: int, jumps: Sequence[ca.SX], steps: ca.SX) -> ca.SX:
        """What derivatives of jumps at other levels add to the impulses of equations below a level.

        jumps: by level, from the first; steps: by how much what is known jumps.
        """
        found, driven = ca.SX(self.counts.size, 1), dict(zip(self.known, steps.elements(), strict=True))
        for c in sorted({int(c) for c in self.counts if c < k}):
            along = [ca.SX(0)] * len(self.names)
            for j, (end, top) in enumerate(zip(self.ends.tolist(), self.orders.tolist(), strict=True)):
                for higher in range(k + 1, len(jumps) + 1):
                    order = top - c - (higher - k)
                    if order >= 0:
                        along[end - top + order] = jumps[higher - 1][j]
            for base, order in map(split_derivative, self.known):
                below = derivative_name(base, order - k + c) if order >= k - c else ""
                along.append(driven.get(below, ca.SX(0)))
            rows = [i for i, count in enumerate(self.counts.tolist()) if count == c]
            first = column([self.residuals[i, 0] for i in rows])
            if along:
                found[rows] = -ca.jtimes(first, ca.vertcat(*self.symbols), ca.vertcat(*along))
        return found


class Impulses:
    """The jumps of a model. most: the highest level at which something may jump; states: their places among all symbols;
    symbols, jacobian: all symbols and what is known, at a point, and J, as functions; discretes: see `stepping`.
    """

    def __init__(
        self,
        dae: Translated,
        pieces: InModes,
        ways: Sequence[Substitution],
        arguments: Sequence[ca.SX],
        states: Sequence[str],
    ):
        """ways: substitutions in order, from all symbols to `arguments`: x, z, time, t0, w; the last is that of modes."""
        self.dae, self._outside, self._arguments = dae, ways[-1], arguments
        self.discretes = stepping(dae, pieces)
        self.levels = levels = Levels(dae, pieces.residuals, tuple(pieces.known))
        known = (order for _, order in map(split_derivative, levels.known))
        self.most = int(levels.counts.max(initial=0)) + max(known, default=0)
        self.states = np.array([levels.names.index(n) for n in states], dtype=int)
        found = [levels.symbols[0], column(list(pieces.known.values()))]
        for way in ways:
            found = way.inserted([ca.densify(e) for e in found])
        self.symbols = ca.Function("symbols", list(arguments), found, {"cse": True})
        self.jacobian = self._function([levels.jacobian])
        self._at_levels: dict[int, ca.Function] = {}

    def _function(self, expressions: Sequence[ca.SX], more: Sequence[ca.SX] = ()) -> ca.Function:
        """Expressions of symbols and of what is known, as a function of these at a point."""
        table = self.dae.table
        steady = Substitution(tuple((table.symbols[n], ca.SX(table.values[n])) for n in table.independent))
        found = self._outside.inserted(steady.inserted([ca.densify(e) for e in expressions]))
        return ca.Function("jumps", [*self._arguments[2:], *self.levels.symbols, *more], found, {"cse": True})

    def at_level(self, k: int) -> ca.Function:
        """What constraints lack, and what other levels add, by jumps (n, levels) and steps of what is known."""
        if k not in self._at_levels:
            jumps = ca.SX.sym("jumps", self.levels.counts.size, self.most)
            steps = ca.SX.sym("steps", len(self.levels.known))
            balance = self.levels.balance(k, ca.horzsplit(jumps), steps)
            self._at_levels[k] = self._function([*self.levels.lacking(k), balance], [jumps, steps])
        return self._at_levels[k]

    def behind(self, point: Point, w: np.ndarray, span: float) -> np.ndarray | None:
        """The states behind a turn at a point that leads to w, None if nothing jumps; span: of times of the run, s.

        Infinite where they cannot be, LinAlgError where they are not determined.
        """
        jump = _Jump(self, point, w, span)
        for k in range(self.most, 0, -1):
            jump.lead(k)
        return jump.y[self.states] if jump.found else None


def possible_impulses(dae: Translated, pieces: InModes, *more: Any) -> Impulses | None:
    """The jumps of a model; None where nothing turns or takes new values that the index reduction differentiated."""
    return Impulses(dae, pieces, *more) if turning(dae, pieces) or stepping(dae, pieces) else None


class _Jump:
    """One jump, level by level."""

    def __init__(self, impulses: Impulses, point: Point, w: np.ndarray, span: float):
        x, z, t, before = point
        self.of, self.levels, self.span, self.found = impulses, impulses.levels, span, False
        y, known = (np.array(f).ravel() for f in impulses.symbols(x, z, t, t, before))
        behind = np.array(impulses.symbols(x, z, t, t, w)[1]).ravel()
        self._old, self._new = (t, t, before, y, known), (t, t, w)
        self.y, self._known = y.copy(), behind
        self._jumps = np.zeros((self.levels.counts.size, impulses.most))
        self._steps = self._steps_of_known(known, behind)

    def _steps_of_known(self, known: np.ndarray, behind: np.ndarray) -> np.ndarray:
        """By how much what is known jumps, where its derivative is known as well."""
        place, steps = {name: k for k, name in enumerate(self.levels.known)}, behind - known
        for k, (base, order) in enumerate(map(split_derivative, self.levels.known)):
            rate = place.get(derivative_name(base, order + 1), -1)
            size = abs(known[k]) + self.span * max(abs(known[rate]), abs(behind[rate]))
            if rate < 0 or abs(steps[k]) <= NOTHING * size:
                steps[k] = 0.0
        return steps

    def _lacking(self, k: int) -> np.ndarray:
        """The right-hand side of a level."""
        function, more = self.of.at_level(k), (self._jumps, self._steps)
        before, terms_before, rates_before, _ = (np.array(f).ravel() for f in function(*self._old, *more))
        here = function(*self._new, self.y, self._known, *more)
        behind, terms, rates, others = (np.array(f).ravel() for f in here)
        noise = NOTHING * (terms + terms_before + self.span * (rates + rates_before))
        lack = behind - before  # what it lacked before the turn already is the error of the integration
        return others - np.where(np.abs(lack) > noise, lack, 0.0)

    def _jacobian(self, y: np.ndarray) -> np.ndarray:
        return np.array(self.of.jacobian(*self._new, y, self._known))

    def lead(self, k: int) -> None:
        """Give the derivatives d - k the values behind the turn."""
        b = self._lacking(k)
        if not b.any():
            return
        y, jump = self._led(b, self.levels.places(k))
        self._check(k, jump, b)
        self.y, self._jumps[:, k - 1], self.found = y, jump, True

    def _led(self, b: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """End of the way J Y = b from share 0 to 1 of the jump, and Y of the whole way."""
        from scipy.integrate import solve_ivp

        own, n = places >= 0, self.y.size

        def slope(_: float, y: np.ndarray) -> np.ndarray:
            jump, rates = np.linalg.solve(self._jacobian(y[:n]), b), np.zeros(n)
            rates[places[own]] = jump[own]
            return np.append(rates, jump)

        begin = np.append(self.y, np.zeros(b.size))
        first = slope(0.0, begin)
        least = SAME * np.abs(first).max()
        end = begin + first
        if any(np.any(np.abs(slope(s, begin + s * first) - first) > least) for s in (0.37, 1.0)):
            end = solve_ivp(slope, (0.0, 1.0), begin, method="DOP853", rtol=SAME, atol=least).y[:, -1]
        return end[:n], end[n:]

    def _check(self, k: int, jump: np.ndarray, b: np.ndarray) -> None:
        """Infinite for what would have to be more than an impulse, and for impulses in laws that are not linear in them."""
        dae, levels = self.of.dae, self.levels
        jacobian = self._jacobian(self.y)
        acting = np.abs(jump) > ROUNDING * (np.abs(np.linalg.inv(jacobian)) @ np.abs(b))
        names = levels.unknowns
        jumping = [levels.known[i] for i in np.flatnonzero(self._steps)]
        moved = np.flatnonzero(acting & (levels.orders >= k))
        jumping += [derivative_name(names[j], int(levels.orders[j]) - k) for j in moved]
        spoken = [dae.spoken(name) for name in jumping]
        beyond = np.flatnonzero(acting & (k >= levels.orders + 2))
        if beyond.size:
            raise Infinite(spoken, [names[j] for j in beyond])
        there = self.y.copy()
        there[levels.ends[acting]] += jump[acting]
        size = np.abs(jacobian) @ np.abs(jump)
        bent = np.abs((self._jacobian(there) - jacobian) @ jump) > ROUNDING * size
        laws = np.flatnonzero(bent & (levels.counts == 0))
        if laws.size:
            raise Infinite(spoken, [dae.reduced.equations[i].name for i in laws], law=True)
