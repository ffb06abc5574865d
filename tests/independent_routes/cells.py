"""Random equations of a few unknowns, each with all of its solutions found by trying every piece.

A x + B s(W x + c) = u      s: switches, one of another kind in each row
D1 R(angle) D2 x = u        rows and columns over thirty decades, pivots that vanish at 0, 90 and 180 degrees
g(x) = u                    one unknown, with folds, powers and switches
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Input, Model, Real, fabs, if_else

FAR = 40  # steps of a floor to each side that are tried


@dataclass(frozen=True)
class Kind:
    """A function of one number: how it is written, and its pieces slope * z + shift for low <= z <= high."""

    written: Callable[[Any], Any]
    pieces: tuple[tuple[float, float, float, float], ...]  # slope, shift, low, high


def _steps() -> tuple[tuple[float, float, float, float], ...]:
    return tuple((0.0, float(k), float(k), k + 1.0) for k in range(-FAR, FAR))


INF = float("inf")
KINDS = {
    "absolute": Kind(fabs, ((1.0, 0.0, 0.0, INF), (-1.0, 0.0, -INF, 0.0))),
    "limited": Kind(
        lambda z: ca.fmin(ca.fmax(z, -1), 1),
        ((1.0, 0.0, -1.0, 1.0), (0.0, 1.0, 1.0, INF), (0.0, -1.0, -INF, -1.0)),
    ),
    "dead zone": Kind(
        lambda z: z - ca.fmin(ca.fmax(z, -1), 1),
        ((0.0, 0.0, -1.0, 1.0), (1.0, -1.0, 1.0, INF), (1.0, 1.0, -INF, -1.0)),
    ),
    "kink": Kind(lambda z: if_else(z > 0, 2 * z, 0.5 * z), ((2.0, 0.0, 0.0, INF), (0.5, 0.0, -INF, 0.0))),
    "jump": Kind(lambda z: if_else(z > 0, 1.0, -1.0), ((0.0, 1.0, 0.0, INF), (0.0, -1.0, -INF, 0.0))),
    "sign": Kind(ca.sign, ((0.0, 1.0, 0.0, INF), (0.0, 0.0, 0.0, 0.0), (0.0, -1.0, -INF, 0.0))),
    "floor": Kind(ca.floor, _steps()),
}


@dataclass(frozen=True, eq=False)
class Cell:
    """A model with an input u and an unknown x, both (n,), and where it is looked at.

    solutions: every x, (k, n), that belongs to a u; None where that is not known for sure. size: of each unknown, by which
    errors are measured; side: changes its sign where the equations are singular on the way from one u to another.
    """

    text: str
    model: type[Model]
    points: tuple[np.ndarray, ...]
    solutions: Callable[[np.ndarray], np.ndarray | None]
    size: np.ndarray
    side: Callable[[np.ndarray], float] = lambda u: 1.0


def piecewise(rng: np.random.Generator) -> Cell:
    """A few linear equations with switches on their own unknowns."""
    n = int(rng.choice([1, 1, 2, 3]))
    count = int(rng.integers(1, 3 if n == 1 else n + 1))
    names = [str(k) for k in rng.choice(list(KINDS), count)]
    a = np.eye(n) * rng.choice([1.0, 2.0, -1.5], n) + 0.3 * rng.normal(size=(n, n)).round(1)
    b = (rng.choice([0.3, 0.5, 1.0], (n, count)) * rng.choice([1, 1, -1], (n, count))).round(2)
    w = rng.integers(-1, 3, (count, n)).astype(float)
    w[~w.any(axis=1)] = 1.0
    c = rng.choice([0.0, 0.0, 0.5, -1.0], count)
    start = rng.normal(size=n).round(1)
    kinds = [KINDS[k] for k in names]
    numbers = [ca.Function("s", [z := ca.SX.sym("z")], [kind.written(z)]) for kind in kinds]
    values = np.array([float(f(w[k] @ start + c[k])) for k, f in enumerate(numbers)])
    here = a @ start + b @ values

    class Random(Model):
        u = Input(n, start=here.tolist())
        x = Real(n, start=start.tolist())

        def equations(self) -> Iterator[Any]:
            s = [kind.written(ca.dot(ca.DM(w[k]), self.x) + c[k]) for k, kind in enumerate(kinds)]
            for i in range(n):
                yield ca.dot(ca.DM(a[i]), self.x) + sum(b[i, k] * s[k] for k in range(count)) == self.u[i]

    def solutions(u: np.ndarray) -> np.ndarray | None:
        found: list[np.ndarray] = []
        for chosen in product(*(kind.pieces for kind in kinds)):
            slope, shift, low, high = (np.array(p) for p in zip(*chosen, strict=True))
            matrix = a + b @ (slope[:, None] * w)
            if abs(np.linalg.det(matrix)) < 1e-6:
                return None
            x = np.linalg.solve(matrix, u - b @ (slope * c + shift))
            z = w @ x + c
            if np.any(np.abs(z[np.isfinite(low)] - low[np.isfinite(low)]) < 1e-7):
                return None  # on a border, where it is a matter of rounding
            if np.any(np.abs(z[np.isfinite(high)] - high[np.isfinite(high)]) < 1e-7):
                return None
            if np.all(z >= low) and np.all(z <= high):
                found.append(x)
        return np.array(found).reshape(-1, n)

    points = (here, *(here + step * rng.normal(size=n).round(2) for step in (0.5, 2.0, 8.0)))
    return Cell(
        f"{names}, A {a.tolist()}, B {b.tolist()}, W {w.tolist()}, c {c.tolist()}",
        Random,
        points,
        solutions,
        np.ones(n),
    )


def scaled(rng: np.random.Generator) -> Cell:
    """Linear equations that turn with an angle, the last element of u, rows and columns of any size."""
    n = int(rng.integers(2, 6))
    pattern = rng.choice([0, 0, 1, 2, 3, 4], (n, n))  # nothing, cosine, sine, minus sine, a number
    pattern[np.arange(n), np.arange(n)] = rng.choice([1, 2, 4], n)
    plain = rng.normal(size=(n, n)).round(2)
    decades = int(rng.choice([0, 8, 15]))
    rows, columns = (10.0 ** rng.integers(-decades, decades + 1, n) for _ in range(2))
    begin = float(rng.choice([0.0, 0.7, np.pi / 2]))

    def matrix(angle: Any, cos: Any, sin: Any) -> list[list[Any]]:
        entry = {0: 0.0, 1: cos(angle), 2: sin(angle), 3: -sin(angle)}
        return [[entry.get(int(pattern[i, j]), plain[i, j]) for j in range(n)] for i in range(n)]

    class Random(Model):
        u = Input(n + 1, start=[*(rows * 1.0).tolist(), begin])
        x = Real(n)

        def equations(self) -> Iterator[Any]:
            m = matrix(self.u[n], ca.cos, ca.sin)
            for i in range(n):
                yield sum(rows[i] * columns[j] * m[i][j] * self.x[j] for j in range(n)) == self.u[i]

    def solutions(u: np.ndarray) -> np.ndarray | None:
        found = []
        for angle in np.longdouble(u[n]) * (1 + np.finfo(float).eps * np.arange(2)):
            m = np.array(matrix(angle, np.cos, np.sin), dtype=np.longdouble)
            if np.linalg.cond(m.astype(float)) > 1e4:
                return None
            found.append((eliminated(m, u[:n] / rows) / columns).astype(float))
        # all entries may be the sine of pi, which is rounding
        return found[0][None] if np.allclose(*found, rtol=1e-9, atol=0.0) else None

    def side(u: np.ndarray) -> float:
        return float(np.linalg.det(matrix(u[n], np.cos, np.sin)))

    angles = [
        begin,
        *rng.permutation([0.0, np.pi / 2, np.pi, -np.pi / 2, 1e-9, np.pi / 2 + 1e-6, 0.3])[:4].tolist(),
    ]
    points = tuple(np.append(rows * rng.normal(size=n).round(2), angle) for angle in angles)
    return Cell(
        f"angles {pattern.tolist()}, {plain.tolist()}, rows {rows}, columns {columns}, from {begin}",
        Random,
        points,
        solutions,
        1 / columns,
        side,
    )


def eliminated(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution of a linear system in long double, with the largest pivots."""
    a = np.column_stack([matrix, right]).astype(np.longdouble)
    n = len(a)
    for k in range(n):
        best = k + int(np.argmax(np.abs(a[k:, k])))
        a[[k, best]] = a[[best, k]]
        for i in range(k + 1, n):
            a[i] -= a[i, k] / a[k, k] * a[k]
    x = np.zeros(n, dtype=np.longdouble)
    for k in reversed(range(n)):
        x[k] = (a[k, n] - a[k, k + 1 : n] @ x[k + 1 :]) / a[k, k]
    return x


