"""Where along a motion a margin passes zero: in which step, and when in it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.simulation.events.margins import SwitchMargins
from gantrytau.simulation.singular_poses import Point

DEEP = 0.5  # of the lower end: a dip between two places that may reach below that is looked at
MOST = 100  # steps to one crossing
HALVINGS = 50  # of a share of an interval: to rounding
BEFORE = 1e-8  # of an interval: a first step ends before a crossing, so that a short one is left
JUST_BEHIND = 16  # times rounding: near enough behind the crossing


@dataclass(frozen=True)
class Crossing:
    """Behind which place something is below zero, about when, s, and whether it is below at the next place."""

    place: int
    guess: float
    certain: bool


def first_crossing(t: np.ndarray, gaps: SwitchMargins) -> Crossing | None:
    """The first step between places t (n,) in s in which a gap falls below zero, or may dip below it."""
    h = np.diff(t)[:, None]
    g0, g1 = gaps.values[:-1], gaps.values[1:]
    below = gaps.below[1:]
    # the cubic through values and rates at both ends: g0 + b s + c s^2 + d s^3
    b, e = h * gaps.rates[:-1], h * gaps.rates[1:]
    c, d = 3 * (g1 - g0) - 2 * b - e, 2 * (g0 - g1) + b + e
    with np.errstate(divide="ignore", invalid="ignore"):
        s = -b / (c + np.sqrt(np.maximum(c**2 - 3 * b * d, 0.0)))
        lowest = g0 + s * (b + s * (c + s * d))
    lower = np.minimum(g0, g1)
    dips = (b < 0) & (e > 0) & (lowest < DEEP * lower) & (lower > 4 * gaps.noise[1:])
    dips &= h > 64 * np.spacing(np.abs(t[1:]))[:, None]
    rows = np.flatnonzero((below | dips).any(axis=1))
    if not rows.size:
        return None
    k = int(rows[0])
    found = [_zero(*(float(part[k, i]) for part in (g0, b, c, d))) for i in np.flatnonzero(below[k])]
    if found:
        return Crossing(k, float(t[k] + min(found) * h[k, 0]), True)
    return Crossing(k, float(t[k] + np.min(s[k, dips[k]]) * h[k, 0]), False)


def _zero(a: float, b: float, c: float, d: float) -> float:
    """The first zero of a falling cubic between 0, where it is not below zero but for rounding, and 1, where it is."""
    low, high = 0.0, 1.0
    root = c * c - 3 * b * d
    if root > 0 and c + np.sqrt(root) != 0:  # the minimum
        lowest = -b / (c + np.sqrt(root))
        high = lowest if 0 < lowest < 1 and a + lowest * (b + lowest * (c + lowest * d)) < 0 else high
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if a + middle * (b + middle * (c + middle * d)) < 0 else (middle, high)
    return high


def located(
    low: Point,
    high: Point,
    guess: float,
    step: Callable[[Point, float], Point],
    look: Callable[[Point], SwitchMargins],
) -> Point | None:
    """The point just behind the first crossing after `low`, up to `high`, which lies behind it; None if no step leads there.

    step: the point some seconds later, RuntimeError or SolveError where there is none. Newton steps on the gaps,
    each from the last point before the crossing, so that what is left to go is found to the rounding of time.
    """
    end = high[2]  # up to which steps lead
    guess -= BEFORE * (end - low[2])
    width = end - low[2]
    for count in range(MOST):
        least = 4 * np.spacing(max(abs(low[2]), abs(end)))
        if end - low[2] <= least:
            break
        if not low[2] + least / 4 < guess < end or (count % 4 == 3 and end - low[2] > width / 8):
            guess = (low[2] + end) / 2
        width = end - low[2] if count % 4 == 3 else width
        try:
            there = step(low, guess - low[2])
        except (RuntimeError, SolveError):
            end = guess
            continue
        gaps = look(there)
        left = gaps.values[0] + gaps.noise[0]
        falling = gaps.rates[0] < 0
        if np.any(left < 0):
            high, end = there, guess
            crossed = left < 0
            near = left >= -JUST_BEHIND * gaps.noise[0] - least * np.abs(gaps.rates[0])
            if np.all(near[crossed]):
                return high
            falling &= crossed
        else:
            low = there
        with np.errstate(divide="ignore", invalid="ignore"):
            waits = np.where(falling, (left + gaps.noise[0]) / -gaps.rates[0], np.inf)
        guess = there[2] + float(np.min(waits, initial=np.inf))
    return high if end == high[2] else None


def at_zero(margins: SwitchMargins, t: float, whole: np.ndarray) -> np.ndarray:
    """Which margins of a place are where they turn, as well as that is located, (switches,)."""
    rest = np.abs(margins.values - whole)[0]
    return rest <= 2 * JUST_BEHIND * margins.noise[0] + 8 * np.spacing(abs(t)) * np.abs(margins.rates[0])


def location_errors(before: SwitchMargins, after: SwitchMargins, t: float, whole: np.ndarray) -> np.ndarray:
    """How far from zero margins are that were located as zero before a jump and took no part in it, (switches,)."""
    same = np.abs(after.values - before.values)[0] <= after.noise[0]
    rest = np.abs(before.values - whole)[0]
    return np.where(at_zero(before, t, whole) & same, 1.1 * rest, 0.0)
