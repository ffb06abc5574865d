"""Recordings of a motion, with noise and pauses, smoothed to a spline of few pieces.

Dressler (2012), chapter 8: a robot is led by hand, and what was recorded becomes a path. Points are ordered by where they
are along the path, not by time: fitted, measured along the fit, fitted again.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gantrytau import ModelError
from gantrytau_optimica.paths.fitting import Array, Curve, PiecewisePolynomial, by_length, nearest
from gantrytau_optimica.paths.points import SHARP

if TYPE_CHECKING:
    from scipy import interpolate

FEWEST = 8  # points of a recording
MOST_SPANS = 300  # of the spline through a recording
PATIENCE = 12  # spans more without a better score, after which the best is taken
MANY = 4000  # points that are fitted: of longer recordings, means of as many neighbours as that leaves
PASSES = 4  # of fitting and measuring along the fitted path
STILL = 20.0  # extent over noise below which nothing but noise was recorded
FINEST = 15.0  # length of a span over noise: finer ones would draw the noise of a pause
STRAY = 12.0  # times the noise: the distance from points before and after, beyond which one is left out


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A recording as a path; what is said of it: see Deviation. left_out: rows that were not followed."""

    pieces: PiecewisePolynomial
    largest: float
    rms: float
    row: int
    noise: float
    left_out: tuple[int, ...]


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


def strays(points: Array, noise: float) -> NDArray[np.int64]:
    """Rows of single points that are far from the median of the points around them, as where a sensor failed."""
    padded = np.pad(points, ((3, 3), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, 7, axis=0)
    away = np.linalg.norm(points - np.median(around, axis=2), axis=1)
    step = np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))
    # a quick part of a recording has long steps, but all of its points are about one step from the median
    usual = np.median(
        np.lib.stride_tricks.sliding_window_view(np.pad(away, 3, mode="edge"), 7, axis=0), axis=1
    )
    return np.flatnonzero(away > STRAY * max(noise, 1e-12) + 3 * step + 6 * usual)


def smoothed(points: Array, tolerance: float | None, accuracy: float, name: str) -> Smoothed:
    """The spline of degree 5 with few spans near a recording (n, d).

    With a tolerance few spans that keep every point that near; without, the number that generalised cross-validation
    finds best, n RSS / (n - p)^2 with p coefficients (Craven and Wahba, 1979).
    """
    noise = noise_of(points)
    left_out = strays(points, noise)
    kept = _means(np.delete(points, left_out, axis=0))
    extent = float(np.linalg.norm(np.ptp(kept, axis=0)))
    if extent <= STILL * noise:
        raise ModelError(
            f"{name}: all points lie within {extent:.3g} m, with a noise of about {noise:.2g} m, expected a way that is "
            "long against the noise; record a motion"
        )
    along = _first_lengths(kept, thinned(kept, float(np.clip(6 * noise, 1e-3 * extent, 0.05 * extent))))
    finest = max(FINEST * noise, 1e-3 * extent)
    pieces, fits = PiecewisePolynomial(np.zeros(0), np.zeros(0)), True
    # the first pass follows lengths that the noise falsifies: it only has to lead close enough
    for _ in range(PASSES):
        found, fits = _fit(kept, along, tolerance, finest)
        pieces = by_length(found, accuracy, name)
        along = nearest(pieces, kept, along * pieces.knots[-1] / along.max())
    distance = np.linalg.norm(points - pieces.derivative(nearest(pieces, points)), axis=1)
    row = int(np.argmax(np.where(np.isin(np.arange(len(points)), left_out), 0.0, distance)))
    followed = np.delete(distance, left_out)
    if tolerance is not None and not (fits and distance[row] <= tolerance):
        best = smoothed(points, None, accuracy, name)
        raise ModelError(
            f"{name}: tolerance={tolerance:g} m is too small for this recording, whose noise is about {noise:.2g} m: "
            f"no spline of moderate size is that near; expected at least {best.largest:.3g} m, which tolerance=None "
            "reaches, as it chooses by the noise"
        )
    rms = float(np.sqrt(np.mean(followed**2)))
    return Smoothed(pieces, float(distance[row]), rms, row, noise, tuple(left_out.tolist()))


