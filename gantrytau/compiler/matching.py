"""Pairing of equations with unknowns, and the order in which they can be solved."""

from collections.abc import Callable, Iterable, Mapping, Sequence


def best_matching(signature: Sequence[Mapping[int, int]]) -> list[int] | None:
    """For each row its column in the pairing of all rows and columns with the largest sum, or None.

    signature: per row a mapping from column to weight (>= 0). Pantelides' algorithm (SIAM J. Sci. Stat. Comput. 9,
    1988) seen as a primal-dual method: rows and columns carry levels, a row may take a column where weight + level
    of the row reaches the level of the column, and rows that cannot be served are raised together.
    """
    width = len(signature)
    if -1 in largest_matching(signature, width):
        return None
    raised = [0] * width
    level = [0] * width
    for row in signature:
        for column, weight in row.items():
            level[column] = max(level[column], weight)
    of_column = [-1] * width
    of_row = [-1] * width
    for start in range(width):
        while True:
            reached = _augment(
                start,
                lambda i: [j for j, weight in signature[i].items() if weight + raised[i] == level[j]],
                of_row,
                of_column,
            )
            if reached is None:
                break
            rows, columns = reached
            for i in rows:
                raised[i] += 1
            for j in columns:
                level[j] += 1
    return of_row


def largest_matching(rows: Sequence[Iterable[int]], width: int) -> list[int]:
    """For each row the column it is paired with in a largest pairing, or -1; columns are 0 to width - 1."""
    of_row = [-1] * len(rows)
    of_column = [-1] * width
    for i, row in enumerate(rows):  # most rows find a free column at once
        for j in row:
            if of_column[j] < 0:
                of_row[i], of_column[j] = j, i
                break
    for i, j in enumerate(of_row):
        if j < 0:
            _augment(i, rows.__getitem__, of_row, of_column)
    return of_row


def _augment(
    start: int, choices: Callable[[int], Iterable[int]], of_row: list[int], of_column: list[int]
) -> tuple[list[int], list[int]] | None:
    """Pair row `start` by shifting others along a path; else the rows and columns that were reached."""
    came_from: dict[int, int] = {}  # column -> row from which it was reached
    queue = [start]
    for i in queue:
        for j in choices(i):
            if j in came_from:
                continue
            came_from[j] = i
            if of_column[j] >= 0:
                queue.append(of_column[j])
                continue
            while True:  # shift along the path back to the start
                row = came_from[j]
                before = of_row[row]
                of_row[row], of_column[j] = j, row
                if row == start:
                    return None
                j = before
    return queue, list(came_from)


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
