"""Blocks some of whose unknowns keep their values, as the orientation of a plate on parallelograms does.

What they are is seen at points of the branch. The rest is determined by some of the equations, often in parts that do
not know of each other, and is followed by itself: that takes a tenth of the time. As equations are analytic, what keeps its
value on a piece of the branch does so on all of it. Still all equations are asked in the end, and where another Jacobian of
the whole block was singular on the way, or may have been, the whole block is followed. Ways around lead past such poses, as
those in which a plate on parallelograms could begin to turn, and keep what is kept.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.implicit_blocks import SOLVED
from gantrytau.answers.many_points.array_program import ArrayProgram
from gantrytau.answers.many_points.elimination import pivots_in_order
from gantrytau.answers.many_points.followed_branches import SETTLED, FollowedBranch

KEEPS = 1e-11  # of one and its size, by which a value may differ from point to point
FEWEST = 8  # points on the branch from which it is told
LIKE = 0.3  # of a pivot at the start: beyond, others may have vanished on the way, and the whole block is followed
DEPENDS = 1e-9  # of the largest in its row, an element of a Jacobian that is not zero


@dataclass(frozen=True, eq=False)
class ReducedBranch:
    """A block as `whole`, of which `parts` find the unknowns `places`, one after another; the others are `kept`, (n,)."""

    whole: FollowedBranch
    parts: Sequence[FollowedBranch]
    places: Sequence[Sequence[int]]
    kept: np.ndarray

    @property
    def direct(self) -> bool:
        """See `FollowedBranch.direct`."""
        return all(part.direct for part in self.parts)

    def __call__(self, end: np.ndarray) -> np.ndarray:
        """Y (n, N) at `end` (k, N); NaN where the branch does not lead there."""
        y, holds, pivots = self._completed([part(end) for part in self.parts], end)
        with np.errstate(invalid="ignore"):
            sure = holds & (pivots > LIKE).all(axis=0) & (pivots < 1 / LIKE).all(axis=0)
        doubtful = np.flatnonzero(np.isfinite(y[0]) & ~sure)
        if doubtful.size:
            other = self.whole(end[:, doubtful])
            # beside what is kept, other branches have split off
            gaps = np.nan_to_num(other - self.kept[:, None])
            y[:, doubtful] = np.where(np.abs(gaps).max(axis=0) <= SETTLED, other, np.nan)
        return y

    def beside(self, end: np.ndarray, begin: np.ndarray, start: np.ndarray) -> np.ndarray:
        """See `FollowedBranch.beside`."""
        led = zip(self.parts, self.places, strict=True)
        y, holds, _ = self._completed([part.beside(end, begin, start[list(own)]) for part, own in led], end)
        y[:, ~holds] = np.nan
        return y

    def solutions(self, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `FollowedBranch.solutions`; a row of signs for each part."""
        of_parts = [part.solutions(end) for part in self.parts]
        chosen = list(itertools.product(*(range(y.shape[1]) for y, _ in of_parts)))
        take = [[way[k] for way in chosen] for k in range(len(self.parts))]
        parts = [y[:, own] for (y, _), own in zip(of_parts, take, strict=True)]
        y, holds, _ = self._completed(parts, np.repeat(end[:, None], len(chosen), axis=1))
        signs = np.vstack([sign[:, own] for (_, sign), own in zip(of_parts, take, strict=True)])
        return y[:, holds], signs[:, holds]

    def _completed(self, found: Sequence[np.ndarray], end: np.ndarray) -> tuple[np.ndarray, ...]:
        """All unknowns from those of the parts, NaN where one ends; whether equations hold, and pivots as `_judged`."""
        y = np.repeat(self.kept[:, None], end.shape[1], axis=1)
        for part, places in zip(found, self.places, strict=True):
            y[list(places)] = part
        y[:, ~np.isfinite(y).all(axis=0)] = np.nan
        error, pivots = self._judged(y, end)
        return y, error[0] <= SOLVED, pivots

    @cached_property
    def _judged(self) -> ArrayProgram:
        """(y, end) -> the largest residual in sizes of rows; pivots of the Jacobian beside those at the start."""
        y, end = self.whole.residual.sx_in()
        f = ca.densify(self.whole.residual(y, end))
        matrix = ca.jacobian(f, y)
        pivots = pivots_in_order(matrix, self.whole.order)
        first = ca.Function("first", [y, end], [pivots])(ca.DM(self.whole.start), ca.DM(self.whole.begin))
        error = ca.norm_inf(f / ca.DM(self.whole.units[0]))
        return ArrayProgram(ca.Function("judged", [y, end], [error, pivots / first], {"cse": True}))


