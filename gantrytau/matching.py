"""Pairing of equations with unknowns, and the order in which they can be solved."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching, min_weight_full_bipartite_matching


def best_matching(signature: Sequence[Mapping[int, int]]) -> list[int] | None:
    """For each row its column in the pairing of all rows and columns with the largest sum, or None.

    signature: per row a mapping from column to weight (>= 0).
    """
    n = len(signature)
    if n == 0:
        return []
    if any(not row for row in signature):
        return None
    top = 1 + max(weight for row in signature for weight in row.values())
    entries = [(i, j, top - weight) for i, row in enumerate(signature) for j, weight in row.items()]
    rows, columns, costs = (np.array(x) for x in zip(*entries, strict=True))
    try:
        order, found = min_weight_full_bipartite_matching(csr_array((costs, (rows, columns)), shape=(n, n)))
    except ValueError:
        return None
    matched = [0] * n
    for i, j in zip(order, found, strict=True):
        matched[int(i)] = int(j)
    return matched


def largest_matching(rows: Sequence[Iterable[int]], width: int) -> list[int]:
    """For each row the column it is paired with in a largest pairing, or -1."""
    pairs = [(i, j) for i, row in enumerate(rows) for j in row]
    if not pairs:
        return [-1] * len(rows)
    i, j = (np.array(x) for x in zip(*pairs, strict=True))
    matrix = csr_array((np.ones(len(pairs)), (i, j)), shape=(len(rows), width))
    return [int(x) for x in maximum_bipartite_matching(matrix, perm_type="column")]


def strong_components(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components, each after those it points to (Tarjan, SIAM J. Comput. 1, 1972)."""
    index = [-1] * len(successors)
    low = [0] * len(successors)
    on_stack = [False] * len(successors)
    stack: list[int] = []
    found: list[list[int]] = []
    counter = 0
    for start in range(len(successors)):
        if index[start] >= 0:
            continue
        work = [(start, iter(successors[start]))]
        index[start] = low[start] = counter
        counter += 1
        stack.append(start)
        on_stack[start] = True
        while work:
            node, rest = work[-1]
            for other in rest:
                if index[other] < 0:
                    index[other] = low[other] = counter
                    counter += 1
                    stack.append(other)
                    on_stack[other] = True
                    work.append((other, iter(successors[other])))
                    break
                if on_stack[other]:
                    low[node] = min(low[node], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    component: list[int] = []
                    while not component or component[-1] != node:
                        component.append(stack.pop())
                        on_stack[component[-1]] = False
                    found.append(component[::-1])
    return found
