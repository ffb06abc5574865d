"""Random hybrid motions x' = A x + b + B d with discrete d, solved exactly from event to event.

Whens stand on linear functions of the states, on the time, and on the discrete values; they set states anew, count, and
turn round. Between two events the system is affine, and a matrix exponential takes it as far as one likes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from gantrytau import Discrete, Model, Real, der, logic_and, pre, reinit, time, when

END = 2.0  # s
LOOKS = 607.3  # at the margins, at no round times
UNSURE = 1e-4  # of a margin that is nearly zero where something happens
ZERO = 1e-10  # of a margin that is zero but for rounding
SLOW = 0.02  # 1/s, at which a margin is hardly crossed
MOST = 60  # events


@dataclass(frozen=True)
class Rule:
    """`when(w x > border)`, with `least` <= d besides if that is not None; or `when(time > border)` if w is None.

    Then x[state] = scale * pre(x[state]) + shift, and d counts or turns round.
    """

    w: tuple[float, ...] | None
    border: float
    least: int | None
    state: int
    scale: float
    shift: float
    counts: bool


@dataclass(frozen=True, eq=False)
class HybridMotion:
    """A model of x (n,) and d, and where both are at END, and the number of events; None where that is not sure."""

    text: str
    model: type[Model]
    end: tuple[np.ndarray, float, int] | None


def random_hybrid(rng: np.random.Generator) -> HybridMotion:
    """One to three states that mostly swing, one to three whens."""
    n = int(rng.integers(1, 4))
    a = rng.normal(size=(n, n)).round(1) - 0.5 * np.eye(n)
    if n > 1 and rng.random() < 0.7:
        a[0], a[1] = 0.0, -rng.choice([4.0, 25.0, 100.0]) * np.eye(n)[0]
        a[0, 1] = 1.0
    b, by_d = rng.normal(size=n).round(1), rng.normal(size=n).round(1)
    x0 = rng.normal(size=n).round(1)
    rules = [_rule(rng, n) for _ in range(int(rng.integers(1, 4)))]
    rules = [rule for k, rule in enumerate(rules) if k == 0 or not rule.counts]  # one may set d
    own = {}
    for rule in rules:  # and one a state
        own.setdefault(rule.state, rule)
    rules = list(own.values())

    class Hybrid(Model):
        x = Real(n, start=x0.tolist(), fixed=True)
        d = Discrete(0.0)

        def equations(self) -> Any:
            yield der(self.x) == ca.mtimes(ca.DM(a), self.x) + ca.DM(b) + ca.DM(by_d) * self.d
            for k, rule in enumerate(rules):
                condition = (
                    time > rule.border if rule.w is None else ca.dot(ca.DM(rule.w), self.x) > rule.border
                )
                if rule.least is not None:
                    condition = logic_and(condition, self.d >= rule.least)
                state = self.x[rule.state]
                actions = [reinit(state, rule.scale * pre(state) + rule.shift)]
                if k == 0:
                    actions += [self.d == (pre(self.d) + 1 if rule.counts else 1 - pre(self.d))]
                yield when(condition, *actions)

    text = f"A {a.tolist()}, b {b.tolist()}, by d {by_d.tolist()}, x0 {x0.tolist()}, {rules}"
    return HybridMotion(text, Hybrid, _end(_Exact(a, b, by_d, rules), x0))


def _rule(rng: np.random.Generator, n: int) -> Rule:
    by_time = rng.random() < 0.25
    w = None if by_time else tuple((rng.normal(size=n).round(1) + 0.05).tolist())
    border = round(float(rng.uniform(0.1, 1.9)), 3) if by_time else round(float(rng.normal()), 1)
    least = 1 if rng.random() < 0.2 else None
    scale, shift = float(rng.choice([-1.0, -0.7, 0.0, 1.0])), float(rng.choice([0.0, 0.3, -0.5]))
    return Rule(w, border, least, int(rng.integers(n)), scale, shift, bool(rng.random() < 0.5))


class _Exact:
    """The affine systems between events, and the margins of the rules along them."""

    def __init__(self, a: np.ndarray, b: np.ndarray, by_d: np.ndarray, rules: list[Rule]):
        self.a, self.b, self.by_d, self.rules = a, b, by_d, rules
        self.step = cache(self._step)

    def _step(self, d: float, h: float) -> np.ndarray:
        n = len(self.b)
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n] = self.a, self.b + self.by_d * d
        return expm(whole * h)

    def moved(self, x: np.ndarray, d: float, h: float) -> np.ndarray:
        step = self.step if h == END / LOOKS else self._step
        return (step(d, h) @ np.append(x, 1.0))[:-1]

    def margins(self, x: np.ndarray, t: float) -> np.ndarray:
        return np.array([(t if r.w is None else np.dot(r.w, x)) - r.border for r in self.rules])

    def ahead(self, x: np.ndarray, t: float, d: float, h: float) -> np.ndarray:
        return self.margins(self.moved(x, d, h), t + h)

    def speeds(self, x: np.ndarray, d: float) -> np.ndarray:
        rates = self.a @ x + self.b + self.by_d * d
        return np.array([1.0 if r.w is None else np.dot(r.w, rates) for r in self.rules])

    def truths(self, x: np.ndarray, t: float, d: float) -> np.ndarray | None:
        """Which conditions hold from here on; None where that is not sure."""
        m, s = self.margins(x, t), self.speeds(x, d)
        zero = np.abs(m) < ZERO
        if np.any(~zero & (np.abs(m) < UNSURE)) or np.any(zero & (np.abs(s) < UNSURE)):
            return None
        return np.where(zero, s > 0, m > 0) & [r.least is None or d >= r.least for r in self.rules]

    def turns_back(self, x: np.ndarray, new: np.ndarray, t: float, h: float, d: float) -> bool:
        """Whether a margin nearly reaches zero between two points."""
        before, after = self.margins(x, t), self.margins(new, t + h)
        turning = (self.speeds(x, d) * self.speeds(new, d) < 0) & (before * after > 0)
        return bool(np.any(turning & (np.minimum(np.abs(before), np.abs(after)) < 20 * UNSURE)))


def _end(exact: _Exact, x: np.ndarray) -> tuple[np.ndarray, float, int] | None:
    t, d, events, now = 0.0, 0.0, 0, exact.truths(x, 0.0, 0.0)
    while now is not None and t < END and events <= MOST:
        h = min(END / LOOKS, END - t)
        new, before = exact.moved(x, d, h), exact.margins(x, t)
        if exact.turns_back(x, new, t, h, d):
            return None
        sides = np.where(np.abs(before) < ZERO, exact.speeds(x, d) > 0, before > 0)
        if np.array_equal(sides, exact.margins(new, t + h) > 0):
            x, t = new, t + h
            continue
        h = _crossing(partial(exact.ahead, x, t, d), sides, h)
        x, t = exact.moved(x, d, h), t + h
        near = np.abs(exact.margins(x, t)) < UNSURE
        if np.sum(near) > 1 or np.any(np.abs(exact.speeds(x, d))[near] < SLOW):
            return None
        while (then := exact.truths(x, t, d)) is not None and np.any(then & ~now) and events <= MOST:
            x, d = _acted(exact.rules, then & ~now, x, d)
            now, events = then, events + 1
        now = then
    return None if now is None or events > MOST else (x, d, events)


def _crossing(margins: Callable[[float], np.ndarray], sides: np.ndarray, h: float) -> float:
    """The least time within h, by bisection, at which some margin is on another side."""
    low, high = 0.0, h
    for _ in range(70):
        middle = (low + high) / 2
        if np.array_equal(margins(middle) > 0, sides):
            low = middle
        else:
            high = middle
    return high


def _acted(rules: list[Rule], acting: np.ndarray, x: np.ndarray, d: float) -> tuple[np.ndarray, float]:
    """What whens make of states and d, from the values before."""
    x, old = x.copy(), x
    for rule, acts in zip(rules, acting, strict=True):
        if acts:
            x[rule.state] = rule.scale * old[rule.state] + rule.shift
    if acting[0]:
        d = d + 1 if rules[0].counts else 1 - d
    return x, d
