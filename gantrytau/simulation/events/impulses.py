"""Impulses: what jumps where a condition turns that stands in what the index reduction differentiated.

Pryce's offsets say that equation i is differentiated c_i times, and that d_j is the highest derivative of unknown j. The
jump Y_j(k) of the derivative d_j - k follows, for k = 1 and, where places jump, before that for larger k, from

    J Y(k) = b,    J = d F_i^(c_i) / d y_j^(d_j), the Jacobian that gives the accelerations,
    c_i >= k:      b_i = -F_i^(c_i - k), what the constraint of that level lacks behind the turn,
    c_i < k:       b_i = 0 but for derivatives of what jumps at a lower order: the balance of impulses.

For a mechanism these are G v+ = its rate and M (v+ - v-) = G^T p, for a circuit the balance of charges. J is that behind
the turn: impacts are plastic. Where J changes by the jump itself, it is led along the jump in proportion to b.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.compiler.alphabets import Substitution, column
from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import derivative_name, split_derivative, time
from gantrytau.simulation.events.modes import InModes
from gantrytau.simulation.singular_poses import Point

NOTHING = 1e-12  # of the terms and what they change by in the run: less is how well a turn is located, no jump
ROUNDING = 1e-9  # of its terms: a smaller impulse is none
PARTS = (4, 8, 16, 32, 64, 128)  # of a jump, until twice as many lead to the same place
SAME = 1e-11


class Infinite(Exception):
    """Names of what jumps, and of what would have to be more than an impulse for it; law: it stands in no linear law."""

    def __init__(self, jumping: Sequence[str], infinite: Sequence[str], law: bool = False):
        super().__init__(*infinite)
        self.jumping, self.infinite, self.law = jumping, infinite, law


def turning(dae: Translated, pieces: InModes) -> list[ca.SX]:
    """The modes that stand below the highest derivatives: where these turn, there may be impulses."""
    found = [e for (i, m), e in pieces.residuals.items() if m < dae.indexed.counts[i]]
    for name, e in pieces.known.items():
        base, order = split_derivative(name)
        if derivative_name(base, order + 1) in pieces.known:
            found.append(e)
    names = {leaf.name() for leaf in ca.symvar(column(found))} if found else set[str]()
    return [turn.mode for turn in pieces.switched.switches if turn.mode.name() in names]


@dataclass(frozen=True, eq=False)
class Impulses:
    """The jumps of a model; arguments: x, z, time, t0, w, to which `way` and then `outside` lead; x: names of the states."""

    dae: Translated
    pieces: InModes
    way: Substitution
    outside: Substitution
    arguments: tuple[ca.SX, ...]
    x: tuple[str, ...]

    @cached_property
    def _names(self) -> list[str]:
        return self.dae.indexed.unknown_symbols()

    @cached_property
    def _known(self) -> list[str]:
        return list(self.pieces.known)

    @cached_property
    def _orders(self) -> np.ndarray:
        return np.array(list(self.dae.indexed.orders.values()), dtype=int)

    @cached_property
    def _counts(self) -> np.ndarray:
        return np.array(self.dae.indexed.counts, dtype=int)

    @cached_property
    def _ends(self) -> np.ndarray:
        """Places of the highest derivatives among all symbols."""
        return np.cumsum(self._orders + 1) - 1

    @cached_property
    def _states(self) -> np.ndarray:
        places = {n: k for k, n in enumerate(self._names)}
        return np.array([places[n] for n in self.x], dtype=int)

    def _function(self, expressions: Sequence[ca.SX]) -> ca.Function:
        """Expressions of symbols and of what is known, as a function of these at a point."""
        table = self.dae.table
        steady = [(table.symbols[n], ca.SX(table.values[n])) for n in table.independent]
        found = self.outside.inserted(Substitution(tuple(steady)).inserted([ca.densify(e) for e in expressions]))
        named = self.dae.reduced.chains.named
        symbols = [column([named(n) for n in names]) for names in (self._names, self._known)]
        return ca.Function("impulses", [*self.arguments[2:], *symbols], found, {"cse": True})

    @cached_property
    def _symbols(self) -> ca.Function:
        """All symbols, and what is known, at a point."""
        named = self.dae.reduced.chains.named
        rows = [column([named(n) for n in self._names]), column(list(self.pieces.known.values()))]
        found = self.outside.inserted(self.way.inserted([ca.densify(e) for e in rows]))
        return ca.Function("symbols", list(self.arguments), found, {"cse": True})

    @cached_property
    def _keys(self) -> list[tuple[int, int]]:
        return [(i, m) for i, count in enumerate(self._counts.tolist()) for m in range(count)]

    @cached_property
    def _lower(self) -> ca.Function:
        """Residuals of the constraints below the highest derivatives, and their slopes by symbols, what is known and time."""
        named, residual = self.dae.reduced.chains.named, column([self.pieces.residuals[key] for key in self._keys])
        symbols, known = (column([named(n) for n in names]) for names in (self._names, self._known))
        return self._function([residual, *(ca.jacobian(residual, by) for by in (symbols, known, time))])

    @cached_property
    def _rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Places of the derivatives of all symbols and of what is known, of their own where there is none."""
        found = []
        for names in (self._names, self._known):
            places = {name: k for k, name in enumerate(names)}
            rates = (derivative_name(b, order + 1) for b, order in map(split_derivative, names))
            found.append(np.array([places.get(rate, k) for k, rate in enumerate(rates)], dtype=int))
        return found[0], found[1]

    @cached_property
    def _slopes(self) -> ca.Function:
        """The Jacobian of the highest derivatives, and those of the equations as they are by all symbols and what is known."""
        named, residuals = self.dae.reduced.chains.named, self.pieces.residuals
        last = column([residuals[i, c] for i, c in enumerate(self._counts.tolist())])
        first = column([residuals[i, 0] for i in range(self._counts.size)])
        symbols, known = (column([named(n) for n in names]) for names in (self._names, self._known))
        return self._function(
            [ca.jacobian(last, symbols[self._ends.tolist()]), ca.jacobian(first, symbols), ca.jacobian(first, known)]
        )

    def behind(self, point: Point, w: np.ndarray, span: float) -> np.ndarray | None:
        """The states behind a turn at a point that leads to w, None if nothing jumps; span: of the run, s.

        Infinite where they cannot be, LinAlgError where they are not determined.
        """
        jump = _Jump(self, point, w, span)
        for k in range(jump.most, 0, -1):
            jump.lead(k)
        return jump.y[self._states] if jump.found else None


