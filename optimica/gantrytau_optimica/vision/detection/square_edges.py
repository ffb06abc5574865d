"""The twenty edges of five black squares, each measured by itself, and the corners where they meet.

An edge is crossed by profiles. A step of height h at t has the integral (w - t) h over the lower end from -w to w: t is
known from the whole profile, without a threshold, and a line through these is robust. What lens and perspective do to a
pattern is not assumed beyond where to look.
"""

from dataclasses import dataclass, replace

import numpy as np

from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.detection.detections import homography, mapped

Array = np.ndarray
PLACES = np.linspace(-0.28, 0.28, 10)  # of an edge, from its middle: corners blur into others
WIDEST, NARROWEST = 0.38, 3.0  # half a profile: of an edge; pixels
STEP = 0.5  # pixels, between samples of a profile
ENOUGH_PROFILES, ENOUGH_EDGES = 6, 18
STRAY = 3.0  # standard deviations of a profile from its line
WEAK, UNEVEN = 0.4, 0.12  # of the usual contrast: a profile at least; what an edge may be off, besides noise
BENT, APART = 0.5, 1.5  # pixels: scatter about a line besides noise; a corner from the projective map of all
VISIBLE = 1.5  # contrast over noise
ROUNDS = 3
ENOUGH_CORNERS = 12
AWAY, LENS = 4.0, 0.1  # of the usual distance from the projective map; pixels, how far lenses bend a pattern
EXACT = 0.01  # pixels, a floor under what scatter tells


@dataclass(frozen=True, eq=False)
class Edges:
    """Corners (20, 2) in pixels, NaN where one of its edges is missing, and their standard deviations, (20,).

    good: how many edges were measured; contrast: the usual one, in grey values.
    """

    corners: Array
    sigma: Array
    good: int
    contrast: float


def measure_edges(
    grey: Array, H: Array, pattern: Pattern, noise: float, least: float, settled: float = 0.0
) -> Edges | None:
    """The edges of a quincunx near a projective map of it, or None where they are not those of one.

    noise: of the image, and least: the least contrast of an edge, in grey values; settled: pixels, by which corners may
    lie from where they were looked for; if they do so by more, edges are looked for anew, three times at most.
    """
    flat, width = pattern.points[:, :2], None
    found = None
    for _ in range(ROUNDS):
        squares = mapped(H, flat).reshape(5, 4, 2)
        found, width = _measured(grey, squares, width, noise, least)
        if found is None:
            return None
        there = np.isfinite(found.corners[:, 0])
        if found.good < ENOUGH_EDGES - 4 or there.sum() < 8:
            return None
        H = homography(flat[there], found.corners[there])
        if np.linalg.norm(mapped(H, flat[there]) - found.corners[there], axis=1).max() > APART:
            return None
        if np.abs(found.corners[there] - squares.reshape(-1, 2)[there]).max() < settled:
            break
    if found is None or found.good < ENOUGH_EDGES:
        return None
    corners = _without_strays(flat, found.corners)
    if np.isfinite(corners[:, 0]).sum() < ENOUGH_CORNERS:
        return None
    return replace(found, corners=corners, sigma=np.where(np.isfinite(corners[:, 0]), found.sigma, np.nan))


def _without_strays(flat: Array, corners: Array) -> Array:
    """Corners, NaN where something thin beside an edge has moved them from the projective map of the others."""
    corners = corners.copy()
    for _ in range(len(corners) - ENOUGH_CORNERS + 1):
        there = np.flatnonzero(np.isfinite(corners[:, 0]))
        apart = np.linalg.norm(
            mapped(homography(flat[there], corners[there]), flat[there]) - corners[there], axis=1
        )
        worst = int(apart.argmax())
        if apart[worst] <= AWAY * np.median(apart) + LENS:
            break
        corners[there[worst]] = np.nan
    return corners


