"""How often each equation has to be differentiated, and the differentiated equations.

The signature method (Pryce, BIT 41, 2001) on integers: it asks for the same differentiations as
Pantelides' algorithm (SIAM J. Sci. Stat. Comput. 9, 1988) and also gives the stages in which
consistent values are found: positions, then velocities, then accelerations and forces.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.aliases import Reduced
from gantrytau.errors import StructureError
from gantrytau.matching import best_matching, largest_matching
from gantrytau.symbols import derivative_name, split_derivative

Key = tuple[int, int]  # equation, times differentiated


@dataclass(frozen=True, eq=False)
class Indexed:
    """The equations with all their derivatives that are needed.

    residuals: by (equation, times differentiated); counts: how often each equation is differentiated;
    orders: highest derivative of each unknown, by name; structural_index as Pryce defines it.
    """

    residuals: Mapping[Key, ca.SX]
    counts: tuple[int, ...]
    orders: Mapping[str, int]

    @property
    def structural_index(self) -> int:
        """Differentiation index of the equations as their structure shows it."""
        algebraic = any(order == 0 for order in self.orders.values())
        return max(self.counts, default=0) + int(algebraic)

    def unknown_symbols(self) -> list[str]:
        """Every unknown with all its derivatives up to the highest, by name."""
        return [derivative_name(n, k) for n, top in self.orders.items() for k in range(top + 1)]


def reduce_index(reduced: Reduced, hints: Mapping[str, str], title: str) -> Indexed:
    """Differentiate what must be differentiated; StructureError if equations and unknowns do not match."""
    signature = _signature(reduced)
    if len(reduced.residuals) != len(reduced.unknowns):
        raise StructureError(unbalanced(reduced, signature, hints, title))
    counts, tops = _offsets(reduced, signature, hints, title)
    residuals = _differentiated(reduced, counts)
    orders = dict(zip(reduced.unknowns, (int(t) for t in tops), strict=True))
    return Indexed(residuals, tuple(int(c) for c in counts), orders)


def _signature(reduced: Reduced) -> list[dict[int, int]]:
    """For each equation the highest derivative of each unknown in it."""
    place = {name: j for j, name in enumerate(reduced.unknowns)}
    rows: list[dict[int, int]] = []
    for residual in reduced.residuals:
        row: dict[int, int] = {}
        for leaf in ca.symvar(residual):
            name, order = split_derivative(leaf.name())
            if name in place:
                row[place[name]] = max(order, row.get(place[name], 0))
        rows.append(row)
    return rows


def _offsets(reduced: Reduced, signature: list[dict[int, int]], hints: Mapping[str, str], title: str):
    n = len(signature)
    matched = best_matching(signature)
    if matched is None:
        raise StructureError(unbalanced(reduced, signature, hints, title))
    counts = np.zeros(n, dtype=int)
    while True:
        tops = np.zeros(n, dtype=int)
        for i, row in enumerate(signature):
            for j, order in row.items():
                tops[j] = max(tops[j], order + counts[i])
        new = np.array([tops[j] - signature[i][j] for i, j in enumerate(matched)], dtype=int)
        if np.array_equal(new, counts):
            return counts, tops
        counts = new


def _differentiated(reduced: Reduced, counts) -> dict[Key, ca.SX]:
    residuals: dict[Key, ca.SX] = {(i, 0): r for i, r in enumerate(reduced.residuals)}
    chains = reduced.chains
    for level in range(1, max(counts, default=0) + 1):
        rows = [i for i, count in enumerate(counts) if count >= level]
        vector = ca.vertcat(*(residuals[i, level - 1] for i in rows))
        inside, rates = [], []
        for leaf in ca.symvar(vector):
            name, order = split_derivative(leaf.name())
            if leaf.name() == "time":
                inside.append(leaf)
                rates.append(ca.SX(1))
            elif name in reduced.aliases:
                inside.append(leaf)
                rates.append(chains.sx(name, order + 1))
        new = ca.jtimes(vector, ca.vertcat(*inside), ca.vertcat(*rates))
        residuals.update({(i, level): r for i, r in zip(rows, ca.densify(new).elements(), strict=True)})
    return residuals


def unbalanced(
    reduced: Reduced, signature: list[dict[int, int]], hints: Mapping[str, str], title: str
) -> str:
    """Which unknowns stay undetermined and which equations are one too many, in the model's words."""
    m, n = len(signature), len(reduced.unknowns)
    of_row = largest_matching(signature, n)
    of_column = {int(j): i for i, j in enumerate(of_row) if j >= 0}
    text = f"{title}: {n} unknowns, {m} equations."
    free = [j for j in range(n) if j not in of_column]
    if free:
        reached = _reach_columns(free, signature, of_column)
        names = [reduced.unknowns[j] for j in sorted(reached, key=lambda j: (j not in free, j))]
        first = names[0]
        why = f" ({hints[first]})" if first in hints else ""
        others = f"; one of it and {', '.join(names[1:6])} is free" if len(names) > 1 else ""
        text += (
            f" Undetermined: {first}{why}{others}. Add {len(free)} equation{'s' if len(free) > 1 else ''} for it in "
            f"{first.rpartition('.')[0] or 'the model'}, declare it an Input, or connect a component that determines it."
        )
    extra = [i for i in range(m) if of_row[i] < 0]
    if extra:
        reached = _reach_rows(extra, signature, of_row)
        where = "; ".join(
            f"{reduced.equations[i].name}: {reduced.equations[i].text[:100]}" for i in sorted(reached)[:4]
        )
        text += (
            f" Overdetermined by {len(extra)}: these equations contradict or repeat each other: {where}. "
            "Remove one of them, or name one more unknown."
        )
    return text


def _reach_columns(
    start: list[int], signature: list[dict[int, int]], of_column: Mapping[int, int]
) -> set[int]:
    row_of = {i: j for j, i in of_column.items()}
    reached, queue = set(start), list(start)
    for j in queue:
        for i, row in enumerate(signature):
            if j in row and i in row_of and row_of[i] not in reached:
                reached.add(row_of[i])
                queue.append(row_of[i])
    return reached


def _reach_rows(start: list[int], signature: list[dict[int, int]], of_row) -> set[int]:
    row_of = {int(j): i for i, j in enumerate(of_row) if j >= 0}
    reached, queue = set(start), list(start)
    for i in queue:
        for j in signature[i]:
            if j in row_of and row_of[j] not in reached:
                reached.add(row_of[j])
                queue.append(row_of[j])
    return reached
