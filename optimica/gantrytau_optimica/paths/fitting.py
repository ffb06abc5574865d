"""Curves of any kind brought to one form: quintic pieces over the arc length.

A curve r(u) is cut into spans. On each, the quintic over the arc length s takes place, unit tangent t and
curvature vector k of the curve at both ends,

    t = r' / |r'|,   k = (r'' - t (t . r'')) / |r'|^2   with ' = d/du,

and a span is halved until its quintic is as near to the curve as asked. Place, tangent and curvature are
continuous, so accelerations of a motion along the path are, and its jerk is bounded.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.paths.points import words

Array = NDArray[np.float64]
DEPTH = 14  # halvings of a span; a kink is never approached well enough, whatever their number
RELATIVE = 1e-5  # error of a piece relative to its length: keeps tangent and curvature of short pieces right
GAUSS = np.polynomial.legendre.leggauss(8)
INNER = 6  # parts of a span, between which a piece is compared with the curve
# the quintic on [0, 1] from place, first and second derivative at 0, then at 1: coefficients of its powers
HERMITE = np.linalg.inv(
    [
        [1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1], [0, 1, 2, 3, 4, 5], [0, 0, 2, 6, 12, 20],
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial(Record):
    """Polynomials over the arc length: place = sum of coefficients[i, j] * (s - knots[i])**j on piece i.

    knots: (n + 1,) in m, from 0; coefficients: (n, degree + 1, d).
    """

    knots: Array
    coefficients: Array

    def derivative(self, s: Array, order: int = 0) -> Array:
        """The derivative of the place of this order at lengths s (k,), (k, d); the place itself for 0."""
        index = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.knots) - 2)
        x = (s - self.knots[index])[:, None]
        found = np.zeros((len(s), self.coefficients.shape[2]))
        for j in range(self.coefficients.shape[1] - 1, order - 1, -1):
            factor = np.prod(np.arange(j, j - order, -1.0))
            found = found * x + factor * self.coefficients[index, j]
        return found

    def between(self, start: float, stop: float) -> "PiecewisePolynomial":
        """The part from one length to another, exactly."""
        inside = self.knots[(self.knots > start + 1e-12) & (self.knots < stop - 1e-12)]
        begins = np.concatenate([[start], inside])
        orders = range(self.coefficients.shape[1])
        factorials = np.cumprod([1.0, *np.arange(1.0, len(orders))])
        taylor = [self.derivative(begins, j) / factorials[j] for j in orders]
        return PiecewisePolynomial(np.append(begins, stop) - start, np.stack(taylor, axis=1))


def joined(parts: Sequence[PiecewisePolynomial]) -> PiecewisePolynomial:
    """One after another."""
    offsets = np.cumsum([0.0, *(part.knots[-1] for part in parts)])
    knots = [part.knots[1:] + offset for part, offset in zip(parts, offsets, strict=False)]
    return PiecewisePolynomial(
        np.concatenate([[0.0], *knots]), np.concatenate([part.coefficients for part in parts])
    )


def continued(pieces: PiecewisePolynomial) -> PiecewisePolynomial:
    """The same with a straight piece at each end, for iterations that stray; it takes over only a little beyond the
    end, where a motion that ends to within rounding errors never is.
    """
    if not np.any(pieces.coefficients[:, 2:]):
        return pieces
    knots, beyond = pieces.knots, 0.01 * pieces.knots[-1]
    ends = knots[0] - min(beyond, knots[1] - knots[0]), knots[-1] + min(beyond, knots[-1] - knots[-2])
    outside = np.zeros((2, *pieces.coefficients.shape[1:]))
    for order in range(2):
        outside[:, order] = pieces.derivative(np.array(ends), order)
    first = pieces.between(ends[0], knots[1]).coefficients[:1]
    inside = np.concatenate([first, pieces.coefficients[1:]])
    # the straight piece before the beginning counts from where it takes over, too
    outside[0, 0] -= outside[0, 1] * beyond
    return PiecewisePolynomial(
        np.concatenate([[ends[0] - beyond, ends[0]], knots[1:-1], [ends[1], ends[1] + beyond]]),
        np.concatenate([outside[:1], inside, outside[1:]]),
    )


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve over a parameter u. derivatives(u (k,)) -> (3, k, d): place, first and second derivative;
    breaks: values of u, both ends included, between which it is smooth.
    """

    derivatives: Callable[[Array], Any]
    breaks: Array


