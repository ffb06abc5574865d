"""Random motions x' = A x + b + sum c_k s_k that switch on states and on time, solved exactly from switch to switch.

s_k is an absolute value, a limiter, a jump, a kink or a table of a linear function of the states, or a pulse of time.
Between two switches the system is affine, and a matrix exponential takes it as far as one likes; where a margin has changed
its sign, the instant is found by bisection.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from gantrytau import Input, Model, Real, between, der, fabs, if_else, sin, table

LOOKS = 1500  # at the margins
DENSE = 12.0  # rad, of the sine of a switch, for each unit of what it switches on
GRAZED = 2e-3  # of a margin that turns back without a change of sign
END = 2.0  # s

# slope and shift of s(z) below, between and above the borders of z
SHAPES: dict[str, tuple[Any, tuple[float, ...], tuple[tuple[float, float], ...]]] = {
    "absolute": (fabs, (0.0,), ((-1.0, 0.0), (1.0, 0.0))),
    "limited": (lambda z: ca.fmin(ca.fmax(z, -0.5), 0.5), (-0.5, 0.5), ((0.0, -0.5), (1.0, 0.0), (0.0, 0.5))),
    "jump": (lambda z: if_else(z > 0.1, 1.0, -0.5), (0.1,), ((0.0, -0.5), (0.0, 1.0))),
    "table": (
        lambda z: table(z, [-1.0, -0.25, 0.5, 1.0], [0.5, -0.4, 0.2, 0.2], outside="hold"),
        (-1.0, -0.25, 0.5),
        ((0.0, 0.5), (-1.2, -0.7), (0.8, -0.2), (0.0, 0.2)),
    ),
    "kink": (lambda z: if_else(z > 0, 2 * z, 0.5 * z), (0.0,), ((0.5, 0.0), (2.0, 0.0))),
}
EDGES = np.arcsin(0.3) + 2 * np.pi * np.arange(-12, 12)[:, None] + [0.0, np.pi - 2 * np.arcsin(0.3)]
SHAPES_OF_SINES: dict[str, tuple[Any, tuple[float, ...], tuple[tuple[float, float], ...]]] = {
    "sine": (
        lambda z: if_else(sin(DENSE * z) > 0.3, 1.0, -0.5),
        tuple((EDGES / DENSE).ravel().tolist()),  # for |z| < 6, beyond which it ends
        ((0.0, -0.5), *((0.0, level) for _ in EDGES for level in (1.0, -0.5))),
    )
}
ALL_SHAPES = SHAPES | SHAPES_OF_SINES


@dataclass(frozen=True, eq=False)
class SwitchingMotion:
    """A model of the states x (n,) with an input f, a pulse of time, and where x is at END; None where that is not sure."""

    text: str
    model: type[Model]
    pulse: tuple[float, float, float]  # s, s, height
    end: np.ndarray | None


def random_motion(rng: np.random.Generator, shapes: Iterable[str] = tuple(SHAPES)) -> SwitchingMotion:
    """Two or three states, one or two switches, one pulse, which may be a hundredth of the time long."""
    n = int(rng.integers(1, 4))
    a = rng.normal(size=(n, n)).round(1) - 0.5 * np.eye(n)
    if n > 1 and rng.random() < 0.7:
        a[0], a[1] = 0.0, -rng.choice([4.0, 25.0, 100.0]) * np.eye(n)[0]  # swings
        a[0, 1] = 1.0
    names = [str(k) for k in rng.choice(list(shapes), int(rng.integers(1, 3)))]
    w, c = rng.normal(size=(len(names), n)).round(1), rng.normal(size=(len(names), n)).round(1)
    begin = float(rng.uniform(0.2, 1.5).__round__(3))
    pulse = (begin, begin + float(rng.choice([0.002, 0.02, 0.3])), float(rng.choice([5.0, 50.0])))
    x0 = rng.normal(size=n).round(1)

    class Random(Model):
        f = Input(start=0.0)
        x = Real(n, start=x0.tolist(), fixed=True)

        def equations(self) -> Any:
            s = [ALL_SHAPES[name][0](ca.dot(ca.DM(w[k]), self.x)) for k, name in enumerate(names)]
            switching = sum(ca.DM(c[k]) * s[k] for k in range(len(names)))
            force = ca.vertcat(self.f, *[0.0] * (n - 1))
            yield der(self.x) == ca.mtimes(ca.DM(a), self.x) + switching + force

    text = f"{names}, A {a.tolist()}, w {w.tolist()}, c {c.tolist()}, x0 {x0.tolist()}, pulse {pulse}"
    return SwitchingMotion(text, Random, pulse, _end(a, names, w, c, x0, pulse))


def pulse_of_time(pulse: tuple[float, float, float]) -> Any:
    """The input as a user writes it."""
    begin, end, height = pulse
    return lambda t: if_else(between(begin, t, end), height, 0.0)


def _end(
    a: np.ndarray, names: list[str], w: np.ndarray, c: np.ndarray, x0: np.ndarray, pulse: Any
) -> np.ndarray | None:
    begin, end, height = pulse
    n, x = len(x0), np.append(x0, 1.0)
    borders = [np.array(ALL_SHAPES[name][1]) for name in names]
    steps: dict[tuple[int, ...], np.ndarray] = {}

    def pieces(x: np.ndarray) -> list[int]:
        return [int(np.searchsorted(ALL_SHAPES[name][1], w[k] @ x[:n])) for k, name in enumerate(names)]

    def margins(x: np.ndarray) -> np.ndarray:
        return np.concatenate([w[k] @ x[:n] - borders[k] for k in range(len(names))])

    def rates(chosen: list[int], force: float) -> np.ndarray:
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n] = a
        whole[0, n] = force
        for k, piece in enumerate(chosen):
            slope, shift = ALL_SHAPES[names[k]][2][piece]
            whole[:n, :n] += slope * np.outer(c[k], w[k])
            whole[:n, n] += shift * c[k]
        return whole

    chosen = pieces(x)
    for here, there in pairwise((0.0, begin, end, END)):
        force, left = (height if here == begin else 0.0), there - here
        while left > 0:
            m = rates(chosen, force)
            h = min(END / LOOKS / (4 if "sine" in names else 1), left)
            if any(name == "sine" and p in (0, EDGES.size) for name, p in zip(names, chosen, strict=True)):
                return None
            key = (*chosen, int(force), int(h == left))
            if h == left or key not in steps:
                steps[key] = expm(m * h)
            last, new = x, steps[key] @ x
            before, after = margins(last), margins(new)
            slopes = margins(m @ last) - margins(0 * last), margins(m @ new) - margins(0 * new)
            turned = (slopes[0] * slopes[1] < 0) & (before * after > 0)
            if np.any(turned & (np.minimum(np.abs(before), np.abs(after)) < GRAZED)):
                return None
            if np.all(before * after > 0) or pieces(new) == chosen:
                x, left = new, left - h
                continue
            low, high = 0.0, h
            for _ in range(60):
                middle = (low + high) / 2
                if pieces(expm(m * middle) @ x) == chosen:
                    low = middle
                else:
                    high = middle
            crossing = expm(m * high) @ x
            beyond = pieces(crossing)
            across = int(np.argmin(np.abs(margins(crossing))))
            speeds = [
                margins(rates(p, force) @ crossing)[across] - margins(0 * x)[across] for p in (chosen, beyond)
            ]
            if speeds[0] * speeds[1] <= 0 or min(map(abs, speeds)) < 0.02:
                return None  # slides along the border, or hardly crosses it
            x, left, chosen = crossing, left - high, beyond
    return x[:n]
