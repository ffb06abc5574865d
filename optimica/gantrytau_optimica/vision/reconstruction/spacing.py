"""How far poses lie from one another along the guideways, which is known from the carts and tells the scale."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau.border.refusal import Given

Array = np.ndarray
ALIKE = 1e-4  # m, by which carts of one line may stand otherwise to each other
STD = 2e-5  # m, of a distance along the guideways: encoders of carts (assumed)
FAR = 20.0  # m, above which distances are not those of a robot


@dataclass(frozen=True, eq=False)
class Spacing:
    """Distances along the guideways: x (N,) in m from the start of a line, line (N,) from 0, NaN and -1 where unknown."""

    x: Array
    line: Array

    @property
    def lines(self) -> int:
        """How many lines there are."""
        return int(self.line.max(initial=-1)) + 1

    def select(self, rows: Array) -> "Spacing":
        """Those of some rows; lines of which fewer than two poses are left are left out."""
        x, line = self.x[rows], self.line[rows]
        counts = np.bincount(line[line >= 0], minlength=self.lines)
        kept = (line >= 0) & (counts[line] > 1)
        number = np.cumsum(counts > 1) - 1
        return Spacing(np.where(kept, x, np.nan), np.where(kept, number[line], -1))

    def displaced(self, r: Array) -> Array:
        """How far places (N, 3) move for each metre along the guideways, (3,): 1 long where the scale is right."""
        return self.shares @ r

    @property
    def shares(self) -> Array:
        """What each place adds to `displaced`, (N,) in 1/m."""
        known = self.line >= 0
        line, x = self.line[known], self.x[known]
        x = x - (np.bincount(line, x) / np.bincount(line))[line]
        found = np.zeros(len(self.x))
        found[known] = x / (x @ x)
        return found

    def middles(self, r: Array) -> Array:
        """The means of places (N, 3) of each line, (L, 3)."""
        known = self.line >= 0
        line = self.line[known]
        return np.stack([np.bincount(line, each) for each in r[known].T], axis=1) / np.bincount(line)[:, None]

    def rows(self, r: Array, middles: Array, offsets: Array) -> tuple[Array, Array, Array]:
        """Errors (along . (r - middle) - x - offset) / STD, (N,), and derivatives by place (N, 3) and by offsets (N, L).

        The direction `along` is that in which the places move: as they move along it, it has no part in the derivatives.
        """
        known = self.line >= 0
        moved = self.displaced(r)
        along = moved / np.linalg.norm(moved)
        missed = np.sum((r - middles[self.line]) * along, axis=1) - np.nan_to_num(self.x) - offsets[self.line]
        by_place = np.where(known[:, None], along / STD, 0.0)
        by_line = np.where(known[:, None], -np.eye(len(offsets))[self.line] / STD, 0.0)
        return np.where(known, missed / STD, 0.0), by_place, by_line


def spacing_of(given: Any, count: int) -> Spacing:
    """The spacing of `count` poses from distances along the guideways (N,), or from positions of the carts (N, n).

    Raises ModelError for other shapes, for poses that are all at one place, and for lines of one pose each.
    """
    found = array("reconstruct", "spacing", given, (count,), (count, None), finite=False)
    if not found.size:
        raise ModelError("expected one row for each pose", place="reconstruct", found=Given("spacing", given))
    known = np.isfinite(found).reshape(count, -1).all(axis=1)
    if np.abs(found[known]).max(initial=0.0) > FAR:
        raise ModelError(
            f"found spacing up to {np.abs(found[known]).max():g}, expected distances in m, below {FAR:g}; "
            "divide mm by 1000",
            place="reconstruct",
            argument="spacing",
        )
    line = np.full(count, -1)
    if found.ndim == 1 or found.shape[1] == 1:
        x = found.reshape(count)
        line[known] = 0
    else:
        x = found.mean(axis=1)
        line[known] = _lines((found - x[:, None])[known])
    spacing = Spacing(np.where(known, x, np.nan), line).select(np.arange(count))
    told = spacing.line >= 0
    if not told.any():
        raise ModelError(
            "found no two poses whose carts differ by one common shift, expected lines of poses along the "
            "guideways; move all carts alike, or give ",
            Given("scale", "pattern"),
            place="reconstruct",
            argument="spacing",
        )
    first = np.array([np.ptp(spacing.x[spacing.line == k]) for k in range(spacing.lines)])
    if first.max() < 1e3 * STD:
        raise ModelError(
            f"found poses of a line within {first.max():.3g} m, expected a spacing above {1e3 * STD:g} m; "
            "lengths are in m",
            place="reconstruct",
            argument="spacing",
        )
    return spacing


def _lines(differences: Array) -> Array:
    """Numbers of groups whose rows are alike, (N,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(differences).query_pairs(ALIKE, output_type="ndarray")
    size = len(differences)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (size, size))
    return connected_components(graph, directed=False)[1]