def line(start: Array, stop: Array) -> PiecewisePolynomial:
    """The straight line between two places, one piece."""
    length = float(np.linalg.norm(stop - start))
    coefficients = np.zeros((1, 6, len(start)))
    coefficients[0, 0], coefficients[0, 1] = start, (stop - start) / length
    return PiecewisePolynomial(np.array([0.0, length]), coefficients)


def by_length(curve: Curve, accuracy: float, name: str) -> PiecewisePolynomial:
    """A curve as pieces over its length, nowhere further from it than `accuracy` in m. ModelError for kinks."""
    spans = [(a, b, 0) for a, b in zip(curve.breaks[-2::-1], curve.breaks[:0:-1], strict=True)]
    lengths, coefficients = [0.0], []
    while spans:
        a, b, depth = spans.pop()
        length, piece, error = _piece(curve, a, b, name)
        if error <= min(accuracy, RELATIVE * length):
            lengths.append(length)
            coefficients.append(piece)
        elif depth == DEPTH:
            place = curve.derivatives(np.array([a]))[0, 0]
            raise ModelError(
                f"{name}: found a corner, a jump or a cusp at {a:.6g}, near {words(place)}, expected a curve with "
                "continuous tangent and curvature; give its smooth parts apart, or points to Path.polyline(blend=...)"
            )
        else:
            middle = (a + b) / 2
            spans += [(middle, b, depth + 1), (a, middle, depth + 1)]
    return PiecewisePolynomial(np.cumsum(lengths), np.array(coefficients))


def _piece(curve: Curve, a: float, b: float, name: str) -> tuple[float, Array, float]:
    """Length, coefficients and error in m of the quintic for one span."""
    edges = np.linspace(a, b, INNER + 1)
    width = (b - a) / INNER
    inside = (edges[:-1, None] + width * (GAUSS[0] + 1) / 2).ravel()
    place, first, second = curve.derivatives(np.concatenate([edges, inside]))
    speed = np.linalg.norm(first, axis=1)
    if not (np.all(np.isfinite(place)) and np.all(np.isfinite(second)) and np.all(speed > 0.0)):
        bad = np.concatenate([edges, inside])[~(np.isfinite(place + second).all(axis=1) & (speed > 0.0))][0]
        raise ModelError(
            f"{name}: at {bad:.6g} the place or a derivative is not finite, or the curve stands still, expected a "
            "curve that always moves on; choose another range or parameter"
        )
    parts = width / 2 * speed[INNER + 1 :].reshape(INNER, -1) @ GAUSS[1]
    along = np.concatenate([[0.0], np.cumsum(parts)])
    length = along[-1]
    ends = []
    for k in (0, INNER):
        tangent = first[k] / speed[k]
        bend = (second[k] - tangent * (tangent @ second[k])) / speed[k] ** 2
        ends += [place[k], tangent * length, bend * length**2]
    powers = HERMITE @ np.array(ends)
    found = np.polynomial.polynomial.polyval(along / length, powers).T
    error = float(np.max(np.linalg.norm(found - place[: INNER + 1], axis=1)))
    return length, powers / length ** np.arange(6.0)[:, None], error


