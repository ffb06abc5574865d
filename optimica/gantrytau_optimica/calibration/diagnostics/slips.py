"""Whether an actuator lost its count on the way: a step in what is left of a fit, from one row on.

    e = J dp + s_k d [k >= first]       gain(first) = (h'e)^2 / h'h,   h the column s [k >= first] less its part in J

s is the derivative of the closure errors by the actuator. One step that explains most of the squares is told, if it
explains them much better than smooth functions of the pose do: those are errors of the model, bends of guideways or
directions that were held at wrong values. Rows are taken in the order measured.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from gantrytau_optimica.calibration.diagnostics.link_systems import LinkSystem, freedom, variance

SHARE = 0.5  # of the squares, that a step must explain, or two
DEVIATIONS = 7.0  # of its own, that a step must have
ROWS = 5  # at the least on each side of a step: fewer are outliers
SMOOTHER = 2.0  # times the variance that a step leaves, which smooth functions must leave at the least
FREEDOM = 30  # errors more than numbers; fewer hardly tell a step from noise


@dataclass(frozen=True)
class Slip:
    """first, last: places among the rows, from which on and up to which the actuator is off by `size` (m or rad)."""

    first: int
    last: int
    size: float


def slip(links: LinkSystem, slopes: np.ndarray, smooth: np.ndarray) -> Slip | None:
    """Of links at N poses, by derivatives (N, m) of their errors by the actuator; smooth functions of the pose (N, s)."""
    left, known = links.left.ravel(), links.known
    remaining = left.size - known.shape[1] - 2
    if remaining < FREEDOM:
        return None
    found, rest = _steps(left, known, slopes, remaining)
    if found is None:
        return None
    rival = links.beside(for_each_link(smooth, slopes.shape[1]))
    if freedom([rival]) < FREEDOM or variance([rival]) < SMOOTHER * rest / remaining:
        return None
    return found


def for_each_link(functions: np.ndarray, links: int) -> np.ndarray:
    """Functions (N, s) for each of m links apart, (N, m, m s)."""
    return np.kron(np.eye(links), functions[:, None, :]).reshape(len(functions), links, -1)


def smooth_functions(r: np.ndarray) -> np.ndarray:
    """Polynomials of the third degree in r (N, 3), so (N, 20); not in q, which is where it should not be."""
    x = 2 * (r - r.min(axis=0)) / np.maximum(np.ptp(r, axis=0), 1e-300) - 1
    x = np.column_stack([np.ones(len(x)), x])
    return np.column_stack(
        [x[:, i] * x[:, j] * x[:, k] for i, j, k in combinations_with_replacement(range(4), 3)]
    )


def _steps(
    left: np.ndarray, known: np.ndarray, slopes: np.ndarray, freedom: int
) -> tuple[Slip | None, float]:
    """The step, or two, that explain most of what is left, and the squares that remain."""
    count, whole = len(slopes), float(left @ left)
    first, gain = _step(left, known, slopes)
    column = _column(first, slopes, known)
    size = float(column @ left) / float(column @ column)
    if gain > SHARE * whole and gain > DEVIATIONS**2 * (whole - gain) / freedom:
        return Slip(first, count, size), whole - gain
    known = np.column_stack([known, column / np.linalg.norm(column)])
    second, more = _step(left - size * column, known, slopes)
    left_over = whole - gain - more
    ends = sorted((first, second))
    if gain + more < SHARE * whole or min(gain, more) < DEVIATIONS**2 * left_over / freedom:
        return None, left_over
    if ends[1] - ends[0] < ROWS:
        return None, left_over
    inside = _column(ends[0], slopes, known[:, :-1]) - _column(ends[1], slopes, known[:, :-1])
    return Slip(ends[0], ends[1], float(inside @ left) / float(inside @ inside)), left_over


def _column(first: int, slopes: np.ndarray, known: np.ndarray) -> np.ndarray:
    column = np.where(np.arange(len(slopes))[:, None] >= first, slopes, 0.0).ravel()
    return column - known @ (known.T @ column)


def _step(left: np.ndarray, known: np.ndarray, slopes: np.ndarray) -> tuple[int, float]:
    """Where one step explains most, and how much of the squares."""
    count, links = slopes.shape
    products = (known.reshape(count, links, -1) * slopes[:, :, None]).sum(axis=1)
    inside = np.cumsum(products[::-1], axis=0)[::-1]
    along = np.cumsum((left.reshape(count, links) * slopes).sum(axis=1)[::-1])[::-1]
    length = np.cumsum((slopes**2).sum(axis=1)[::-1])[::-1]
    free = length - (inside**2).sum(axis=1)
    gains = np.where(free > 1e-6 * length[0], along**2 / np.maximum(free, 1e-300), 0.0)
    gains[:ROWS] = gains[max(0, count - ROWS + 1) :] = 0.0
    first = int(np.argmax(gains))
    return first, float(gains[first])