CURVES: dict[str, tuple[Callable[[Any, float], Any], float]] = {  # g(x), and an x to start at
    "cubic with folds": (lambda x, p: x**3 - p * x, 1.0),
    "square and absolute": (lambda x, p: x**2 + p * fabs(x), 0.8),
    "square and positive part": (lambda x, p: x**2 + p * ca.fmax(x, 0), 0.8),
    "signed square": (lambda x, p: x * fabs(x) + p * x, 0.5),
    "exponential": (lambda x, p: x + p * ca.exp(x), 0.0),
    "sine": (lambda x, p: x + 0.7 * p * ca.sin(2 * x), 0.2),
    "branches of a power": (lambda x, p: if_else(x > 1, p * (x - 1) ** 2 + x, x), 0.5),
    "steep jump": (lambda x, p: x + p * if_else(x > 1, 1.0, 0.0) + 0.1 * x**3, 0.3),
    "stairs": (lambda x, p: 0.5 * x + p * ca.floor(x), 1.2),
    "cube": (lambda x, p: p * x**3, 0.7),
}


def curved(rng: np.random.Generator) -> Cell:
    """One equation of one unknown, of any size."""
    name = str(rng.choice(list(CURVES)))
    shape, begin = CURVES[name]
    p = float(rng.choice([0.5, 1.0, 2.0]))
    size = 10.0 ** float(rng.choice([0, 0, -9, 6]))
    z = ca.SX.sym("z")
    g = ca.Function("g", [z], [shape(z, p)])
    here = float(g(begin))

    class Random(Model):
        u = Input(1, start=[here])
        x = Real(1, start=[begin * size], nominal=size)

        def equations(self) -> Iterator[Any]:
            yield shape(self.x[0] / size, p) == self.u[0]

    grid = np.linspace(-12.0, 12.0, 48_001) + 1.7e-6
    values = np.array(g(grid[None])).ravel()

    def solutions(u: np.ndarray) -> np.ndarray | None:
        rest = values - u[0]
        roots = []
        for k in np.flatnonzero(np.sign(rest[1:]) != np.sign(rest[:-1])):
            low, high = grid[k], grid[k + 1]
            for _ in range(4):  # a thousandth of the interval each
                fine = np.linspace(low, high, 1001)
                place = int(np.argmax(np.sign(np.array(g(fine[None])).ravel() - u[0]) != np.sign(rest[k])))
                low, high = fine[max(place - 1, 0)], fine[place]
            if abs(float(g(high)) - float(g(low))) < 1e-9:  # else the sign changes at a jump
                roots.append(low)
        close = grid[np.abs(rest) < 1e-3]
        far = np.min(np.abs(close[:, None] - np.array(roots)[None]), axis=1, initial=INF) > 0.2
        if np.any(far):
            return None  # nearly touches, or ends at a jump
        return size * np.array(roots).reshape(-1, 1)

    points = tuple(np.array([v]) for v in (here, here + 0.3, here - 0.9, here + 3.1, here - 4.3))
    return Cell(f"{name}, p = {p}, size {size}", Random, points, solutions, np.array([size]))


GRAMMARS = {"piecewise": piecewise, "scaled": scaled, "curved": curved}
