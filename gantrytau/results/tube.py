"""The tube around a trajectory in which the reference must stay."""

import itertools

import numpy as np
from numpy.typing import ArrayLike

RELATIVE = 0.002  # of a signal's range, and of the time of the run
PULSE = (
    1e-6  # of the time of the run: what lasts shorter is the width that an integrator gives to one instant
)
ABSOLUTE = 1e-6  # of the largest value, or of the nominal value if that is larger: noise of both integrators


def leaves(
    time: np.ndarray,
    values: np.ndarray,
    reference_time: np.ndarray,
    reference: np.ndarray,
    nominal: float = 1.0,
    *,
    relative: float = RELATIVE,
    absolute: float = ABSOLUTE,
    wide: ArrayLike | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The times at which the reference is outside of the tube around the values, and its distance from them there.

    The tube is the union of the rectangles around all points of the trajectory, the straight lines between its points
    and the jumps at its double times included. Half heights: the share `relative` of the reference's range, and
    `absolute` of its largest value or of `nominal` if that is larger; half width: `wide`, s, a number or one for each time
    of the reference, by default 0.2 % of the run's time. The distance is infinite where the trajectory has ended or is NaN.
    Pulses of the reference that last less than a millionth of the run, such as a flag between the release of a brake and
    the first motion, have no width in exact arithmetic: they may be outside.
    """
    finite = np.isfinite(reference)
    high = relative * np.ptp(reference[finite]) if finite.any() else 0.0
    high += absolute * max(float(np.abs(reference[finite]).max(initial=0.0)), nominal)
    half = RELATIVE * (reference_time[-1] - reference_time[0]) if wide is None else wide
    begin, end = reference_time - half, reference_time + half
    lowest, highest = _extremes(time, values, begin, end)
    distance = np.maximum(np.maximum(lowest - reference, reference - highest), 0.0)
    distance[np.isnan(distance) | (begin > time[-1]) | (end < time[0])] = np.inf
    inside = (distance <= high) | ~finite
    outside = ~(inside | _pulses(reference_time, inside))
    return reference_time[outside], distance[outside]


def _pulses(time: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Which points are of a pulse: outside of the tube, between two points inside that are an instant apart."""
    change = np.flatnonzero(np.diff(inside.astype(int)))  # last points before a change
    found = np.zeros_like(inside)
    for first, last in itertools.pairwise(change):
        if not inside[first + 1] and time[last + 1] - time[first] <= PULSE * (time[-1] - time[0]):
            found[first + 1 : last + 1] = True
    return found


def _extremes(
    time: np.ndarray, values: np.ndarray, begin: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest value of a piecewise linear trajectory in each of the spans of time."""
    edges = np.array([_at(time, values, begin), _at(time, values, end)])
    first = np.searchsorted(time, begin, side="left")
    last = np.searchsorted(time, end, side="right")
    spans = np.column_stack([first, np.maximum(last, first)]).ravel()
    found = []
    for reduced, neutral in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        within = reduced.reduceat(np.append(values, neutral), np.minimum(spans, values.size))[::2]
        within = np.where(last > first, within, neutral)
        found.append(reduced(within, reduced(edges[0], edges[1])))
    return found[0], found[1]


def _at(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values on the straight lines between points, held before the first and behind the last."""
    left = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 1)
    right = np.minimum(left + 1, time.size - 1)
    step = time[right] - time[left]
    share = np.clip((at - time[left]) / np.where(step > 0, step, 1.0), 0.0, 1.0)
    return values[left] + share * (values[right] - values[left])
