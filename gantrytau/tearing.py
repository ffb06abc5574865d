"""Tearing: a few unknowns of a block are guessed, the others follow one after the other.

Elmqvist and Otter, ESM 1994. The unknown to tear is the one after which most others follow at once.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

RELAXED_PIVOT = 0.1  # smallest pivot relative to its row that a linear block accepts


@dataclass(frozen=True)
class Torn:
    """assignments: (equation, unknown) in order; tears: unknowns; residuals: equations; all as positions."""

    assignments: tuple[tuple[int, int], ...]
    tears: tuple[int, ...]
    residuals: tuple[int, ...]


def tear(jacobian: ca.SX, numbers: np.ndarray, x: ca.SX, *, relaxed: bool) -> Torn:
    """Tear a square block with the given symbolic Jacobian and its numbers at a sample point.

    relaxed: accept pivots that are not constant but large at the sample point (linear blocks only).
    """
    rows, columns = jacobian.sparsity().get_triplet()
    incidence: dict[int, set[int]] = {i: set() for i in range(jacobian.shape[0])}
    solvable: set[tuple[int, int]] = set()
    for i, j, entry in zip(rows, columns, jacobian.nonzeros(), strict=True):
        incidence[i].add(j)
        if entry.is_constant() and float(entry) != 0.0:
            large = abs(numbers[i, j]) >= 1e-6 * np.abs(numbers[i]).max()
        elif relaxed or not ca.depends_on(entry, x):
            large = abs(numbers[i, j]) >= RELAXED_PIVOT * np.abs(numbers[i]).max() > 0
        else:
            large = False
        if large:
            solvable.add((i, j))
    return _search(incidence, solvable)


def _search(incidence: dict[int, set[int]], solvable: set[tuple[int, int]]) -> Torn:
    holders: dict[int, list[int]] = {}
    for i, row in incidence.items():
        for j in row:
            holders.setdefault(j, []).append(i)
    open_rows = {i: set(row) for i, row in incidence.items()}
    assignments, tears = _follow(open_rows, holders, solvable, []), []
    while any(open_rows.values()):
        candidates = sorted({j for row in open_rows.values() for j in row})
        best = max(candidates, key=lambda j: (_gain(open_rows, holders, solvable, j), len(holders[j])))
        tears.append(best)
        for i in holders[best]:
            if i in open_rows:
                open_rows[i].discard(best)
        assignments += _follow(open_rows, holders, solvable, [best])
    return Torn(tuple(assignments), tuple(tears), tuple(sorted(open_rows)))


def _gain(open_rows, holders, solvable, candidate: int) -> int:
    rows = {i: set(row) for i, row in open_rows.items()}
    for i in holders[candidate]:
        if i in rows:
            rows[i].discard(candidate)
    return len(_follow(rows, holders, solvable, [candidate]))


def _follow(open_rows, holders, solvable, changed: list[int]) -> list[tuple[int, int]]:
    """Solve every equation in which one unknown is left, until none is; `open_rows` shrinks."""
    found: list[tuple[int, int]] = []
    queue = [i for j in changed for i in holders[j] if i in open_rows] if changed else list(open_rows)
    for i in queue:
        if i not in open_rows or len(open_rows[i]) != 1:
            continue
        (j,) = open_rows[i]
        if (i, j) not in solvable:
            continue
        del open_rows[i]
        found.append((i, j))
        for other in holders[j]:
            if other in open_rows:
                open_rows[other].discard(j)
                queue.append(other)
    return found
