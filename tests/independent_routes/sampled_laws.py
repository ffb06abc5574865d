"""Random plants x' = A x + b f under sampled laws with limits, solved exactly from instant to instant.

At an instant inputs jump first; all that is due is sampled from the values before it, with those inputs; then a when acts.
The force f is a piece of what is held, so that the plant is affine in between, and a matrix exponential takes it along.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from gantrytau import Discrete, Input, Model, Real, Samples, der, pre, sampled, time, when
from tests.independent_routes.switching_motions import SHAPES

END = 1.0  # s
PERIODS = (0.05, 0.1, 0.15)
UNSURE = 1e-6  # of what a piece or a condition asks for: rounding decides
FAR = 100.0  # of states: such laws are left out
COUNTS, TURNS = 1, 2  # what a when does to d


@dataclass(frozen=True, eq=False)
class SampledLaw:
    """A model of x (n,), s (k,), d and an input r; where x, s and d are at END, None where that is not sure."""

    text: str
    model: type[Model]
    r: Samples
    end: np.ndarray | None


def random_law(rng: np.random.Generator) -> SampledLaw:
    """One or two states, two or three variables that are sampled, each behind a piece, and one when."""
    n, k = int(rng.integers(1, 3)), int(rng.integers(2, 4))
    a = rng.normal(size=(n, n)).round(1) - 1.5 * np.eye(n)
    names = [str(name) for name in rng.choice(list(SHAPES), k + 1)]  # of the samples, then of the force
    periods = rng.choice(PERIODS, k).tolist()
    known = n + k + 2  # x, s, r, d
    inside = rng.normal(size=(k + 1, known)).round(1)
    inside[k, :n] = 0.0  # the force follows what is held
    straight = (0.4 * rng.normal(size=(k, known))).round(1)
    x0, s0 = rng.normal(size=n).round(1), rng.normal(size=k).round(1)
    jumps = np.unique([0.0, *rng.choice([0.1, 0.15, 0.2, 0.3, 0.333, 0.45, 0.6, 0.707], 3)])
    r = Samples(jumps, rng.normal(size=jumps.size).round(1), kind="constant")
    asked, border = (2 * rng.normal(size=k)).round(1), round(float(rng.normal()), 2)
    by_time = bool(rng.random() < 0.3)
    does = int(rng.choice([COUNTS, TURNS]))
    if by_time:
        border = float(rng.choice([0.2, 0.3, 0.4321]))

    class Random(Model):
        r = Input(start=0.0)
        x = Real(n, start=x0.tolist(), fixed=True)
        s = Real(k, start=s0.tolist())
        d = Discrete(0.0)

        def equations(self) -> Any:
            values = ca.vertcat(self.x, self.s, self.r, self.d)
            pieces = [
                SHAPES[name][0](ca.dot(ca.DM(inside[i]), values)) for i, name in enumerate(names)
            ]
            force = ca.vertcat(pieces[k], *[0.0] * (n - 1))
            yield der(self.x) == ca.mtimes(ca.DM(a), self.x) + force
            for i, period in enumerate(periods):
                yield sampled(self.s[i], ca.dot(ca.DM(straight[i]), values) + pieces[i], period=period)
            condition = time >= border if by_time else ca.dot(ca.DM(asked), self.s) > border
            yield when(condition, self.d == (pre(self.d) + 1 if does == COUNTS else 1 - pre(self.d)))

    def piece(i: int, values: np.ndarray) -> float:
        _, borders, lines = SHAPES[names[i]]
        z = float(inside[i] @ values)
        if min(abs(z - b) for b in borders) < UNSURE * (1 + abs(z)):
            raise _UnsureError
        slope, shift = lines[int(np.searchsorted(borders, z))]
        return slope * z + shift

    def holds(t: float, s: np.ndarray) -> bool:
        if by_time:
            return t >= border - 1e-9
        if abs(asked @ s - border) < UNSURE:
            raise _UnsureError
        return bool(asked @ s > border)

    def end() -> np.ndarray:
        x, s, d, held = x0, s0, 0.0, True
        instants = {round(j * p, 9) for p in periods for j in range(round(END / p) + 1)}
        instants = sorted({0.0, END, *instants, *jumps.tolist(), *([border] if by_time else [])})
        instants = [t for t in instants if t <= END]
        for t, until in zip(instants, [*instants[1:], END], strict=True):
            u = float(r.values[np.searchsorted(r.times, t + 1e-9) - 1, 0])
            values = np.concatenate([x, s, [u, d]])
            due = [abs(t / p - round(t / p)) < 1e-6 for p in periods]
            new = [float(straight[i] @ values) + piece(i, values) if due[i] else s[i] for i in range(k)]
            s, now = np.array(new), holds(t, np.array(new))
            if now and not held:
                d = d + 1 if does == COUNTS else 1 - d
            held = now
            force = piece(k, np.concatenate([x, s, [u, d]]))
            whole = np.zeros((n + 1, n + 1))
            whole[:n, :n], whole[0, n] = a, force
            x = (expm(whole * (until - t)) @ np.append(x, 1.0))[:n]
            if not np.abs(np.append(x, s)).max() < FAR:
                raise _UnsureError
        return np.concatenate([x, s, [d]])

    try:
        there = end()
    except _UnsureError:
        there = None
    text = f"A {a.tolist()}, {names}, periods {periods}, inside {inside.tolist()}, straight {straight.tolist()}, x0 {x0.tolist()}, "
    text += f"s0 {s0.tolist()}, r {jumps.tolist()} {r.values.ravel().tolist()}, when {asked.tolist()} {border} {by_time} {does}"
    return SampledLaw(text, Random, r, there)


class _UnsureError(Exception):
    pass