def _means(points: Array) -> Array:
    """The mean of every so many successive points."""
    every = -(-len(points) // MANY)
    begins = np.arange(0, len(points), every)
    return np.add.reduceat(points, begins, axis=0) / np.diff(np.append(begins, len(points)))[:, None]


def _first_lengths(points: Array, rows: NDArray[np.int64]) -> Array:
    """Length along the thinned recording of every point, projected onto its chord, (n,)."""
    kept = points[rows]
    chords = np.diff(kept, axis=0)
    sizes = np.linalg.norm(chords, axis=1)
    starts = np.concatenate([[0.0], np.cumsum(sizes)])
    chord = np.clip(np.searchsorted(rows, np.arange(len(points)), side="right") - 1, 0, len(chords) - 1)
    share = np.sum((points - kept[chord]) * chords[chord], axis=1) / sizes[chord] ** 2
    return starts[chord] + np.clip(share, 0.0, 1.0) * sizes[chord]


def _fit(points: Array, along: Array, tolerance: float | None, finest: float) -> tuple[Curve, bool]:
    """A least-squares spline over the given lengths, with no span below `finest`, and whether it is as near as asked."""
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
        impatient = tolerance is None and len(breaks) > len(best[1]) + PATIENCE + len(best[1]) // 4
        split = (
            None
            if near or impatient or len(breaks) > MOST_SPANS
            else _split(u, off, breaks, tolerance, finest)
        )
        if split is None:
            breaks = best[1] if near or tolerance is None else breaks
            return _curve(_least_squares(u, wanted, breaks), breaks), near or tolerance is None
        breaks = split


def _curve(spline: "interpolate.BSpline", breaks: Array) -> Curve:
    slopes = [spline, spline.derivative(1), spline.derivative(2)]
    return Curve(lambda u: np.array([slope(u) for slope in slopes]), breaks)


def _least_squares(u: Array, points: Array, breaks: Array) -> "interpolate.BSpline":
    from scipy import interpolate

    knots = np.concatenate([[breaks[0]] * 5, breaks, [breaks[-1]] * 5])
    return interpolate.make_lsq_spline(u, points, knots, k=5)


def _split(u: Array, off: Array, breaks: Array, tolerance: float | None, finest: float) -> Array | None:
    """The breaks with the worst spans halved, or None where none is long and full enough.

    The worst have the furthest points, or the most of what neighbours are off in common: noise has nothing in common.
    """
    count = len(breaks) - 1
    span = np.clip(np.searchsorted(breaks, u, side="right") - 1, 0, count - 1)
    if tolerance is None:
        score = np.bincount(span[1:], np.sum(off[1:] * off[:-1], axis=1), minlength=count)
    else:
        score = np.zeros(count)
        np.maximum.at(score, span, np.linalg.norm(off, axis=1))
    middles = (breaks[1:] + breaks[:-1]) / 2
    # the normal equations need different points in every span
    different = np.unique(u)
    places = [np.searchsorted(different, at) for at in (breaks[:-1], middles, breaks[1:])]
    possible = (np.minimum(places[1] - places[0], places[2] - places[1]) >= 3) & (
        np.diff(breaks) >= 2 * finest
    )
    score = np.where(possible, score, -np.inf)
    worst = np.flatnonzero(possible & (score >= 0.5 * score.max()))
    worst = (
        worst[np.argsort(-score[worst])][: 1 + count // 10] if worst.size else np.flatnonzero(possible)[:1]
    )
    return np.sort(np.append(breaks, middles[worst])) if worst.size else None


def corner_rows(points: Array, noise: float) -> list[tuple[int, float]]:
    """Rows of a recording at which it turns sharply, and by how much, in rad; seen at twenty times its noise."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    rows = thinned(points, max(20 * noise, 5e-3 * extent))
    if len(rows) < 7 or 20 * noise > 0.05 * extent:
        return []
    # directions before and behind three points, as the corner lies between two of them
    ways = points[rows[2:]] - points[rows[:-2]]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    angles = np.arccos(np.clip(np.sum(ways[4:] * ways[:-4], axis=1), -1.0, 1.0))
    around = np.max([np.pad(angles, (shift, 6 - shift)) for shift in range(7)], axis=0)[3:-3]
    sharp = np.flatnonzero((angles > SHARP) & (angles == around))
    return [(int(rows[k + 3]), float(angles[k])) for k in sharp]
