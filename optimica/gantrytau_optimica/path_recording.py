"""Recordings of a motion, with noise and pauses, smoothed to a spline of few pieces.

Dressler (2012), chapter 8: a robot is led by hand, and what was recorded becomes a path. Points are ordered by where they
are along the path, not by time: fitted, measured along the fit, fitted again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from gantrytau import ModelError
from gantrytau_optimica.path_fitting import Array, Curve, Pieces, by_length, nearest
from gantrytau_optimica.path_points import SHARP


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A recording as a path; noise: standard deviation of a coordinate in m; far: which point is the furthest off."""

    pieces: Pieces
    largest: float
    rms: float
    far: int
    noise: float


FEWEST = 8  # points of a recording
MOST_SPANS = 80  # of the spline through a recording
PATIENCE = 8  # spans more without a better score, after which the best is taken
PASSES = 4  # of fitting and measuring along the fitted path


def noise_of(points: Array) -> float:
    """Standard deviation of the noise of a coordinate, from third differences, whose median corners do not move."""
    third = np.abs(np.diff(points, n=3, axis=0))
    return float(np.sqrt(np.mean((np.median(third, axis=0) / 0.6745) ** 2) / 20))


def thinned(points: Array, step: float) -> NDArray[np.int64]:
    """Rows of a recording that are at least `step` apart, so that pauses and jitter leave one point."""
    kept = [0]
    for row in range(1, len(points)):
        if np.linalg.norm(points[row] - points[kept[-1]]) >= step:
            kept.append(row)
    return np.array(kept)


def smoothed(points: Array, tolerance: float | None, accuracy: float, name: str) -> Smoothed:
    """The spline of degree 5 with few spans near a recording (n, d).

    With a tolerance the fewest spans that keep every point that near; without, the number that generalised
    cross-validation finds best, n RSS / (n - p)^2 with p coefficients (Craven and Wahba, 1979).
    """
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    noise = noise_of(points)
    rows = thinned(points, float(np.clip(6 * noise, 1e-3 * extent, 0.05 * extent)))
    along = _first_lengths(points, rows)
    # the first pass follows lengths that the noise falsifies: it only has to lead close enough
    pieces, fits = Pieces(np.zeros(0), np.zeros(0)), True
    for _ in range(PASSES):
        found, fits = _fit(points, along, tolerance)
        pieces = by_length(found, accuracy, name)
        total = along.max()
        along = nearest(pieces, points, along * pieces.knots[-1] / total)
    distance = np.linalg.norm(points - pieces.derivative(nearest(pieces, points)), axis=1)
    far = int(np.argmax(distance))
    if tolerance is not None and not (fits and distance[far] <= tolerance):
        best = smoothed(points, None, accuracy, name)
        raise ModelError(
            f"{name}: tolerance={tolerance:g} m is too small for this recording, whose noise is about {noise:.2g} m: "
            f"found no spline of at most {MOST_SPANS} spans that near; expected at least {best.largest:.3g} m, which "
            "tolerance=None reaches, as it chooses by the noise"
        )
    return Smoothed(pieces, float(distance[far]), float(np.sqrt(np.mean(distance**2))), far, noise)


def _first_lengths(points: Array, rows: NDArray[np.int64]) -> Array:
    """Length along the thinned recording of every point, projected onto its chord, (n,)."""
    kept = points[rows]
    chords = np.diff(kept, axis=0)
    sizes = np.linalg.norm(chords, axis=1)
    starts = np.concatenate([[0.0], np.cumsum(sizes)])
    chord = np.clip(np.searchsorted(rows, np.arange(len(points)), side="right") - 1, 0, len(chords) - 1)
    share = np.sum((points - kept[chord]) * chords[chord], axis=1) / sizes[chord] ** 2
    return starts[chord] + np.clip(share, 0.0, 1.0) * sizes[chord]


def _fit(points: Array, along: Array, tolerance: float | None) -> tuple[Curve, bool]:
    """A least-squares spline over the given lengths, and whether it is as near as asked."""
    order = np.argsort(along, kind="stable")
    u, wanted = along[order] - along.min(), points[order]
    breaks, best = np.array([0.0, u[-1]]), (np.inf, np.array([0.0, u[-1]]))
    while True:
        off = wanted - _least_squares(u, wanted, breaks)(u)
        size = len(breaks) + 4
        score = float(np.sum(off**2)) * len(u) / max(len(u) - size, 1) ** 2
        near = tolerance is not None and float(np.max(np.linalg.norm(off, axis=1))) <= tolerance
        if near or (tolerance is None and score < best[0]):
            best = (score, breaks)
        split = _split(u, off, breaks, tolerance is not None)
        patience = tolerance is None and size > len(best[1]) + 4 + PATIENCE
        if near or patience or split is None or len(breaks) > MOST_SPANS:
            breaks = best[1] if near or tolerance is None else breaks
            return _curve(_least_squares(u, wanted, breaks), breaks), near or tolerance is None
        breaks = split


def _curve(spline: interpolate.BSpline, breaks: Array) -> Curve:
    slopes = [spline, spline.derivative(1), spline.derivative(2)]
    return Curve(lambda u: np.array([slope(u) for slope in slopes]), breaks)


def _least_squares(u: Array, points: Array, breaks: Array) -> interpolate.BSpline:
    knots = np.concatenate([[breaks[0]] * 5, breaks, [breaks[-1]] * 5])
    return interpolate.make_lsq_spline(u, points, knots, k=5)


def _split(u: Array, off: Array, breaks: Array, furthest: bool) -> Array | None:
    """The breaks with the worst span halved, or None where no span has points enough.

    The worst has the furthest point, or the most of what neighbours are off in common: noise has nothing in common.
    """
    span = np.clip(np.searchsorted(breaks, u, side="right") - 1, 0, len(breaks) - 2)
    if furthest:
        score = np.zeros(len(breaks) - 1)
        np.maximum.at(score, span, np.linalg.norm(off, axis=1))
    else:
        score = np.bincount(span[1:], np.sum(off[1:] * off[:-1], axis=1), minlength=len(breaks) - 1)
    middles = (breaks[1:] + breaks[:-1]) / 2
    # the normal equations need different points in every span
    different = np.unique(u)
    left = np.searchsorted(different, middles) - np.searchsorted(different, breaks[:-1])
    right = np.searchsorted(different, breaks[1:]) - np.searchsorted(different, middles)
    score = np.where(np.minimum(left, right) >= 6, score, -np.inf)
    worst = int(np.argmax(score))
    return np.insert(breaks, worst + 1, middles[worst]) if np.isfinite(score[worst]) else None


def corner_rows(points: Array, noise: float) -> list[tuple[int, float]]:
    """Rows of a recording at which it turns sharply, and by how much, in rad; seen at twenty times its noise."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    rows = thinned(points, float(np.clip(20 * noise, 5e-3 * extent, 0.05 * extent)))
    if len(rows) < 7:
        return []
    # directions before and behind three points, as the corner lies between two of them
    ways = points[rows[2:]] - points[rows[:-2]]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    angles = np.arccos(np.clip(np.sum(ways[4:] * ways[:-4], axis=1), -1.0, 1.0))
    around = np.max([np.pad(angles, (shift, 6 - shift)) for shift in range(7)], axis=0)[3:-3]
    sharp = np.flatnonzero((angles > SHARP) & (angles == around))
    return [(int(rows[k + 3]), float(angles[k])) for k in sharp]