class _Jump:
    """One jump, level by level."""

    def __init__(self, impulses: Impulses, point: Point, w: np.ndarray, span: float):
        x, z, t, before = point
        self.of, self.span, self.found = impulses, span, False
        self.old, self._known = (np.array(f).ravel() for f in impulses._symbols(x, z, t, t, before))
        self.y, self._at = self.old.copy(), (t, t)
        self._w = w
        self._before, self._was = before, self._known
        known = np.array(impulses._symbols(x, z, t, t, w)[1]).ravel()
        self._driven = self._steps_of_known(known)
        self._known = known
        depth = int(impulses._counts.max(initial=0))
        most = depth + max((order for _, order in map(split_derivative, impulses._known)), default=0)
        self.most = most if self._driven else depth if self._turned().any() else 0
        self._jumps: dict[int, np.ndarray] = {}

    def _steps_of_known(self, behind: np.ndarray) -> dict[tuple[str, int], float]:
        """By how much what is known jumps, by variable and order, where its derivative is known as well."""
        found, rates = {}, self.of._rates[1]
        steps = behind - self._known
        sizes = np.abs(self._known) + self.span * np.maximum(np.abs(self._known), np.abs(behind))[rates]
        for k in np.flatnonzero((np.abs(steps) > NOTHING * sizes) & (rates != np.arange(rates.size))):
            found[split_derivative(self.of._known[k])] = float(steps[k])
        return found

    def _turned(self) -> np.ndarray:
        """What the constraints lack here behind the turn, but for what they lacked before it."""
        before = self.of._lower(*self._at, self._before, self.old, self._was)
        behind = self.of._lower(*self._at, self._w, self.y, self._known)
        found = np.array(behind[0] - before[0]).ravel()
        terms = np.zeros(found.size)
        for y, known, (_, *slopes) in ((self.old, self._was, before), (self.y, self._known, behind)):
            along = [np.abs(a) + self.span * np.abs(a[k]) for a, k in zip((y, known), self.of._rates, strict=True)]
            for by, size in zip(slopes, (*along, np.array([self.span])), strict=True):
                terms += np.abs(np.array(by)) @ size
        return np.where(np.abs(found) > NOTHING * terms, found, 0.0)

    def _slopes(self, y: np.ndarray) -> list[np.ndarray]:
        return [np.array(f) for f in self.of._slopes(*self._at, self._w, y, self._known)]

    def lead(self, k: int) -> None:
        """Give the derivatives d - k the values behind the turn."""
        counts, orders, ends = self.of._counts, self.of._orders, self.of._ends
        lacking = {key: -f for key, f in zip(self.of._keys, self._turned(), strict=True)}
        b = np.array([lacking.get((i, int(c) - k), 0.0) for i, c in enumerate(counts)])
        if self._jumps or self._driven:
            b += self._from_others(k)
        if not b.any():
            return
        places = np.where(orders >= k, ends - k, -1)
        y, jump = self._led(b, places)
        self._check(k, jump, b)
        self.y, self._jumps[k], self.found = y, jump, True

    def _from_others(self, k: int) -> np.ndarray:
        """The balance of what jumps at other levels, and of what is known and jumps, for equations below a level."""
        _, by_symbols, by_known = self._slopes(self.y)
        counts, orders, starts = self.of._counts, self.of._orders, self.of._ends - self.of._orders
        b = np.zeros(counts.size)
        for i in np.flatnonzero(counts < k):
            for higher, jump in self._jumps.items():
                order = orders - counts[i] - (higher - k)
                there = order >= 0
                b[i] -= by_symbols[i, (starts + order)[there]] @ jump[there]
            for column_, name in enumerate(self.of._known):
                base, n = split_derivative(name)
                b[i] -= by_known[i, column_] * self._driven.get((base, n - k + int(counts[i])), 0.0)
        return b

    def _led(self, b: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where J Y = b leads, in as many parts as it takes (Runge and Kutta), and Y of the whole way."""
        own, found = places >= 0, list[np.ndarray]()

        def slope(y: np.ndarray) -> np.ndarray:
            return np.linalg.solve(self._slopes(y)[0], b)

        def same(some: np.ndarray, others: np.ndarray) -> bool:
            return bool(np.all(np.abs(some - others) <= SAME * np.abs(some).max(initial=0.0)))

        y, jump = self.y.copy(), slope(self.y)
        for share in (0.37, 0.63):
            y[places[own]] += share * jump[own]
            if not same(jump, slope(y)):
                break
        else:
            return y, jump
        for parts in PARTS:
            y, jump = self.y.copy(), np.zeros(b.size)
            for _ in range(parts):
                steps: list[np.ndarray] = []
                for share in (0.0, 0.5, 0.5, 1.0):
                    there = y.copy()
                    if steps:
                        there[places[own]] += share / parts * steps[-1][own]
                    steps.append(slope(there))
                step = (steps[0] + 2 * steps[1] + 2 * steps[2] + steps[3]) / (6 * parts)
                y[places[own]] += step[own]
                jump += step
            if found and same(jump, found[-1]):
                break
            found.append(jump)
        return y, jump

    def _check(self, k: int, jump: np.ndarray, b: np.ndarray) -> None:
        """Infinite for what would have to be more than an impulse, and for impulses in laws that are not linear in them."""
        of = self.of
        jacobian = self._slopes(self.y)[0]
        terms = np.abs(np.linalg.inv(jacobian)) @ np.abs(b)
        acting = np.abs(jump) > ROUNDING * terms
        names = list(of.dae.indexed.orders)

        def words(which: np.ndarray, order: np.ndarray) -> list[str]:
            return [of.dae.spoken(derivative_name(names[j], int(order[j]))) for j in np.flatnonzero(which)]

        moved = words(acting & (of._orders >= k), of._orders - k)
        beyond = acting & (k >= of._orders + 2)
        if beyond.any():
            raise Infinite(moved, words(beyond, 0 * of._orders))
        there = self.y.copy()
        there[of._ends[acting]] += jump[acting]
        bent = np.abs((self._slopes(there)[0] - jacobian) @ jump) > ROUNDING * (np.abs(jacobian) @ np.abs(jump))
        rows = bent & (of._counts == 0)
        if rows.any():
            laws = [of.dae.reduced.equations[i].name for i in np.flatnonzero(rows)]
            raise Infinite(moved, laws, law=True)
