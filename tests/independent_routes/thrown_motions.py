"""Random motions of which a coordinate is prescribed that jumps or bends, against balances of momentum and charge by NumPy.

Masses M q'' + D q' + K q = g l with g.q (or g.q') prescribed, networks E x' = A x + g l with g.x prescribed, trolleys with
pendulums below each other, and masses on a path with a corner that they reach by themselves. From corner to corner a plain
ODE without constraints is integrated; at a corner M (v+ - v-) = g p, where p is such that g.v+ is the new rate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from gantrytau import Input, Model, Real, der, fabs, fmin, if_else, limit, sign, table, time

END = 2.0  # s
GRAVITY = 9.81
EXACT = dict(method="DOP853", rtol=1e-12, atol=1e-13)


@dataclass(frozen=True, eq=False)
class Signal:
    """What is prescribed: an expression of time, its value, and its smooth part, amplitude a and angular frequency b.

    corners: s; pieces: value at a corner before it, behind it, and rates behind it, the first at 0.
    """

    text: str
    write: Callable[[Any], Any]
    corners: tuple[float, ...]
    values: tuple[tuple[float, float], ...]
    rates: tuple[float, ...]
    a: float
    b: float

    def piece(self, k: int, t: float) -> tuple[float, float, float]:
        """Value, rate and second rate within a piece."""
        begin = (0.0, *self.corners)[k]
        value = self.values[k][1] + self.rates[k] * (t - begin)
        sine, cosine = np.sin(self.b * t), np.cos(self.b * t)
        return value + self.a * sine, self.rates[k] + self.a * self.b * cosine, -self.a * self.b**2 * sine


@dataclass(frozen=True, eq=False)
class ThrownMotion:
    """A model, how its signal is known ("equation", "input" or "given"), what is looked at, and where that is at END.

    end: None where the jump is infinite, so that it has to be refused.
    """

    text: str
    model: type[Model]
    way: str
    signal: Signal | None
    find: tuple[str, ...]
    end: np.ndarray | None


def bending(rng: np.random.Generator) -> Signal:
    """A signal that goes on, but for its rate."""
    v, u, t1, t2 = rng.choice([-1.5, -0.7, 0.8, 1.3]), rng.choice([-1.1, 0.0, 0.6]), 0.43, 1.37
    kinds = {
        "stop": (lambda t: v * fmin(t, t1), (t1,), (v, 0.0)),
        "if_else": (lambda t: if_else(t < t1, v * t, v * t1 + u * (t - t1)), (t1,), (v, u)),
        "fabs": (lambda t: v * fabs(t - t2) - v * t2, (t2,), (-v, v)),
        "limit": (lambda t: v * limit(t, t1, t2) - v * t1, (t1, t2), (0.0, v, 0.0)),
        "table": (
            lambda t: table(
                t, [0.0, t1, t2, 3.0], [0.0, v * t1, v * t1 + u * (t2 - t1), v * t1 + u * (t2 - t1)]
            ),
            (t1, t2),
            (v, u, 0.0),
        ),
    }
    name = str(rng.choice(list(kinds)))
    write, corners, rates = kinds[name]
    values, value = [(0.0, 0.0)], 0.0
    for (begin, end), rate in zip(pairwise((0.0, *corners)), rates, strict=False):
        value += rate * (end - begin)
        values.append((value, value))
    return _with_sine(rng, f"{name} {v} {u}", write, corners, values, rates)


def jumping(rng: np.random.Generator) -> Signal:
    """A signal that jumps."""
    v, t1, t2 = rng.choice([-2.0, 0.5, 1.7]), 0.43, 1.37
    kinds = {
        "step": (lambda t: if_else(t >= t1, v, 0.0), (t1,), (0.0, v)),
        "later": (lambda t: if_else(t > t1, v, 0.0), (t1,), (0.0, v)),
        "sign": (lambda t: v * sign(t - t2), (t2,), (-v, v)),
        "floor": (lambda t: v * ca.floor(1.4 * t), (1 / 1.4, 2 / 1.4), (0.0, v, 2 * v)),
        "pulse": (lambda t: if_else(t < t1, 0.0, if_else(t < t2, v, 0.2)), (t1, t2), (0.0, v, 0.2)),
    }
    name = str(rng.choice(list(kinds)))
    write, corners, levels = kinds[name]
    values = [(levels[0], levels[0]), *pairwise(levels)]
    return _with_sine(rng, f"{name} {v}", write, corners, values, (0.0,) * len(levels))


def _with_sine(rng, text: str, write, corners, values, rates) -> Signal:
    a, b = float(rng.choice([0.0, 0.3])), float(rng.choice([1.0, 4.0]))
    return Signal(
        f"{text} + {a} sin {b} t",
        lambda t: write(t) + a * ca.sin(b * t),
        tuple(corners),
        tuple(values),
        tuple(rates),
        a,
        b,
    )


def random_thrown(rng: np.random.Generator) -> ThrownMotion:
    """One of the four kinds."""
    make = rng.choice([_masses, _network, _pendulums, _path])  # pyright: ignore
    return make(rng)


def _led(signal: Signal, x: np.ndarray, rate: Callable, throw: Callable) -> np.ndarray:
    """Where x is at END: rate(t, x, piece), and throw(x, piece) into a piece."""
    for k, (begin, end) in enumerate(pairwise((0.0, *signal.corners, END))):
        if k:
            x = throw(begin, x, k)
        x = solve_ivp(rate, (begin, end), x, args=(k,), **EXACT).y[:, -1]
    return x


def _positive(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.normal(size=(n, n))
    return (a @ a.T + 0.5 * np.eye(n)).round(2)


def _direction(rng: np.random.Generator, n: int) -> np.ndarray:
    g = rng.choice([-1.0, 0.5, 1.0, 2.0], n)
    if n > 2:
        g[rng.integers(n)] = 0.0
    return g


def _started(name: str, values: np.ndarray, free: int | None) -> dict[str, Any]:
    """Variables of which all but one start where they are told."""
    return {f"{name}{i}": Real(start=float(x), fixed=i != free) for i, x in enumerate(values)}


def _way(rng: np.random.Generator) -> str:
    return str(rng.choice(["equation", "input", "given"], p=[0.5, 0.3, 0.2]))


def _prescribed(way: str, signal: Signal) -> dict[str, Any]:
    return {"s": Input(start=0.0) if way == "input" else Real()}


def _said(self: Any, way: str, signal: Signal) -> Any:
    if way == "equation":
        yield self.s == signal.write(time)


def _masses(rng: np.random.Generator) -> ThrownMotion:
    n, way = int(rng.integers(2, 5)), _way(rng)
    infinite, of_speed = rng.random() < 0.1, rng.random() < 0.4
    signal = jumping(rng) if infinite or of_speed else bending(rng)
    of_speed = of_speed and not infinite
    m, d, c, g = _positive(rng, n), 0.2 * _positive(rng, n), 3 * _positive(rng, n), _direction(rng, n)
    free = int(rng.choice(np.flatnonzero(g)))
    q, v = rng.normal(size=n).round(1), rng.normal(size=n).round(1)
    value, first, _ = signal.piece(0, 0.0)
    if not of_speed:
        q[free] += (value - g @ q) / g[free]
    v[free] += ((value if of_speed else first) - g @ v) / g[free]

    def equations(self: Any) -> Any:
        qs, vs = ([getattr(self, f"{name}{i}") for i in range(n)] for name in "qv")
        for i in range(n):
            yield der(qs[i]) == vs[i]
            force = sum(-c[i, j] * qs[j] - d[i, j] * vs[j] for j in range(n)) + g[i] * self.l
            yield sum(m[i, j] * der(vs[j]) for j in range(n)) == force
        yield sum(g[i] * (vs if of_speed else qs)[i] for i in range(n) if g[i]) == self.s
        yield from _said(self, way, signal)

    def rate(t: float, x: np.ndarray, k: int) -> np.ndarray:
        _, once, twice = signal.piece(k, t)
        free_motion = np.linalg.solve(m, -c @ x[:n] - d @ x[n:])
        along = np.linalg.solve(m, g)
        return np.append(
            x[n:], free_motion + along * ((once if of_speed else twice) - g @ free_motion) / (g @ along)
        )

    def throw(t: float, x: np.ndarray, k: int) -> np.ndarray:
        along = np.linalg.solve(m, g)
        wanted = signal.piece(k, t)[0 if of_speed else 1]
        return np.append(x[:n], x[n:] + along * (wanted - g @ x[n:]) / (g @ along))

    own = dict(
        _started("q", q, None if of_speed else free), **_started("v", v, free), l=Real(), equations=equations
    )
    model = _model(own, way, signal)
    end = None if infinite else _led(signal, np.append(q, v), rate, throw)
    find = tuple(f"{name}{i}" for name in "qv" for i in range(n))
    words = f"masses, {'speed' if of_speed else 'position'} {signal.text}, M {m.tolist()}, g {g.tolist()}, free {free}"
    return ThrownMotion(f"{words}, {way}", model, way, signal, find, end)


def _network(rng: np.random.Generator) -> ThrownMotion:
    n, way, signal = int(rng.integers(2, 5)), _way(rng), jumping(rng) if rng.random() < 0.8 else bending(rng)
    e, a, g = _positive(rng, n), -_positive(rng, n), _direction(rng, n)
    free = int(rng.choice(np.flatnonzero(g)))
    x = rng.normal(size=n).round(1)
    x[free] += (signal.piece(0, 0.0)[0] - g @ x) / g[free]

    def equations(self: Any) -> Any:
        xs = [getattr(self, f"x{i}") for i in range(n)]
        for i in range(n):
            yield (
                sum(e[i, j] * der(xs[j]) for j in range(n))
                == sum(a[i, j] * xs[j] for j in range(n)) + g[i] * self.l
            )
        yield sum(g[i] * xs[i] for i in range(n) if g[i]) == self.s
        yield from _said(self, way, signal)

    along = np.linalg.solve(e, g)

    def rate(t: float, x: np.ndarray, k: int) -> np.ndarray:
        free_motion = np.linalg.solve(e, a @ x)
        return free_motion + along * (signal.piece(k, t)[1] - g @ free_motion) / (g @ along)

    def throw(t: float, x: np.ndarray, k: int) -> np.ndarray:
        return x + along * (signal.piece(k, t)[0] - g @ x) / (g @ along)

    model = _model(dict(_started("x", x, free), l=Real(), equations=equations), way, signal)
    find = tuple(f"x{i}" for i in range(n))
    words = f"network {signal.text}, E {e.tolist()}, A {a.tolist()}, g {g.tolist()}, free {free}, {way}"
    return ThrownMotion(words, model, way, signal, find, _led(signal, x, rate, throw))


def _pendulums(rng: np.random.Generator) -> ThrownMotion:
    n, way, infinite = int(rng.integers(1, 4)), _way(rng), rng.random() < 0.1
    signal = jumping(rng) if infinite else bending(rng)
    masses, lengths = rng.choice([0.5, 1.0, 2.0], n), rng.choice([0.4, 0.7, 1.0], n)
    phi, w = rng.uniform(-1.0, 1.0, n).round(2), rng.uniform(-1.0, 1.0, n).round(2)
    below = np.cumsum(masses[::-1])[::-1]

    def equations(self: Any) -> Any:
        def of(name: str, i: int) -> Any:
            return getattr(self, f"{name}{i}")

        x, y = self.s, 0.0
        for i in range(n):
            yield der(of("phi", i)) == of("w", i)
            yield of("x", i) == x + lengths[i] * ca.sin(of("phi", i))
            yield of("y", i) == y - lengths[i] * ca.cos(of("phi", i))
            x, y = of("x", i), of("y", i)
            across, up = -of("l", i) * ca.sin(of("phi", i)), of("l", i) * ca.cos(of("phi", i))
            if i + 1 < n:
                across += of("l", i + 1) * ca.sin(of("phi", i + 1))
                up -= of("l", i + 1) * ca.cos(of("phi", i + 1))
            yield masses[i] * der(der(x)) == across
            yield masses[i] * der(der(y)) == up - masses[i] * GRAVITY
        yield from _said(self, way, signal)

    def matrix(angles: np.ndarray) -> Any:
        apart = angles[:, None] - angles[None]
        weights = below[np.maximum.outer(np.arange(n), np.arange(n))]
        return weights * np.outer(lengths, lengths) * np.exp(1j * apart)

    def rate(t: float, x: np.ndarray, k: int) -> np.ndarray:
        angles, speeds = x[:n], x[n:]
        whole, twice = matrix(angles), signal.piece(k, t)[2]
        force = -whole.imag @ speeds**2 - below * lengths * (
            GRAVITY * np.sin(angles) + twice * np.cos(angles)
        )
        return np.append(speeds, np.linalg.solve(whole.real, force))

    def throw(t: float, x: np.ndarray, k: int) -> np.ndarray:
        step = signal.piece(k, t)[1] - signal.piece(k - 1, t)[1]
        thrown = np.linalg.solve(matrix(x[:n]).real, -below * lengths * np.cos(x[:n]) * step)
        return np.append(x[:n], x[n:] + thrown)

    own = dict(_started("phi", phi, None), **_started("w", w, None), equations=equations)
    own |= {f"{name}{i}": Real() for name in "xyl" for i in range(n)}
    end = None if infinite else _led(signal, np.append(phi, w), rate, throw)
    find = tuple(f"{name}{i}" for name in ("phi", "w") for i in range(n))
    words = f"pendulums {signal.text}, m {masses.tolist()}, L {lengths.tolist()}, {phi.tolist()}, {w.tolist()}, {way}"
    return ThrownMotion(words, _model(own, way, signal), way, signal, find, end)


def _path(rng: np.random.Generator) -> ThrownMotion:
    """m x'' = F - f h'(x), M y'' = f, y = h(x) with a corner at c: v+ = v- (m + M h'- h'+) / (m + M h'+^2)."""
    m, follower, force = float(rng.choice([0.5, 1.0, 3.0])), float(rng.choice([0.2, 1.0, 4.0])), 2.0
    corner, kind = 0.6, str(rng.choice(["if_else", "table", "fmax"]))
    before, behind = float(rng.choice([-0.3, 0.0, 0.5])), float(rng.choice([0.0, 0.4, 1.2]))
    before = 0.0 if kind == "fmax" else before
    # else it would be thrown back into the corner
    behind = behind if m + follower * before * behind > 0 else 0.0
    of_v = bool(rng.random() < 0.5)  # which of both speeds is fixed, where either can be

    def equations(self: Any) -> Any:
        height = {
            "if_else": lambda x: if_else(x < corner, before * x, before * corner + behind * (x - corner)),
            "table": lambda x: table(
                x,
                [corner - 9, corner, corner + 9],
                [before * (corner - 9), before * corner, before * corner + 9 * behind],
            ),
            "fmax": lambda x: behind * ca.fmax(0, x - corner),
        }[kind]
        yield der(self.x) == self.v
        yield der(self.y) == self.w
        yield self.y == height(self.x)
        yield m * der(self.v) == force - self.f * if_else(self.x < corner, before, behind)
        yield follower * der(self.w) == self.f

    v = 0.9
    fixed = (
        dict(v=Real(start=v, fixed=True), w=Real())
        if of_v or not before
        else dict(v=Real(start=v), w=Real(start=v * before, fixed=True))
    )
    model = type(
        "Path", (Model,), dict(fixed, x=Real(start=0.0, fixed=True), y=Real(), f=Real(), equations=equations)
    )
    first, second = force / (m + follower * before**2), force / (m + follower * behind**2)
    there = (-v + np.sqrt(v**2 + 2 * first * corner)) / first
    thrown = (v + first * there) * (m + follower * before * behind) / (m + follower * behind**2)
    left = END - there
    end = np.array([corner + thrown * left + second * left**2 / 2, thrown + second * left])
    words = f"path {kind} {before} {behind}, m {m}, M {follower}, by {'v' if of_v else 'w'}"
    return ThrownMotion(words, model, "equation", None, ("x", "v"), end)


def _model(own: dict[str, Any], way: str, signal: Signal) -> type[Model]:
    return type("Thrown", (Model,), dict(own, **_prescribed(way, signal)))
