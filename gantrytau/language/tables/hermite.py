"""Cubic Hermite curves and surfaces through points: slopes from the points around each, after Akima, Fritsch and Steffen."""

from collections.abc import Callable, Mapping
from itertools import pairwise

import casadi as ca
import numpy as np

from gantrytau.language.tables.local_polynomials import Polynomials, pieces


def curve(at: ca.SX, x: np.ndarray, y: np.ndarray, kind: str, outside: str) -> ca.SX:
    """The curve through y (n,) at x (n,), rising, n > 2; kind: a name in SLOPES; outside: how it goes on."""
    slopes = SLOPES[kind](np.diff(x), np.diff(y) / np.diff(x))
    (value,), _ = pieces(x, _cubics(x, y[:, None], slopes[:, None]), slopes[[0, -1], None], outside).at(at)
    return value


def surface(at: tuple[ca.SX, ca.SX], x: np.ndarray, y: np.ndarray, z: np.ndarray, outside: str) -> ca.SX:
    """The bicubic surface through z (n, m) at x (n,), y (m,): Akima (1974), Communications of the ACM 17(1), 18-20."""
    xs, extended = _extended(x, z)
    ys, extended = _extended(y, extended.T)
    extended = extended.T
    along_x, along_y = np.diff(extended, axis=0), np.diff(extended, axis=1)
    along_x, along_y = along_x / np.diff(xs)[:, None], along_y / np.diff(ys)
    cross = np.diff(along_y, axis=0)[1:-1, 1:-1] / np.diff(xs)[1:-1, None]
    wx, wy = _weights(along_x)[:, :, 2:-2], np.moveaxis(_weights(along_y.T), 2, 1)[:, 2:-2]
    slopes_x = (wx * np.stack([along_x[1:-2, 2:-2], along_x[2:-1, 2:-2]])).sum(0)
    slopes_y = (wy * np.stack([along_y[2:-2, 1:-2], along_y[2:-2, 2:-1]])).sum(0)
    parts = ((wx[k] * wy[j] * _quadrant(cross, k, j)) for k in (0, 1) for j in (0, 1))
    values = np.block([[z, slopes_y], [slopes_x, sum(parts)]])
    (rows, _), (columns, _) = (_cardinal(axis, outside).at(one) for axis, one in ((x, at[0]), (y, at[1])))
    return ca.dot(ca.vertcat(*rows), ca.DM(values) @ ca.vertcat(*columns))


def _quadrant(cross: np.ndarray, k: int, j: int) -> np.ndarray:
    n, m = cross.shape
    return cross[k : n - 1 + k, j : m - 1 + j]


def _cardinal(x: np.ndarray, outside: str) -> Polynomials:
    """The cardinal cubics: those with value 1 at one point, and those with slope 1 at one point."""
    one, none = np.eye(x.size), np.zeros((x.size, x.size))
    values, slopes = np.hstack([one, none]), np.hstack([none, one])
    return pieces(x, _cubics(x, values, slopes), slopes[[0, -1]], outside)


def _cubics(x: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Coefficients (4, n - 1, functions), the highest power first, between values and slopes (n, functions)."""
    dx = np.diff(x)[:, None]
    d = np.diff(y, axis=0) / dx
    left, right = slopes[:-1], slopes[1:]
    return np.array([(left + right - 2 * d) / dx**2, (3 * d - 2 * left - right) / dx, left, y[:-1]])


def _weights(d: np.ndarray, mean: float = 0.0) -> np.ndarray:
    """Weights (2, n - 3, ...) of the differences d (n, ...) on both sides of a point, by how those further out change.

    mean: the part of their mean in it, 0.5 in the modified method of Akima.
    """
    change = np.abs(np.diff(d, axis=0)) + mean * np.abs(d[1:] + d[:-1])
    left, right = change[2:], change[:-2]
    whole = left + right
    even = np.full_like(whole, 0.0 if mean else 0.5)
    safe = np.where(whole > 0, whole, 1.0)
    return np.stack([np.where(whole > 0, one / safe, even) for one in (left, right)])


def _akima(dx: np.ndarray, d: np.ndarray, mean: float = 0.0) -> np.ndarray:
    """Akima (1970), Journal of the ACM 17(4), 589-602."""
    d = np.concatenate(
        [[3 * d[0] - 2 * d[1], 2 * d[0] - d[1]], d, [2 * d[-1] - d[-2], 3 * d[-1] - 2 * d[-2]]]
    )
    return (_weights(d, mean) * np.stack([d[1:-2], d[2:-1]])).sum(0)


def _butland(dx: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Fritsch and Butland (1984), SIAM Journal on Scientific and Statistical Computing 5(2), 300-304."""
    inner = [
        3 * (h + k) / ((h + 2 * k) / a + (k + 2 * h) / b) if a * b > 0 else 0.0
        for (a, b), (h, k) in zip(pairwise(d), pairwise(dx), strict=True)
    ]
    return np.array([d[0], *inner, d[-1]])


def _steffen(dx: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Steffen (1990), Astronomy and Astrophysics 239, 443-450."""
    inner = [
        np.sign(a) * min(abs(a * k + b * h) / (h + k), 2 * abs(a), 2 * abs(b)) if a * b > 0 else 0.0
        for (a, b), (h, k) in zip(pairwise(d), pairwise(dx), strict=True)
    ]
    return np.array([d[0], *inner, d[-1]])


def _extended(x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points x (n,) with values z (n, m), and two more at either end."""
    (low, below), (high, above) = _continued(x[::-1], z[::-1]), _continued(x, z)
    return np.concatenate([low[::-1], x, high]), np.concatenate([below[::-1], z, above])


def _continued(x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two points behind the last one, on the parabolas through the last three or the line through two."""
    if x.size == 2:
        steps = np.array([2.0, 3.0])
        return x[0] + steps * (x[1] - x[0]), z[0] + steps[:, None] * (z[1] - z[0])
    (a, b), (e, f) = np.diff(x[-3:]), np.diff(z[-3:], axis=0)
    first = z[-1] + a * (2 * f / b - e / a)
    second = first + b * ((first - z[-1]) / a + f / b - e / a)
    return np.array([x[-1] + a, x[-1] + a + b]), np.stack([first, second])


SLOPES: Mapping[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "akima": _akima,
    "modified akima": lambda dx, d: _akima(dx, d, 0.5),
    "fritsch-butland": _butland,
    "steffen": _steffen,
}
