"""Tearing: a few unknowns of a block are guessed, the others follow one after the other.

Elmqvist and Otter, ESM 1994. The unknown to tear is the one after which most others follow at once.
"""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pivots import reliable
from gantrytau.language.piecewise import Switched, with_modes
from gantrytau.language.scalar_arithmetic import depending

RELAXED_PIVOT = 0.1  # smallest pivot relative to its row, at all sample points, that is divided by
LEAST_PIVOT = 1e-6  # the same of constants, where otherwise nothing could be divided by


@dataclass(frozen=True)
class Torn:
    """assignments: (equation, unknown) in order; tears: unknowns; residuals: equations; all as positions."""

    assignments: tuple[tuple[int, int], ...]
    tears: tuple[int, ...]
    residuals: tuple[int, ...]


def tear(
    jacobian: ca.SX,
    sizes: np.ndarray,
    x: ca.SX,
    *,
    relaxed: bool,
    partner: Mapping[int, int],
    first: Set[int],
    barred: Set[tuple[int, int]],
) -> Torn:
    """Tear a square block with the given symbolic Jacobian; sizes: of its nonzeros, as `entry_sizes` finds them.

    relaxed: accept pivots that depend on unknowns of the block (linear blocks, where none does);
    partner: by row the only column it may be solved for, or -1, where lower derivatives have decided;
    first: columns that are torn before others; barred: places that are not divided by.
    """
    incidence: dict[int, set[int]] = {i: set() for i in range(jacobian.shape[0])}
    entries = list(zip(*jacobian.sparsity().get_triplet(), jacobian.nonzeros(), sizes.tolist(), strict=True))
    for i, j, *_ in entries:
        incidence[i].add(j)

    def solvable(least: float) -> set[tuple[int, int]]:
        """Places that may be divided by; least: what constants need of their row."""
        found: set[tuple[int, int]] = set()
        for i, j, entry, size in entries:
            if (i, j) in barred:
                large = False
            elif i in partner:
                large = partner[i] == j and size > 0
            elif entry.is_constant():
                large = size >= least
            else:
                large = size >= RELAXED_PIVOT and (relaxed or not ca.depends_on(entry, x))
            if large:
                found.add((i, j))
        return found

    torn = _search(incidence, solvable(RELAXED_PIVOT), first, set(partner.values()))
    return (
        torn if torn.assignments else _search(incidence, solvable(LEAST_PIVOT), first, set(partner.values()))
    )


def entry_sizes(jacobian: ca.SX, entries: np.ndarray) -> np.ndarray:
    """How large the nonzeros of a Jacobian are in their rows at all sample points.

    entries: their numbers, (points, nonzeros).
    """
    rows = np.array(jacobian.sparsity().get_triplet()[0], dtype=int)
    largest = np.zeros((jacobian.shape[0], len(entries)))
    np.maximum.at(largest, rows, np.abs(entries).T)
    return reliable(entries, largest[rows].T)


def switching_places(smooth: Switched, x: ca.SX) -> set[tuple[int, int]]:
    """Places (equation, unknown) where something in an equation switches on the unknown, or the pivot jumps.

    smooth: the equations as one column, with modes.
    """
    if not smooth.switches:
        return set()
    residual, modes = smooth.expressions[0], ca.vertcat(*(s.mode for s in smooth.switches))
    margins = ca.vertcat(*with_modes(smooth, [s.margin for s in smooth.switches]))
    by_unknown = np.array(ca.DM(ca.jacobian_sparsity(margins, x), 1))
    by_mode = np.array(ca.DM(ca.jacobian_sparsity(residual, modes), 1))
    found = {(int(i), int(j)) for i, j in zip(*np.nonzero(by_mode @ by_unknown), strict=True)}
    jacobian = ca.jacobian(residual, x)
    for i, j, slope in zip(*jacobian.sparsity().get_triplet(), jacobian.nonzeros(), strict=True):
        if ca.depends_on(slope, modes):
            found.add((i, j))
    return found


def moving(jacobian: ca.SX, parameters: Collection[str]) -> set[tuple[int, int]]:
    """Places of a Jacobian that do not depend on parameters alone."""
    return places_of(jacobian, [leaf for leaf in ca.symvar(jacobian) if leaf.name() not in parameters])


def places_of(jacobian: ca.SX, leaves: Sequence[ca.SX]) -> set[tuple[int, int]]:
    """Places of a Jacobian that depend on some symbols."""
    rows, columns = jacobian.sparsity().get_triplet()
    places = zip(rows, columns, depending(jacobian.nonzeros(), leaves), strict=True)
    return {(i, j) for i, j, depends in places if depends}


def _search(
    incidence: dict[int, set[int]], solvable: set[tuple[int, int]], first: Set[int], last: Set[int]
) -> Torn:
    """Tear until every equation is solved or left over; columns in these are torn first or last."""
    holders: dict[int, list[int]] = {}
    for i, row in incidence.items():
        for j in row:
            holders.setdefault(j, []).append(i)
    open_rows = {i: set(row) for i, row in incidence.items()}
    assignments, tears = _follow(open_rows, holders, solvable, []), []
    while any(open_rows.values()):
        candidates = set().union(*open_rows.values())
        candidates = sorted(candidates & first or candidates - last or candidates)
        best = max(candidates, key=lambda j: (_gain(open_rows, holders, solvable, j), len(holders[j])))
        tears.append(best)
        for i in holders[best]:
            if i in open_rows:
                open_rows[i].discard(best)
        assignments += _follow(open_rows, holders, solvable, [best])
    return Torn(tuple(assignments), tuple(tears), tuple(sorted(open_rows)))


def _gain(open_rows, holders, solvable, candidate: int) -> int:
    """How many equations can be solved at once when the candidate is torn."""
    known, solved = {candidate}, set()
    counts: dict[int, int] = {}
    queue = [candidate]
    for column in queue:
        for i in holders[column]:
            if i not in open_rows or i in solved or column not in open_rows[i]:
                continue
            counts[i] = counts.get(i, len(open_rows[i])) - 1
            if counts[i] == 1:
                j = next(iter(open_rows[i] - known), None)
                if j is not None and (i, j) in solvable:
                    solved.add(i)
                    known.add(j)
                    queue.append(j)
    return len(solved)


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
