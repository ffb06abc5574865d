"""Start values that follow from single equations, one after the other; the structure alone decides on the order."""

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from gantrytau.compiler.start.level import Level
from gantrytau.compiler.symbol_spaces import called, column
from gantrytau.language.scalar_arithmetic import depending

LEAST_SLOPE = 1e-3  # of the largest derivative of an equation, below which it gives no value
LINEAR = 1e-9  # of an equation, what may be left of it where it is linear


def propagated(level: Level, point: np.ndarray, missing: set[int]) -> np.ndarray:
    """Missing start values, computed from the known ones as far as single equations determine them.

    point: numbers of the leaves; missing: places of those without a start.
    """
    inside = np.flatnonzero(np.isin(level.entries[1], list(missing)))
    known, rounds = level.kept(("order", frozenset(missing)), lambda: _order(level, inside, missing))
    curved = known.copy()
    straight = _Straight(level, point, inside)
    while True:
        found, used = point.copy(), np.zeros(len(curved), dtype=bool)
        for unknowns, equations in rounds:
            bent = curved[equations]
            if not np.all(bent):
                straight.solve(found, unknowns[~bent], equations[~bent], used)
            if np.any(bent):
                _solve_curved(level, found, unknowns[bent], equations[bent])
        # no leaf of an equation changes after it was used: it holds if it is as straight as its slopes say
        left = np.abs(level.look(found)[0]) if np.any(used) else straight.f
        wrong = used & ~(left <= LINEAR * np.maximum(1.0, np.abs(straight.f)))
        if not np.any(wrong):
            return found
        curved |= wrong


def _order(
    level: Level, inside: np.ndarray, missing: set[int]
) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """The equations that are not linear in missing values, and the rounds in which equations give missing values."""
    x, _, jacobian = level.symbolic
    rows, columns = (side[inside] for side in level.entries)
    entries, leaves = jacobian.nonzeros(), x.elements()
    moves = depending([entries[k] for k in inside], [leaves[j] for j in missing])
    curved = np.zeros(len(level.residuals), dtype=bool)
    curved[rows[np.array(moves, dtype=bool)]] = True
    return curved, list(_rounds(rows.tolist(), columns.tolist()))


class _Rows:
    """Entries of a matrix by their rows."""

    def __init__(self, rows: np.ndarray, columns: np.ndarray, count: int):
        self._order, self._columns = np.argsort(rows, kind="stable"), columns
        self._ends = np.searchsorted(rows[self._order], np.arange(count + 1))

    def of(self, rows: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The entries of some rows, where each row begins among these, and where the one in its own column is."""
        first, last = self._ends[rows], self._ends[rows + 1]
        begin = np.cumsum(last - first) - (last - first)
        held = self._order[np.arange(np.sum(last - first)) + np.repeat(first - begin, last - first)]
        return held, begin, np.flatnonzero(self._columns[held] == np.repeat(own, last - first))


class _Straight:
    """Equations linear in the missing values, as numbers at one point; inside: the derivatives by the missing values."""

    def __init__(self, level: Level, point: np.ndarray, inside: np.ndarray):
        self.f, slopes = level.look(point)
        rows, self._columns = (side[inside] for side in level.entries)
        self._rows, self._slopes = _Rows(rows, self._columns, len(self.f)), slopes[inside]
        self._point = point

    def solve(self, found: np.ndarray, unknowns: np.ndarray, equations: np.ndarray, used: np.ndarray) -> None:
        """Solve some equations for one unknown each, write these into the numbers, and tell which equations succeeded."""
        held, begin, own = self._rows.of(equations, unknowns)
        slopes, columns = self._slopes[held], self._columns[held]
        with np.errstate(invalid="ignore", over="ignore"):
            f = self.f[equations] + np.add.reduceat(slopes * (found - self._point)[columns], begin)
        given = _given(f, slopes, begin, own)
        found[unknowns[given]] -= f[given] / slopes[own][given]
        used[equations[given]] = True


def _solve_curved(level: Level, found: np.ndarray, unknowns: np.ndarray, equations: np.ndarray) -> None:
    """Solve some equations for one unknown each and write these into the numbers, where an equation is linear in it."""
    held, begin, own = _Rows(*level.entries, len(level.residuals)).of(equations, unknowns)

    def made() -> ca.Function:
        x, residual, jacobian = level.symbolic
        residuals, entries = residual.elements(), jacobian.nonzeros()
        return ca.Function(
            "round", [x], [column([residuals[i] for i in equations]), column([entries[k] for k in held])]
        )

    function = level.kept(("round", *equations.tolist()), made)
    f, slopes = called(function, found)
    given, old = _given(f, slopes, begin, own), found[unknowns]
    found[unknowns[given]] -= f[given] / slopes[own][given]
    if np.any(found[unknowns] != old):
        after, _ = called(function, found)
        wrong = ~(np.abs(after) <= LINEAR * np.maximum(1.0, np.abs(f)))
        found[unknowns[wrong]] = old[wrong]


def _given(f: np.ndarray, slopes: np.ndarray, begin: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Which equations may be divided by their own slope."""
    largest = np.maximum.reduceat(np.nan_to_num(np.abs(slopes)), begin)
    return np.isfinite(f) & (np.abs(slopes[own]) > LEAST_SLOPE * largest) & (largest > 0)


def _rounds(rows: Sequence[int], columns: Sequence[int]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs of a leaf and an equation for it, by rounds: in its round an equation lacks that leaf only.

    rows, columns: of the entries by missing leaves. Where no equation is left with a single one, the leaf in most equations
    stays as it is: the coordinate of a joint is in several, each with another unknown.
    """
    left: dict[int, set[int]] = {}
    holders: dict[int, list[int]] = {}
    for i, j in zip(rows, columns, strict=True):
        left.setdefault(i, set()).add(j)
        holders.setdefault(j, []).append(i)
    first = {i: k for k, i in enumerate(left)}
    most = iter(sorted(holders, key=lambda j: (-len(holders[j]), j)))
    single = [i for i, missing in left.items() if len(missing) == 1]
    while left:
        # of several equations for one leaf the last counts
        pairs = {next(iter(left[i])): i for i in sorted(single, key=lambda i: first[i])}
        known = list(pairs)
        if pairs:
            yield np.array(known), np.array(list(pairs.values()))
        else:
            known = [next(j for j in most if any(j in left.get(i, ()) for i in holders[j]))]
        touched = dict.fromkeys(i for j in known for i in holders[j] if i in left)
        for j in known:
            for i in holders[j]:
                if i in left:
                    left[i].discard(j)
        single = [i for i in touched if len(left[i]) == 1]
        for i in touched:
            if not left[i]:
                del left[i]
