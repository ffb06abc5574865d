"""In which order poses are visited, and on which ways: from home through all of them and back, without a collision.

A short round trip is sought by nearest neighbours and 2-opt (Croes, 1958); ways between successive poses are checked, and
those that collide are replaced by the shortest ways through other safe places. Only ways that are wanted are checked
(Bohlin and Kavraki, 2000): all others count as clear until then.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gantrytau_optimica.procedure.motion_planning.clear_ways import clear_ways
from gantrytau_optimica.procedure.robot_samples import Fleet

NEIGHBOURS = 10  # of each place, to which there may be a way
PLACES = 250  # by which a detour may go, besides the chosen poses
ROUNDS = 8  # of shortening with what has been learned about collisions
DETOUR = 3.0  # times as long a way that collides is taken to be, until its detour is known
LEVER = 0.5  # m that a turntable moves the plate by for 1 rad, to compare with carts


@dataclass(frozen=True, eq=False)
class Tour:
    """A round trip.

    nodes: in their order, home (0) first and last; via: which of them are only passed, (k,); lost: nodes that no clear way
    reaches.
    """

    nodes: np.ndarray
    via: np.ndarray
    lost: np.ndarray


class Roadmap:
    """Places q (N, n), the first of them home, and straight ways between them, checked when they are asked for."""

    def __init__(self, fleet: Fleet, q: np.ndarray, check: Callable[..., np.ndarray] = clear_ways):
        self.q = q
        weights = np.where(np.arange(q.shape[1]) < 3, 1.0, LEVER)
        self._scaled = q * weights
        self._fleet, self._check = fleet, check
        self._known: dict[tuple[int, int], bool] = {}
        self._near = _neighbours(self._scaled, NEIGHBOURS)

    def among(self, q: np.ndarray) -> "Roadmap":
        """A roadmap of other places for the same robots, which knows nothing yet."""
        return Roadmap(self._fleet, q, self._check)

    def length(self, i: int | np.ndarray, j: int | np.ndarray) -> np.ndarray:
        """Of the straight way, in m of the carts."""
        return np.linalg.norm(self._scaled[i] - self._scaled[j], axis=-1)

    def clear(self, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
        """Which of the ways between pairs of places are clear, those not yet known checked together."""
        keys = [(min(pair), max(pair)) for pair in pairs]
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        if new:
            a, b = np.array(new).T
            found = self._check(self._fleet, self.q[a], self.q[b])
            self._known.update(zip(new, map(bool, found), strict=True))
        return np.array([self._known[key] for key in keys], dtype=bool)

    @property
    def known(self) -> dict[tuple[int, int], bool]:
        """The ways that were checked, and whether they are clear."""
        return dict(self._known)

    def learn(self, known: Mapping[tuple[int, int], bool]) -> None:
        """Take over ways that were checked before; pairs in ascending order."""
        self._known.update(known)

    def way(self, i: int, j: int) -> list[int] | None:
        """Places from i to j, both included, on the shortest clear way; None if there is none."""
        from scipy.sparse.csgraph import dijkstra

        while True:
            _, before = dijkstra(self._graph((i, j)), directed=False, indices=i, return_predecessors=True)
            if before[j] < 0:
                return None
            path = [j]
            while path[-1] != i:
                path.append(int(before[path[-1]]))
            path.reverse()
            if self.clear(list(pairwise(path))).all():
                return path

    def connected(self, i: int) -> np.ndarray:
        """Places that may be connected to i as far as is known, (N,)."""
        from scipy.sparse.csgraph import connected_components

        labels = connected_components(self._graph((i, i)), directed=False)[1]
        return labels == labels[i]

    def _graph(self, ends: tuple[int, int]):
        """All ways that are not known to collide, with their lengths."""
        from scipy.sparse import csr_matrix

        keys = self._near | {key for key, clear in self._known.items() if clear}
        if ends[0] != ends[1]:
            keys = keys | {(min(ends), max(ends))}
        left = np.array([key for key in keys if self._known.get(key) is not False]).reshape(-1, 2)
        a, b = left.T
        lengths = np.maximum(self.length(a, b), 1e-9)
        return csr_matrix((lengths, (a, b)), shape=(len(self.q), len(self.q)))


def find_tour(roadmap: Roadmap, wanted: np.ndarray) -> Tour:
    """A round trip from place 0 through the places `wanted` (k,) of a roadmap."""
    stops = np.concatenate([[0], wanted]).astype(int)
    lengths = roadmap.length(stops[:, None], stops[None])
    order = _shortened(_nearest(lengths), lengths)
    for _ in range(ROUNDS):
        pairs = _pairs(stops[order])
        clear = roadmap.clear(pairs)
        if clear.all():
            break
        for (i, j), good in zip(_pairs(order), clear, strict=True):
            if not good and lengths[i, j] <= roadmap.length(stops[i], stops[j]) * (1 + 1e-9):
                lengths[i, j] = lengths[j, i] = DETOUR * lengths[i, j] + 0.1
        order = _shortened(order, lengths)
    return _with_detours(roadmap, stops[order])


def _with_detours(roadmap: Roadmap, order: np.ndarray) -> Tour:
    """The tour with ways through other places where straight ones collide; what cannot be reached is left out."""
    nodes, via, lost = [0], [True], []
    for stop in (*order[1:], 0):
        here = nodes[-1]
        path = [here, stop] if roadmap.clear([(here, stop)])[0] else roadmap.way(here, stop)
        if path is None:
            lost.append(stop)
            continue
        nodes += path[1:]
        via += [True] * (len(path) - 2) + [stop == 0]
    return Tour(np.array(nodes), np.array(via), np.array(lost, dtype=int))


def _pairs(order: np.ndarray) -> list[tuple[int, int]]:
    return [(int(i), int(j)) for i, j in zip(order, np.roll(order, -1), strict=True)]


def _nearest(lengths: np.ndarray) -> np.ndarray:
    """A round trip from 0, always to the nearest stop that is left."""
    order, left = [0], set(range(1, len(lengths)))
    while left:
        order.append(min(left, key=lambda j: (lengths[order[-1], j], j)))
        left.remove(order[-1])
    return np.array(order)


def _shortened(order: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """The round trip with parts of it turned round as long as that makes it shorter."""
    order, count = order.copy(), len(order)
    improved = count > 3
    while improved:
        improved = False
        for i in range(count - 2):
            j = np.arange(i + 2, count)
            following = order[(j + 1) % count]
            change = (
                lengths[order[i], order[j]]
                + lengths[order[i + 1], following]
                - lengths[order[i], order[i + 1]]
                - lengths[order[j], following]
            )
            best = int(np.argmin(change))
            if change[best] < -1e-9:
                order[i + 1 : j[best] + 1] = order[i + 1 : j[best] + 1][::-1].copy()
                improved = True
    return order


def _neighbours(points: np.ndarray, count: int) -> set[tuple[int, int]]:
    """Pairs of places that are near to each other."""
    from scipy.spatial import KDTree

    near = KDTree(points).query(points, k=min(count + 1, len(points)))[1].reshape(len(points), -1)
    return {(min(i, int(j)), max(i, int(j))) for i, row in enumerate(near) for j in row if i != j}


def spread(points: np.ndarray, count: int) -> np.ndarray:
    """Rows of so many points that are far from each other, each the farthest from those before, (count,)."""
    if len(points) <= count:
        return np.arange(len(points))
    rows, away = [0], np.linalg.norm(points - points[0], axis=1)
    while len(rows) < count:
        rows.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(points - points[rows[-1]], axis=1))
    return np.array(rows)
