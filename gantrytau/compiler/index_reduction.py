"""How often each equation has to be differentiated, and the differentiated equations.

The signature method (Pryce, BIT 41, 2001) on integers: it asks for the same differentiations as
Pantelides' algorithm (SIAM J. Sci. Stat. Comput. 9, 1988) and also gives the stages in which
consistent values are found: positions, then velocities, then accelerations and forces.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.dulmage_mendelsohn import largest_sum, signature
from gantrytau.compiler.refusals import unbalanced
from gantrytau.compiler.start.level import Level, joined
from gantrytau.compiler.symbol_spaces import column
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.declarations import StateSelect
from gantrytau.language.symbols import Derivative, derivative_name, derivatives_in, split_derivative

Key = tuple[int, int]  # equation, times differentiated


@dataclass(frozen=True, eq=False)
class Indexed:
    """The equations with all their derivatives that are needed.

    residuals: by (equation, times differentiated); names: of the equations; counts: how often each
    equation is differentiated; orders: highest derivative of each unknown, by name; exact: names of parameters and of
    what is known; plain: incidence of the equations that are not differentiated; structural_index as Pryce defines it.
    """

    residuals: Mapping[Key, ca.SX]
    names: tuple[str, ...]
    counts: tuple[int, ...]
    orders: Mapping[str, int]
    exact: frozenset[str] = frozenset()
    plain: tuple[tuple[Derivative, ...], ...] = ()

    @cached_property
    def incidence(self) -> Mapping[Key, tuple[Derivative, ...]]:
        """Which derivatives of which variables stand in each equation."""
        known = {(i, 0): row for i, row in enumerate(self.plain)}
        return {k: known[k] if k in known else derivatives_in(r) for k, r in self.residuals.items()}

    def symbols(self, known: Collection[str]) -> list[str]:
        """Unknowns with their derivatives, and the known variables with the derivatives that occur."""
        names = dict.fromkeys((*self.unknown_symbols(), *known))
        leaves = dict.fromkeys(x for row in self.incidence.values() for x in row)
        names.update(dict.fromkeys(x.name for x in leaves if x.root in known))
        return list(names)

    @property
    def structural_index(self) -> int:
        """Differentiation index of the equations as their structure shows it."""
        algebraic = any(order == 0 for order in self.orders.values())
        return max(self.counts, default=0) + int(algebraic)

    @cached_property
    def levels(self) -> tuple[Level, ...]:
        """Positions, velocities, accelerations and forces: the equations and unknowns of each level."""
        found: list[Level] = []
        for stage in range(-max(self.orders.values(), default=0), 1):
            keys = [(i, stage + c) for i, c in enumerate(self.counts) if stage + c >= 0]
            unknowns = [derivative_name(n, stage + top) for n, top in self.orders.items() if stage + top >= 0]
            words = [self.names[i] + (f", differentiated {m} times" if m else "") for i, m in keys]
            rows = tuple(self.residuals[k] for k in keys)
            found.append(Level(rows, tuple(words), tuple(unknowns), self.exact))
        return tuple(found)

    @cached_property
    def whole(self) -> Level:
        """All levels as one."""
        return joined(self.levels)

    @cached_property
    def with_initial(self) -> dict[tuple[str, ...], Level]:
        """All equations, initial ones included, as one level, by the inputs that may move; filled at first use."""
        return {}

    def unknown_symbols(self) -> list[str]:
        """Every unknown with all its derivatives up to the highest, by name."""
        return [derivative_name(n, k) for n, top in self.orders.items() for k in range(top + 1)]


def reduce_index(reduced: Reduced, flat: FlatModel, wanted: Sequence[str] = ()) -> Indexed:
    """Differentiate what must be differentiated, and what gives the wanted derivatives, by name.

    StructureError if equations and unknowns do not match.
    """
    rows = signature(reduced.incidence, reduced.unknowns)
    if len(reduced.residuals) != len(reduced.unknowns):
        raise unbalanced(reduced, rows, flat)
    counts, tops = _offsets(reduced, rows, _mentioned(reduced, flat, wanted), flat)
    residuals = _differentiated(reduced, counts, flat.discretes)
    orders = dict(zip(reduced.unknowns, (int(t) for t in tops), strict=True))
    names = tuple(e.name for e in reduced.equations)
    exact = frozenset((*reduced.table.independent, *reduced.known, flat.time.name()))
    return Indexed(residuals, names, tuple(int(c) for c in counts), orders, exact, reduced.incidence)


def _offsets(reduced: Reduced, rows: list[dict[int, int]], mentioned: np.ndarray, flat: FlatModel):
    n = len(rows)
    matched = largest_sum(rows)
    if matched is None:
        raise unbalanced(reduced, rows, flat)
    counts = np.zeros(n, dtype=int)
    while True:
        tops = mentioned.copy()
        for i, row in enumerate(rows):
            for j, order in row.items():
                tops[j] = max(tops[j], order + counts[i])
        new = np.array([tops[j] - rows[i][j] for i, j in enumerate(matched)], dtype=int)
        if np.array_equal(new, counts):
            return counts, tops
        counts = new


def _mentioned(reduced: Reduced, flat: FlatModel, wanted: Sequence[str]) -> np.ndarray:
    """For each unknown the highest derivative that the model or its user names, by whatever alias."""
    place = {name: j for j, name in enumerate(reduced.unknowns)}
    found = np.zeros(len(place), dtype=int)
    named = [*reduced.aliases, *flat.derivatives, *wanted, *_fixed_motions(reduced, flat)]
    left_out = _without_factors(reduced, flat)
    named = [name for name in named if name not in left_out]
    for name in wanted:
        if name in reduced.definitions:  # follows from derivatives of variables
            named += [leaf.name() for leaf in ca.symvar(reduced.definitions.reduced(name))]
    for name in named:
        base, order = split_derivative(name)
        alias = reduced.aliases.get(base)
        if alias is not None and alias.root in place:
            found[place[alias.root]] = max(found[place[alias.root]], alias.order + order)
    return found


def _without_factors(reduced: Reduced, flat: FlatModel) -> set[str]:
    """Derivatives whose only factors are parameters that are folded in as zero: the voltage of a capacitance of 0."""
    if not any(p.fold for p in flat.parameters):
        return set()
    others = [e for w in flat.whens for e in (w.condition, *(v for _, v in (*w.reinits, *w.assignments)))]
    others += [e.residual for e in flat.initial_equations]
    others += [s.expression for s in (*flat.sampled, *flat.delays)]
    stated = column([e.residual for e in flat.equations])
    named = {leaf.name() for leaf in ca.symvar(stated)} - {leaf.name() for leaf in ca.symvar(column(others))}
    there = {one.name for row in reduced.incidence for one in row}
    there |= {derivative_name(a.root, a.order) for a in reduced.aliases.values() if a.root is not None}
    found = set()
    for name in named & flat.derivatives.keys():
        base, order = split_derivative(name)
        alias = reduced.aliases.get(base)
        if alias is not None and alias.root is not None:
            root = derivative_name(alias.root, alias.order + order)
            found |= {name} if root not in there else set()
    return found


def _fixed_motions(reduced: Reduced, flat: FlatModel) -> list[str]:
    """Accelerations of what starts at a fixed place with a fixed speed: with them, both can be states."""
    fixed: dict[str, set[int]] = {}
    for variable in flat.variables:
        for name in variable.elements if variable.fixed and variable.prefer >= StateSelect.DEFAULT else ():
            alias = reduced.aliases[name]
            if alias.root is not None:
                fixed.setdefault(alias.root, set()).add(alias.order)
    return [derivative_name(root, 2) for root, orders in fixed.items() if {0, 1} <= orders]


def _is_rate(name: str, of: Collection[str]) -> bool:
    base, order = split_derivative(name)
    return order > 0 and base in of


def _differentiated(reduced: Reduced, counts, discretes: Collection[str]) -> dict[Key, ca.SX]:
    """Differentiated in the symbols of the definitions, where derivatives are short, and then resolved.

    discretes: names of what is constant between instants, so that its derivative is zero.
    """
    below = dict(enumerate(reduced.compact))
    residuals: dict[Key, ca.SX] = {(i, 0): r for i, r in enumerate(reduced.residuals)}
    keys: list[Key] = []
    compact: list[ca.SX] = []
    for level in range(1, max(counts, default=0) + 1):
        rows = [i for i, count in enumerate(counts) if count >= level]
        new = reduced.definitions.differentiated(ca.vertcat(*(below[i] for i in rows))).elements()
        given = reduced.rates if level == 1 else {}
        new = [given.get(i, rate) for i, rate in zip(rows, new, strict=True)]
        below = dict(zip(rows, new, strict=True))
        keys += [(i, level) for i in rows]
        compact += new
    if keys:
        resolved = reduced.definitions.to_reduced(ca.vertcat(*compact))
        rates = (
            [leaf for leaf in ca.symvar(resolved) if _is_rate(leaf.name(), discretes)] if discretes else []
        )
        resolved = ca.substitute(resolved, ca.vertcat(*rates), ca.SX.zeros(len(rates))) if rates else resolved
        residuals.update(zip(keys, ca.densify(resolved).elements(), strict=True))
    return residuals
