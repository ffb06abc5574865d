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


@dataclass(frozen=True, eq=False)
class SampledLaw:
    """A model of x (n,), s (k,), d and an input r; where x, s and d are at END, None where that is not sure."""

    text: str
    model: type[Model]
    r: Samples
    end: np.ndarray | None


class _UnsureError(Exception):
    pass


@dataclass(frozen=True)
class _Law:
    """x' = a x + force; straight (k, n + k + 2) and inside (k + 1, n + k + 2) times x, s, r, d are what is sampled, and what
    the pieces `names` are of, the force last; the when asks for the time or for `asked` s above a border.
    """

    a: np.ndarray
    names: list[str]
    periods: list[float]
    inside: np.ndarray
    straight: np.ndarray
    x0: np.ndarray
    s0: np.ndarray
    jumps: np.ndarray
    r: np.ndarray
    asked: np.ndarray
    border: float
    by_time: bool
    counts: bool

    def piece(self, i: int, values: np.ndarray) -> float:
        _, borders, lines = SHAPES[self.names[i]]
        z = float(self.inside[i] @ values)
        if min(abs(z - b) for b in borders) < UNSURE * (1 + abs(z)):
            raise _UnsureError
        slope, shift = lines[int(np.searchsorted(borders, z))]
        return slope * z + shift

    def holds(self, t: float, s: np.ndarray) -> bool:
        if self.by_time:
            return t >= self.border - 1e-9
        if abs(self.asked @ s - self.border) < UNSURE:
            raise _UnsureError
        return bool(self.asked @ s > self.border)

    def end(self) -> np.ndarray:
        x, s, d, held, n = self.x0, self.s0, 0.0, True, self.x0.size
        ticks = {round(j * p, 9) for p in self.periods for j in range(round(END / p) + 1)}
        ticks |= {0.0, END, *self.jumps.tolist(), *([self.border] if self.by_time else [])}
        instants = sorted(t for t in ticks if t <= END)
        for t, until in zip(instants, [*instants[1:], END], strict=True):
            r = float(self.r[np.searchsorted(self.jumps, t + 1e-9) - 1])
            values = np.concatenate([x, s, [r, d]])
            due = [abs(t / p - round(t / p)) < 1e-6 for p in self.periods]
            new = [
                self.straight[i] @ values + self.piece(i, values) if due[i] else s[i] for i in range(s.size)
            ]
            s, before = np.array(new, dtype=float), held
            held = self.holds(t, s)
            if held and not before:
                d = d + 1 if self.counts else 1 - d
            whole = np.zeros((n + 1, n + 1))
            whole[:n, :n], whole[0, n] = self.a, self.piece(s.size, np.concatenate([x, s, [r, d]]))
            x = (expm(whole * (until - t)) @ np.append(x, 1.0))[:n]
            if not np.abs(np.append(x, s)).max() < FAR:
                raise _UnsureError
        return np.concatenate([x, s, [d]])

    def model(self) -> type[Model]:
        law, n, k = self, self.x0.size, self.s0.size

        class Random(Model):
            r = Input(start=0.0)
            x = Real(n, start=law.x0.tolist(), fixed=True)
            s = Real(k, start=law.s0.tolist())
            d = Discrete(0.0)

            def equations(self) -> Any:
                values = ca.vertcat(self.x, self.s, self.r, self.d)
                pieces = [
                    SHAPES[name][0](ca.dot(ca.DM(law.inside[i]), values)) for i, name in enumerate(law.names)
                ]
                yield der(self.x) == ca.mtimes(ca.DM(law.a), self.x) + ca.vertcat(pieces[k], *[0.0] * (n - 1))
                for i, period in enumerate(law.periods):
                    yield sampled(
                        self.s[i], ca.dot(ca.DM(law.straight[i]), values) + pieces[i], period=period
                    )
                condition = (
                    time >= law.border if law.by_time else ca.dot(ca.DM(law.asked), self.s) > law.border
                )
                yield when(condition, self.d == (pre(self.d) + 1 if law.counts else 1 - pre(self.d)))

        return Random


def random_law(rng: np.random.Generator) -> SampledLaw:
    """One or two states, two or three variables that are sampled, each behind a piece, and one when."""
    n, k = int(rng.integers(1, 3)), int(rng.integers(2, 4))
    known = n + k + 2  # x, s, r, d
    inside = rng.normal(size=(k + 1, known)).round(1)
    inside[k, :n] = 0.0  # the force follows what is held
    jumps = np.unique([0.0, *rng.choice([0.1, 0.15, 0.2, 0.3, 0.333, 0.45, 0.6, 0.707], 3)])
    by_time = bool(rng.random() < 0.3)
    law = _Law(
        a=rng.normal(size=(n, n)).round(1) - 1.5 * np.eye(n),
        names=[str(name) for name in rng.choice(list(SHAPES), k + 1)],
        periods=rng.choice(PERIODS, k).tolist(),
        inside=inside,
        straight=(0.4 * rng.normal(size=(k, known))).round(1),
        x0=rng.normal(size=n).round(1),
        s0=rng.normal(size=k).round(1),
        jumps=jumps,
        r=rng.normal(size=jumps.size).round(1),
        asked=(2 * rng.normal(size=k)).round(1),
        border=float(rng.choice([0.2, 0.3, 0.4321])) if by_time else round(float(rng.normal()), 2),
        by_time=by_time,
        counts=bool(rng.random() < 0.5),
    )
    try:
        end = law.end()
    except _UnsureError:
        end = None
    return SampledLaw(str(law), law.model(), Samples(law.jumps, law.r, kind="constant"), end)