def spline(points: Array, start: Array | None, end: Array | None, closed: bool) -> Curve:
    """The cubic spline through points over their chord lengths; start, end: unit vectors, or None for natural ends."""
    from scipy import interpolate

    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(chords)])
    free = (2, np.zeros(points.shape[1]))
    kind: Any = (free if start is None else (1, start), free if end is None else (1, end))
    found = interpolate.CubicSpline(u, points, bc_type="periodic" if closed else kind)
    return Curve(lambda at: np.array([found(at, k) for k in range(3)]), u)


def rounded(
    arcs: Sequence[PiecewisePolynomial], blend: float, accuracy: float, name: str
) -> tuple[PiecewisePolynomial, list[float], list[float]]:
    """Arcs joined by quintics that cut the corners between them, no further from them than `blend` in m.

    Also where the middle of each rounding is and how far it is from the corner, in m.
    """
    room = [arc.knots[-1] / (2 if 0 < k < len(arcs) - 1 else 1) for k, arc in enumerate(arcs)]
    cuts = [_cut(a, b, blend, min(room[k], room[k + 1])) for k, (a, b) in enumerate(pairwise(arcs))]
    parts, places, gaps, length = [], [], [], 0.0
    for k, arc in enumerate(arcs):
        begin = cuts[k - 1][0] if k else 0.0
        stop = arc.knots[-1] - (cuts[k][0] if k < len(cuts) else 0.0)
        if stop - begin > 1e-9 * arc.knots[-1]:
            parts.append(arc.between(begin, stop))
            length += stop - begin
        if k < len(cuts):
            parts.append(by_length(cuts[k][1], accuracy, name))
            places.append(float(length + parts[-1].knots[-1] / 2))
            gaps.append(cuts[k][2])
            length += parts[-1].knots[-1]
    return joined(parts), places, gaps


def _cut(
    before: PiecewisePolynomial, after: PiecewisePolynomial, blend: float, room: float
) -> tuple[float, Curve, float]:
    """How much of two arcs a rounding of their corner replaces, the rounding, its distance from the corner, in m."""
    corner = after.derivative(np.array([0.0]))[0]

    def at(cut: float) -> tuple[Curve, float]:
        curve = _rounding(before, after, cut)
        return curve, float(
            np.min(np.linalg.norm(curve.derivatives(np.linspace(0, 1, 201))[0] - corner, axis=1))
        )

    low, high = 0.0, room
    if at(room)[1] > blend:
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if at(middle)[1] < blend else (low, middle)
        high = low
    return high, *at(high)


def _rounding(before: PiecewisePolynomial, after: PiecewisePolynomial, cut: float) -> Curve:
    """The quintic from `cut` before a corner to `cut` behind it, with the tangents and curvatures there."""
    # between straight lines this speed puts the two inner control points into the corner: evenly rising curvature
    speed = 2.5 * cut
    s = np.array([before.knots[-1] - cut]), np.array([cut])
    ends = [
        arc.derivative(x, k)[0] * speed**k
        for arc, x in zip((before, after), s, strict=True)
        for k in range(3)
    ]
    powers = HERMITE @ np.array(ends)
    rows = [np.polynomial.polynomial.polyder(powers, k) for k in range(3)]
    return Curve(
        lambda u: np.array([np.polynomial.polynomial.polyval(u, row).T for row in rows]), np.array([0.0, 1.0])
    )


def nearest(pieces: PiecewisePolynomial, points: Array, near: Array | None = None) -> Array:
    """The length in m at which a path is nearest to each of the points (n, d); `near`: where to look."""
    from scipy.spatial import KDTree

    length = pieces.knots[-1]
    if near is None:
        samples = np.linspace(0.0, length, max(500, 20 * len(pieces.knots)))
        near = samples[KDTree(pieces.derivative(samples)).query(points)[1]]
    found = np.array(near, dtype=float)
    for _ in range(4):
        away = points - pieces.derivative(found)
        found = np.clip(found + np.sum(away * pieces.derivative(found, 1), axis=1), 0.0, length)
    return found