def reduced(whole: FollowedBranch, y: np.ndarray) -> FollowedBranch | ReducedBranch:
    """A block without what keeps its value in points y (n, N) of its branch; the block itself if that is nothing."""
    y = y[:, np.isfinite(y).all(axis=0)]
    count = len(whole.start)
    if y.shape[1] < FEWEST or count == 1:
        return whole
    middle = np.median(y, axis=1)
    keeps = np.abs(y - middle[:, None]).max(axis=1) <= KEEPS * (1 + np.abs(middle))
    if not keeps.any():
        return whole
    kept = np.where(keeps, _clean(middle), np.nan)
    free = np.flatnonzero(~keeps)
    unknowns, q = whole.residual.sx_in()
    inserted = ca.vertcat(*(unknowns[j] if np.isnan(kept[j]) else ca.SX(kept[j]) for j in range(count)))
    f = ca.densify(whole.residual(inserted, q))
    z = ca.vertcat(*(unknowns[int(j)] for j in free)) if free.size else ca.SX(0, 1)
    jacobian = ca.Function("jacobian", [unknowns, q], [ca.densify(ca.jacobian(f, z))])
    matrix = np.array(jacobian(ca.DM(whole.start), ca.DM(whole.begin)))
    parts, places = [], []
    for rows, columns in _parts(matrix):
        own = ca.vertcat(*(z[j] for j in columns))
        residual = ca.Function("part", [own, q], [ca.vertcat(*(f[i] for i in rows))], {"cse": True})
        chosen = [int(free[j]) for j in columns]
        parts.append(FollowedBranch(residual, whole.start[chosen], whole.begin))
        places.append(chosen)
    if sum(map(len, places)) < free.size:
        return whole
    return ReducedBranch(whole, parts, places, kept)


def _parts(matrix: np.ndarray) -> list[tuple[list[int], list[int]]]:
    """(rows, columns) of a matrix with more rows than columns that do not know of each other; as many rows as columns."""
    from scipy.linalg import qr
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m, n = matrix.shape
    sizes = np.abs(matrix).max(axis=1, keepdims=True, initial=0.0)
    rows, columns = np.nonzero(np.abs(matrix) > DEPENDS * sizes)
    graph = coo_array((np.ones(len(rows)), (rows, m + columns)), shape=(m + n, m + n))
    _, label = connected_components(graph, directed=False)
    found = []
    for part in np.unique(label[m:]):
        own, of = np.flatnonzero(label[m:] == part), np.flatnonzero(label[:m] == part)
        if len(of) < len(own):
            return []
        factors: Any = qr(matrix[np.ix_(of, own)].T, mode="economic", pivoting=True)
        _, pivots, chosen = factors
        if not abs(pivots[len(own) - 1, len(own) - 1]) > DEPENDS * abs(pivots[0, 0]):
            return []
        found.append((sorted(int(i) for i in of[chosen[: len(own)]]), [int(j) for j in own]))
    return found


def _clean(values: np.ndarray) -> np.ndarray:
    """Values without the rounding about whole numbers, so that zeros are seen as such."""
    near = np.round(values)
    return np.where(np.abs(values - near) <= 1e-13, near, values)
