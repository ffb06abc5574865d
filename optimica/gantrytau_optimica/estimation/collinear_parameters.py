"""Which parameters the data can tell apart: the rank of the slopes of the residuals, and its reason in words.

Slopes are taken per relative change of each parameter and normed column by column. A vanishing singular value means a
combined change that no sample notices; where it keeps a ratio, a product, a sum or a difference at two different
points, only that is determined. Golub, Van Loan (2013), Matrix Computations, section 5.5.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr

DOUBTFUL = 1e-5  # of the largest singular value of normed columns: below it parameters may not be told apart
ROUNDING = 1e-11  # of it, what rounding leaves of a value that is zero
NEARLY = 1e-7  # the same, where the words for what is silent are looked for
CONFIRMED = 0.5  # of what a combined change moves on a mesh, by which a finer one may differ
SILENT = 1e-10  # of the measured values: a parameter that moves them less, when doubled, has no influence
EXPONENTS = {1.0: "", 2.0: "^2", 3.0: "^3", 4.0: "^4", 1.5: "^(3/2)"}  # of simple laws
SURE = 1e-3  # how closely a ratio of changes is to be a simple number


@dataclass(frozen=True, eq=False)
class LocalSlopes:
    """Slopes of the residuals (N, k) with respect to parameters, and their values (k,), at one point; N >= k."""

    jacobian: np.ndarray
    values: np.ndarray

    def of(self, some: Sequence[int]) -> "LocalSlopes":
        """Those of some parameters."""
        return LocalSlopes(self.jacobian[:, some], self.values[some])


def without_influence(point: LocalSlopes, sizes: np.ndarray) -> list[int]:
    """Numbers of the parameters that no residual depends on; residuals by the size of what was measured."""
    moved = np.linalg.norm(point.jacobian * sizes, axis=0)
    return np.flatnonzero(moved <= SILENT * max(1.0, np.max(moved, initial=0.0))).tolist()


@dataclass(frozen=True, eq=False)
class Silence:
    """Combined changes (k, d) of the parameters by their sizes that no residual notices; resolved: whether that is sure."""

    changes: np.ndarray
    resolved: bool


def silent_directions(
    point: LocalSlopes, sizes: np.ndarray, finer: LocalSlopes | None = None, rounding: float = ROUNDING
) -> Silence:
    """What no residual notices; finer: slopes on a finer mesh, which differ where the mesh is too coarse to tell;
    rounding: without it, what counts as zero.

    A small singular value is one of rounding, and its vector silent, if the finer mesh does not confirm what it moves.
    """
    slopes = point.jacobian * sizes
    norms = np.linalg.norm(slopes, axis=0)
    norms = np.where(norms > 0, norms, 1.0)
    slopes = slopes / norms
    _, singular, right = np.linalg.svd(slopes, full_matrices=False)
    null, resolved = [], True
    for value, vector in zip(singular, right, strict=True):
        if value > DOUBTFUL * singular[0]:
            continue
        if finer is None:
            silent = value <= rounding * singular[0]
        else:
            moved, again = slopes @ vector, (finer.jacobian * sizes / norms) @ vector
            silent = np.linalg.norm(again - moved) > CONFIRMED * value
            resolved = resolved and not (silent and np.linalg.norm(again) > ROUNDING * singular[0])
            silent = silent or value <= np.finfo(float).eps * singular[0]
        if silent:
            null.append(vector)
    return Silence(np.array(null).reshape(len(null), sizes.size).T / norms[:, None], resolved)


def _sparse_changes(point: LocalSlopes, sizes: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Combined changes (k, d) that span the same as `null`, relative to `sizes`, each with as few parameters as possible."""
    if not null.shape[1]:
        return null
    norms = np.linalg.norm(point.jacobian * sizes, axis=0)
    null = null * norms[:, None]
    found: Any = qr(null.T, pivoting=True, mode="r")
    pivots = found[1][: null.shape[1]]
    null = null @ np.linalg.inv(null[pivots])
    null[np.abs(null) < 1e-5] = 0.0
    changes = null / norms[:, None]
    return changes / np.max(np.abs(changes), axis=0)


def indistinguishable(
    names: Sequence[str],
    point: LocalSlopes,
    sizes: np.ndarray,
    finer: LocalSlopes | None,
    elsewhere: Callable[[], LocalSlopes | None],
) -> list[str]:
    """A sentence for each group that cannot be told apart; [] if all can. elsewhere: slopes at another point."""
    changes = _sparse_changes(point, sizes, silent_directions(point, sizes, finer).changes)
    if not changes.shape[1]:
        return []
    other = elsewhere()
    again = None
    if other is not None:
        null = silent_directions(other, sizes, rounding=NEARLY).changes
        again = _sparse_changes(other, sizes, null)
    if again is not None and again.shape != changes.shape:
        again = None
    found = []
    for d in range(changes.shape[1]):
        mine = np.flatnonzero(changes[:, d]).tolist()
        pairs = [(changes[:, d] * sizes, point.values)]
        if other is not None and again is not None:
            pairs.append((again[:, _same(again, mine, d)] * sizes, other.values))
        found.append(_sentence([names[i] for i in mine], [(c[mine], v[mine]) for c, v in pairs]))
    return found


def _same(changes: np.ndarray, mine: list[int], otherwise: int) -> int:
    """The change that concerns the same parameters."""
    for d in range(changes.shape[1]):
        if np.flatnonzero(changes[:, d]).tolist() == mine:
            return d
    return otherwise


def _sentence(names: list[str], points: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """points: changes and values of these parameters at one or two points."""
    together = f"{', '.join(names[:-1])} and {names[-1]} cannot be told apart by these data"
    if len(names) == 2:
        only = _pair(names, points)
        if only:
            return f"{together}: only {only} is determined"
    change, value = points[0]
    relative = np.asarray(change) / np.where(value == 0.0, 1.0, value)
    relative = relative / max(relative.tolist(), key=abs)
    if len(points) == 2 and np.allclose(relative, 1.0, atol=SURE):
        return f"{together}: they are determined up to a common factor only"
    steps = ", ".join(f"{n} by {r:+.3g} %" for n, r in zip(names, relative, strict=True))
    return f"{together}: changing {steps} changes nothing"


def _pair(names: list[str], points: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """The ratio, product, difference or sum of two that is determined; "" if it is none of these."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.array([(c / v)[1] / (c / v)[0] for c, v in points])  # d ln b / d ln a
        absolute = np.array([c[1] / c[0] for c, _ in points])
        a, b = names
        if np.all(np.abs(relative) < 1 - SURE):  # so that the exponent is not below one
            a, b, relative = b, a, 1 / relative
    for power, text in EXPONENTS.items():
        for sign, word in ((1, "/"), (-1, "*")):
            if np.all(np.abs(relative - sign * power) < SURE):
                return f"{b} {word} {a}{text}" if text else f"{names[0]} {word} {names[1]}"
    if np.all(np.abs(absolute - 1) < SURE):
        return f"{names[0]} - {names[1]}"
    return f"{names[0]} + {names[1]}" if np.all(np.abs(absolute + 1) < SURE) else ""
