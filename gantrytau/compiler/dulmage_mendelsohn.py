"""Which equations determine which unknowns, by structure alone: the decomposition of Dulmage and Mendelsohn.

A. L. Dulmage and N. S. Mendelsohn, Canadian J. Math. 10, 1958, as CasADi computes it (Davis, Direct Methods for Sparse
Linear Systems, SIAM 2006, section 7.4).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.language.symbols import Derivative


@dataclass(frozen=True)
class Decomposition:
    """Rows and columns of a pattern, by number, told apart.

    blocks: square ones (rows, columns), as small as possible, in no order; surplus: rows for which no column is left;
    overdetermined: these, and all rows that compete with them; free: columns for which no row is left;
    undetermined: these, and all columns that could be free in their place.
    """

    blocks: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    surplus: tuple[int, ...]
    overdetermined: tuple[int, ...]
    free: tuple[int, ...]
    undetermined: tuple[int, ...]


def signature(incidence: Sequence[Iterable[Derivative]], unknowns: Sequence[str]) -> list[dict[int, int]]:
    """For each equation the highest derivative of each unknown in it, by number."""
    place = {name: j for j, name in enumerate(unknowns)}
    rows: list[dict[int, int]] = []
    for occurring in incidence:
        row: dict[int, int] = {}
        for name, order in occurring:
            if name in place:
                row[place[name]] = max(order, row.get(place[name], 0))
        rows.append(row)
    return rows


def decompose(rows: Sequence[Collection[int]], width: int) -> Decomposition:
    """The decomposition of a pattern: for each row the columns that occur in it, 0 to width - 1."""
    entries = [(i, j) for i, row in enumerate(rows) for j in row]
    sparsity = ca.Sparsity.triplet(len(rows), width, [i for i, _ in entries], [j for _, j in entries])
    count, row_order, column_order, row_starts, column_starts, row_parts, column_parts = sparsity.btf()
    surplus, undetermined = row_order[: row_parts[1]], column_order[column_parts[2] :]
    blocks = []
    for k in range(count):
        own = sorted(set(row_order[row_starts[k] : row_starts[k + 1]]) - set(surplus))
        columns = sorted(column_order[column_starts[k] : column_starts[k + 1]])
        if columns and not set(columns) & set(undetermined):
            blocks.append((tuple(own), tuple(columns)))
    return Decomposition(
        tuple(blocks),
        tuple(sorted(surplus)),
        tuple(sorted(row_order[: row_parts[2]])),
        tuple(sorted(column_order[column_parts[3] :])),
        tuple(sorted(undetermined)),
    )


def largest_sum(weights: Sequence[Mapping[int, int]]) -> list[int] | None:
    """For each row its column in the pairing of all rows and columns with the largest sum, or None if there is none.

    weights: per row a mapping from column to weight (>= 0).
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    size = len(weights)
    entries = [(i, j, weight + 1) for i, row in enumerate(weights) for j, weight in row.items()]
    if not entries:
        return [] if not size else None
    i, j, values = zip(*entries, strict=True)
    try:
        _, columns = min_weight_full_bipartite_matching(
            csr_array((values, (i, j)), shape=(size, size)), maximize=True
        )
    except ValueError:  # there is no pairing of all
        return None
    return columns.tolist()