def _measured(
    grey: Array, squares: Array, width: float | None, noise: float, least: float
) -> tuple[Edges | None, float]:
    """Edges near squares (5, 4, 2), and half the width that profiles need to cover them."""
    begin, end = squares, np.roll(squares, -1, axis=1)
    way = (end - begin).reshape(20, 2)
    length = np.hypot(*way.T)
    if not (length.min() > 4 and length.max() < 4 * length.min()):
        return None, 0.0
    along = way / length[:, None]
    outward = np.column_stack([along[:, 1], -along[:, 0]])  # corners go clockwise, y down
    middle = ((begin + end) / 2).reshape(20, 2)
    half = WIDEST * float(length.min()) if width is None else width
    offsets = np.arange(-half, half + STEP / 2, STEP)
    u = PLACES * length[:, None]
    places = (
        middle[:, None, None]
        + u[..., None, None] * along[:, None, None]
        + offsets[:, None] * outward[:, None, None]
    )
    values = sampled(grey, places)  # (20, 10, offsets)
    ends = max(2, len(offsets) // 5)
    low, high = values[..., :ends].mean(axis=2), values[..., -ends:].mean(axis=2)
    dark, bright = _middle(low), _middle(high)
    contrast = bright - dark
    usual = float(np.median(contrast[np.isfinite(contrast)])) if np.isfinite(contrast).any() else 0.0
    if not usual > max(least, VISIBLE * noise):
        return None, half
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = (values - dark[:, None, None]) / contrast[:, None, None]
        area = STEP * (rise.sum(axis=2) - (rise[..., 0] + rise[..., -1]) / 2)
        t = -(offsets[0] + area) + (offsets[-1] + offsets[0])
    good = (high - low > WEAK * usual) & (np.abs(t) < 0.8 * half) & np.isfinite(t)
    even = np.abs(contrast - usual) < UNEVEN * usual + noise
    good &= even[:, None]
    blur = _blur(rise[even], offsets)
    lines, spread = _lines(u, np.where(good, t, 0.0), good, noise / usual * np.sqrt(2 * half))
    corners, sigma = _meet(middle, along, outward, lines, spread)
    count = int(np.isfinite(spread).sum())
    narrow = min(WIDEST * float(length.min()), max(NARROWEST, 3.2 * blur))
    return Edges(corners, sigma, count, usual), narrow


def _middle(values: Array) -> Array:
    """Mean of each row without its least and greatest two."""
    return np.sort(values, axis=1)[:, 2:-2].mean(axis=1)


def _blur(rise: Array, offsets: Array) -> float:
    """Standard deviation in pixels of the slope of the mean profile."""
    if not len(rise):
        return NARROWEST
    slope = np.clip(np.diff(rise.mean(axis=(0, 1))), 0, None)
    if not slope.max() > 0:
        return NARROWEST
    slope = np.where(slope > 0.1 * slope.max(), slope, 0.0)
    places = (offsets[1:] + offsets[:-1]) / 2
    mean = np.sum(slope * places) / slope.sum()
    return float(np.sqrt(np.sum(slope * (places - mean) ** 2) / slope.sum()))


def _lines(u: Array, t: Array, good: Array, noise: float) -> tuple[Array, Array]:
    """Offset and slope of each edge's line t(u), (20, 2), without strays, and the scatter about it, NaN where it is none."""
    weight = good.astype(float)
    for last in (False, True):
        n = np.maximum(weight.sum(axis=1), 1e-9)
        mu, mt = (weight * u).sum(axis=1) / n, (weight * t).sum(axis=1) / n
        du, dt = u - mu[:, None], t - mt[:, None]
        slope = (weight * du * dt).sum(axis=1) / np.maximum((weight * du * du).sum(axis=1), 1e-9)
        rest = dt - slope[:, None] * du
        scatter = np.sqrt((weight * rest**2).sum(axis=1) / np.maximum(n - 2, 1))
        if not last:
            usual = np.median(np.where(good, np.abs(rest), np.inf), axis=1) / 0.6745
            weight = weight * (np.abs(rest) <= STRAY * np.maximum(usual, 0.02)[:, None])
    count = weight.sum(axis=1)
    fine = (count >= ENOUGH_PROFILES) & (scatter < BENT + 2 * noise)
    return np.column_stack([mt - slope * mu, slope]), np.where(fine, np.maximum(scatter, EXACT), np.nan)


def _meet(middle: Array, along: Array, outward: Array, lines: Array, spread: Array) -> tuple[Array, Array]:
    """Where each edge meets the one before it in its square, (20, 2), and the standard deviation there in pixels."""
    point = middle + lines[:, :1] * outward
    way = along + lines[:, 1:] * outward
    before = np.arange(20).reshape(5, 4)[:, [3, 0, 1, 2]].ravel()
    matrix = np.stack([way, -way[before]], axis=2)
    reach = np.linalg.solve(matrix, (point[before] - point)[..., None])[:, 0, 0]
    corners = point + reach[:, None] * way
    n = len(PLACES)
    variance = spread**2 * (1 / n + (0.5) ** 2 / np.sum(PLACES**2))  # of a line at its ends
    sigma = np.sqrt((variance + variance[before]) / 2)
    corners[~np.isfinite(sigma)] = np.nan
    return corners, sigma


def sampled(grey: Array, places: Array) -> Array:
    """Grey values at places (..., 2) in pixels, linear between pixels; NaN outside of the image."""
    height, width = grey.shape
    x, y = places[..., 0], places[..., 1]
    inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    column = np.clip(np.where(inside, x, 0).astype(int), 0, max(width - 2, 0))
    row = np.clip(np.where(inside, y, 0).astype(int), 0, max(height - 2, 0))
    a, b = x - column, y - row
    flat = grey.ravel()
    first = row * width + column
    upper = flat[first] * (1 - a) + flat[first + 1] * a
    lower = flat[first + width] * (1 - a) + flat[first + width + 1] * a
    return np.where(inside, upper * (1 - b) + lower * b, np.nan)
