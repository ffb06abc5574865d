"""A branch as far as it goes: where the straight way from the start ends, points that are solved already lead on.

The start of a model stands in one place of its workspace, and a straight way from there may cross a hole of it, such as the
one about the first axis of an arm. So the branch is grown once: places in a box about what is known are led from
the nearest known one, the box is widened until nothing more is reached. Others are led from the nearest of those.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

SAMPLES = 64  # places of a round
FIRST = 1 / 16  # of the largest argument at the start: how far the first round goes
ROUNDS = 30
FILLED = 512  # places within the box, in the end
NEIGHBOURS = 3  # known points from which a place is led, each twice as far in rank, before it is out of reach
MOST = 20000  # known points that are kept


class GrownBranch:
    """A branch about its start (k + n,), `count` = k arguments and n unknowns; known: (k + n, M) of points on it.

    lead: unknowns (n, N) at arguments (k, N), each from a known point (k + n, N); NaN where it does not lead there.
    """

    def __init__(self, start: np.ndarray, count: int, lead: Callable[[np.ndarray, np.ndarray], np.ndarray]):
        self._lead, self._count = lead, count
        self.known = start[:, None]

    def __call__(self, q: np.ndarray, neighbours: int = NEIGHBOURS) -> np.ndarray:
        """Unknowns (n, N) at arguments q (k, N), led from their nearest known points; NaN where none of them leads."""
        found = np.full((len(self.known) - self._count, q.shape[1]), np.nan)
        left, (tree, size) = np.arange(q.shape[1]), self._nearest()
        for neighbour in range(neighbours):
            if not left.size:
                break
            if self.known.shape[1] > size:
                tree, size = self._nearest()
            rank = min(2**neighbour, size)
            near = tree.query((q[:, left] / self._spread[:, None]).T, k=[rank])[1][:, 0]
            y = self._lead(q[:, left], self.known[:, near])
            good = np.isfinite(y).all(axis=0)
            found[:, left[good]] = y[:, good]
            if size < MOST:
                self.known = np.hstack([self.known, np.vstack([q[:, left[good]], y[:, good]])])
            left = left[~good]
        return found

    def _nearest(self) -> tuple[Any, int]:
        """A tree of the known arguments, by which the nearest are found, and how many these are."""
        from scipy.spatial import KDTree

        return KDTree((self.known[: self._count] / self._spread[:, None]).T), self.known.shape[1]

    @property
    def _spread(self) -> np.ndarray:
        """Ranges of the known arguments, (k,), 1 where they are all equal."""
        spread = np.ptp(self.known[: self._count], axis=1)
        return np.where(spread > 0, spread, 1.0)

    def grow(self) -> None:
        """Widens a box about the known arguments until nothing more is reached."""
        random, start = np.random.default_rng(0), np.abs(self.known[: self._count])
        margin = FIRST * (start.max(initial=0.0) or 1.0)
        for _ in range(ROUNDS):
            low, high = self._box
            self(random.uniform(low - margin, high + margin, (SAMPLES, self._count)).T, 1)
            wider = max(np.max(low - self._box[0]), np.max(self._box[1] - high))
            if wider < margin / 4:
                if margin < np.max(high - low):
                    break
                margin /= 4
            else:
                margin *= 2
        low, high = self._box
        self(random.uniform(low, high, (FILLED, self._count)).T, 1)

    @property
    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        known = self.known[: self._count]
        return known.min(axis=1), known.max(axis=1)
