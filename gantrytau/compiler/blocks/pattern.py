"""Block lower triangular form: which unknowns are solved together, and in what order.

Given equations, unknowns and wanted names, finds the part that the equations determine
(Dulmage and Mendelsohn) and orders it into blocks that are as small as possible.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.matching import largest_matching, strong_components


@dataclass(frozen=True, eq=False)
class Pattern:
    """Ordered blocks, each (equations, unknowns), and what is left over.

    undetermined: wanted names that the equations do not determine; surplus: equations without an unknown.
    """

    blocks: tuple[tuple[tuple[Key, ...], tuple[str, ...]], ...]
    undetermined: tuple[str, ...]
    surplus: tuple[Key, ...]


def block_pattern(
    residuals: Mapping[Key, ca.SX], unknowns: Iterable[str], wanted: Iterable[str] | None = None
) -> Pattern:
    """The blocks that determine `wanted` (None: all unknowns), in the order of their solution."""
    keys = list(residuals)
    names = list(unknowns)
    place = {name: j for j, name in enumerate(names)}
    rows = [[place[s.name()] for s in ca.symvar(residuals[k]) if s.name() in place] for k in keys]
    of_row = largest_matching(rows, len(names))
    of_column = {j: i for i, j in enumerate(of_row) if j >= 0}
    free = _free_columns(rows, of_row, len(names))
    determined = [i for i, j in enumerate(of_row) if j >= 0 and j not in free]
    index = {i: k for k, i in enumerate(determined)}
    successors = [
        [index[of_column[j]] for j in rows[i] if of_column.get(j) in index and of_column[j] != i]
        for i in determined
    ]
    components = strong_components(successors)
    targets = names if wanted is None else [n for n in wanted if n in place]
    undetermined = tuple(n for n in targets if place[n] in free or place[n] not in of_column)
    needed = _needed(
        components, successors, [index[of_column[place[n]]] for n in targets if n not in undetermined]
    )
    blocks = []
    for component in components:
        if component[0] in needed:
            equations = [determined[k] for k in component]
            equations.sort()
            blocks.append((tuple(keys[i] for i in equations), tuple(names[of_row[i]] for i in equations)))
    surplus = tuple(keys[i] for i, j in enumerate(of_row) if j < 0)
    return Pattern(tuple(blocks), undetermined, surplus)


def _free_columns(rows: Sequence[Sequence[int]], of_row: Sequence[int], width: int) -> set[int]:
    """Unknowns that an alternating path joins to an unmatched unknown."""
    matched = {j for j in of_row if j >= 0}
    rows_of: list[list[int]] = [[] for _ in range(width)]
    for i, row in enumerate(rows):
        for j in row:
            rows_of[j].append(i)
    queue = [j for j in range(width) if j not in matched]
    free = set(queue)
    for j in queue:
        for i in rows_of[j]:
            if of_row[i] >= 0 and of_row[i] not in free:
                free.add(of_row[i])
                queue.append(of_row[i])
    return free


def _needed(components: list[list[int]], successors: Sequence[Sequence[int]], targets: list[int]) -> set[int]:
    needed = set(targets)
    queue = list(needed)
    component_of = {k: component for component in components for k in component}
    for k in queue:
        for other in (*component_of[k], *successors[k]):
            if other not in needed:
                needed.add(other)
                queue.append(other)
    return needed
