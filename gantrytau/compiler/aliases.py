"""Alias elimination: variables that are equal to another one, up to sign, factor, constant or derivative.

`v == der(s)` makes v the first derivative of s, so that mechanics stays of second order.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.compiler.definitions import Definitions
from gantrytau.compiler.parameters import ParameterTable
from gantrytau.compiler.symbol_spaces import Chains, column, made_of
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.scalar_arithmetic import depending, negative, plus, times
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import Derivative, derivative_name, derivatives_in, split_derivative

ZERO = ca.SX(0)
LONGEST_SUM = 40  # terms; a longer sum is not looked at for aliases
NOISE = 4 * np.finfo(float).eps  # of the terms that were added: their rounding, as in 0.1 + 0.2 - 0.3


@dataclass(frozen=True, eq=False)
class Alias:
    """variable = factor * (order-th derivative of root) + offset, of parameters; root None: a constant."""

    root: str | None
    order: int
    factor: float
    offset: ca.SX

    @property
    def symbol(self) -> str:
        """Name of the reduced symbol: the root or a derivative of it, "" for a constant."""
        return "" if self.root is None else derivative_name(self.root, self.order)

    def shifted(self, order: int) -> "Alias":
        """What the order-th derivative of the variable is."""
        return Alias(self.root, self.order + order, self.factor, ZERO) if order else self

    def root_value(self, value: ca.SX | float) -> ca.SX:
        """The value of the symbol where the variable has this value."""
        return (ca.SX(value) - self.offset) / self.factor


@dataclass(frozen=True, eq=False)
class Reduced:
    """Equations that are left, and for every variable what it is an alias of.

    table: the parameters; residuals: one scalar SX per remaining equation, in reduced symbols; compact: the same
    in the symbols of the definitions as well; equations: where they come from; redundant: equations that turned out to
    say 0 == 0.
    """

    table: ParameterTable
    residuals: tuple[ca.SX, ...]
    compact: tuple[ca.SX, ...]
    definitions: Definitions
    equations: tuple[Equation, ...]
    aliases: Mapping[str, Alias]
    unknowns: tuple[str, ...]
    known: frozenset[str]
    chains: Chains
    redundant: tuple[Equation, ...] = ()
    rates: Mapping[int, ca.SX] = field(default_factory=dict)

    @cached_property
    def incidence(self) -> tuple[tuple[Derivative, ...], ...]:
        """Which derivatives of which variables stand in each equation."""
        return tuple(derivatives_in(residual) for residual in self.residuals)

    def root(self, name: str) -> Alias | None:
        """What a variable or a derivative is of its root; None for what is no variable."""
        base, order = split_derivative(name)
        alias = self.aliases.get(base)
        return None if alias is None else alias.shifted(order)

    def to_reduced(self, expression: ca.SX) -> ca.SX:
        """An expression of the model's symbols in those of the reduced equations; others stay."""
        if expression.is_constant():
            return expression
        expression = self.definitions.to_reduced(self.table.to_reduced(expression))
        found = [(leaf, self.root(leaf.name())) for leaf in ca.symvar(expression)]
        old = [leaf for leaf, alias in found if alias is not None]
        new = [alias_expression(alias, self.chains) for _, alias in found if alias is not None]
        return ca.substitute(expression, ca.vertcat(*old), ca.vertcat(*new)) if old else expression


class _Terms:
    """A sum of factors times symbols, of names or of derivatives of roots, plus an offset of parameters.

    sizes: of the terms that were added to a factor, by which is judged what cancels; size: of the numbers in the offset.
    """

    def __init__(self) -> None:
        self.factors: dict[Any, float] = {}
        self.sizes: dict[Any, float] = {}
        self.offset, self.size = ZERO, 0.0

    def add(self, key: Any, factor: float, size: float) -> None:
        """One more term; size: of what its factor is the sum of."""
        self.factors[key] = self.factors.get(key, 0.0) + factor
        self.sizes[key] = self.sizes.get(key, 0.0) + size

    def shift(self, factor: float, offset: ca.SX) -> None:
        """One more term of the offset."""
        if offset is ZERO:
            return
        self.offset = _plus(self.offset, factor, offset)
        if offset.is_constant():
            self.size += abs(factor * float(offset))
        if self.offset.is_constant() and abs(float(self.offset)) <= NOISE * self.size:
            self.offset = ZERO

    def left(self) -> list[tuple[Any, float]]:
        """The terms that do not cancel."""
        return [(key, f) for key, f in self.factors.items() if abs(f) > NOISE * self.sizes[key]]


def eliminate_aliases(flat: FlatModel, table: ParameterTable, known: frozenset[str]) -> Reduced:
    """Remove all aliases. `known`: scalars that are given as functions of time."""
    return _Elimination(flat, table, known).run()


class _Elimination:
    def __init__(self, flat: FlatModel, table: ParameterTable, known: frozenset[str]):
        self.flat, self.table, self.known = flat, table, known
        self.chains = Chains(flat)
        self.parents: dict[str, Alias] = {}
        self.parameters = set(table.independent)
        self.rank: dict[str, tuple[int, ...]] = {}
        self.sized: dict[str, int] = {}  # how well it is known how large a variable is
        for place, variable in enumerate(flat.variables):
            for k, name in enumerate(variable.elements):
                self.rank[name] = (name not in known, -int(variable.prefer), name.count("."), place, k)
                self.sized[name] = 2 * variable.fixed + (
                    variable.start is not None or variable.nominal is not None
                )
        self.rated = [i for i, e in enumerate(flat.equations) if e.rate is not None]
        rates = [e.rate for e in flat.equations if e.rate is not None]
        sides = table.to_reduced(column([*(e.residual for e in flat.equations), *rates]))
        self.defined, self.rates = (
            dict(zip(of, table.to_reduced(column(list(of.values()))).elements(), strict=True))
            for of in (flat.definitions, flat.rates)
        )
        self.definition_symbols = {
            n: s for v in flat.propagated for n, s in zip(v.elements, v.symbol.elements(), strict=True)
        }
        self.residuals = self._without_constants(sides.elements())

    def run(self) -> Reduced:
        remaining = list(range(len(self.flat.equations)))  # behind them stand the given rates
        while True:
            sums = {i: terms for i in remaining if (terms := self._sum(self.residuals[i])) is not None}
            changed = False
            while True:
                used = [i for i, terms in sums.items() if self._use(terms)]
                if not used:
                    break
                changed = True
                for i in used:
                    del sums[i]
                gone = set(used)
                remaining = [i for i in remaining if i not in gone]
            for i, terms in sums.items():  # what cancels but for its rounding determines nothing
                rooted = self._rooted(terms)
                if not rooted.factors or len(rooted.left()) < len(rooted.factors):
                    self.residuals[i] = self._written(rooted)
            if not changed:
                break
            for i, new in zip(
                remaining, self._substitute([self.residuals[i] for i in remaining]), strict=True
            ):
                self.residuals[i] = new
        # what became 0 == 0 repeats other equations: two ends that both say that they carry no torque
        redundant = [i for i in remaining if self.residuals[i].is_zero()]
        remaining = [i for i in remaining if not self.residuals[i].is_zero()]
        aliases = {n: self.root(n, 0) for v in self.flat.variables for n in v.elements}
        roots = (n for n, alias in aliases.items() if alias.root == n and alias.order == 0)
        unknowns = tuple(n for n in roots if n not in self.known)
        compact = [self.residuals[i] for i in remaining]
        definitions = self._definitions(aliases)
        rates = self._substitute(self.residuals[len(self.flat.equations) :])
        rate_of = dict(zip(self.rated, rates, strict=True))
        return Reduced(
            self.table,
            tuple(definitions.to_reduced(ca.vertcat(*compact)).elements()) if compact else (),
            tuple(compact),
            definitions,
            tuple(self.flat.equations[i] for i in remaining),
            aliases,
            unknowns,
            self.known,
            self.chains,
            tuple(self.flat.equations[i] for i in redundant),
            {k: rate_of[i] for k, i in enumerate(remaining) if i in rate_of},
        )

    def _definitions(self, aliases: Mapping[str, Alias]) -> Definitions:
        symbols = {
            n: self.flat.derivatives[n]
            for n in self.flat.derivatives
            if split_derivative(n)[0] in self.definition_symbols
        }

        def variable(name: str, order: int) -> ca.SX | None:
            return self.chains.sx(name, order) if name in aliases else None

        return Definitions(
            {**self.definition_symbols, **symbols},
            dict(zip(self.defined, self._substitute(list(self.defined.values())), strict=True)),
            dict(zip(self.rates, self._substitute(list(self.rates.values())), strict=True)),
            variable,
        )

    def _without_constants(self, residuals: list[ca.SX]) -> list[ca.SX]:
        """Residuals with those definitions inserted that, with parameters folded in, are numbers after all."""
        done: set[str] = set()
        while True:
            steady = {n: e for n, e in self._steady().items() if n not in done}
            if not steady:
                return residuals
            steady = self._without_rounding(steady)
            done |= steady.keys()
            count, names = len(residuals), list(self.defined)
            rates = list(self.rates)
            everything = ca.vertcat(*residuals, *self.defined.values(), *self.rates.values())
            old = [self.definition_symbols[n] for n in steady]
            new = list(steady.values())
            for leaf in ca.symvar(everything):
                base, order = split_derivative(leaf.name())
                if order and base in steady:
                    old.append(leaf)
                    new.append(ca.SX(0))
            found = ca.substitute(everything, ca.vertcat(*old), ca.vertcat(*new)).elements()
            residuals = found[:count]
            self.defined = dict(zip(names, found[count:], strict=False))
            self.rates = dict(zip(rates, found[count + len(names) :], strict=True))

    def _without_rounding(self, steady: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
        """Numbers, of which those that the cosine of a right angle leaves in a matrix are zero."""
        found = dict(steady)
        for quantity in self.flat.propagated:
            numbers = {
                n: float(steady[n]) for n in quantity.elements if n in steady and steady[n].is_constant()
            }
            largest = max((abs(x) for x in numbers.values()), default=0.0)
            found.update((n, ZERO) for n, x in numbers.items() if abs(x) <= NOISE * largest)
        return found

    def _steady(self) -> dict[str, ca.SX]:
        """Definitions of parameters alone."""
        whole = list(self.defined.values())
        moving = [x for x in ca.symvar(column(whole)) if x.name() not in self.parameters]
        pairs = zip(self.defined.items(), depending(whole, moving), strict=True)
        return {name: expression for (name, expression), moves in pairs if not moves}

    def root(self, name: str, order: int) -> Alias:
        """What the order-th derivative of a variable is."""
        factor, offset = 1.0, ZERO
        while (alias := self.parents.get(name)) is not None:
            if order == 0:
                offset = _plus(offset, factor, alias.offset)
            if alias.root is None:
                return Alias(None, 0, 0.0, offset)
            factor *= alias.factor
            name, order = alias.root, order + alias.order
        return Alias(name, order, factor, offset)

    def _sum(self, expression: ca.SX) -> _Terms | None:
        """The expression as a sum of symbols times numbers, or None if it is none."""
        terms = _Terms()
        stack = [(expression, 1.0)]
        for _ in range(3 * LONGEST_SUM):
            if not stack:
                return terms
            node, factor = stack.pop()
            operator = node.op()
            if operator == ca.OP_PARAMETER:
                name = node.name()
                if split_derivative(name)[0] in self.defined:
                    return None
                if name in self.parameters:
                    terms.shift(factor, node)
                elif name == self.flat.time.name():
                    return None
                else:
                    terms.add(name, factor, abs(factor))
            elif operator == ca.OP_CONST:
                terms.shift(factor, node)
            elif operator in (ca.OP_ADD, ca.OP_SUB):
                sign = 1 if operator == ca.OP_ADD else -1
                stack += [(node.dep(0), factor), (node.dep(1), sign * factor)]
            elif operator == ca.OP_NEG:
                stack.append((node.dep(0), -factor))
            elif operator == ca.OP_TWICE:
                stack.append((node.dep(0), 2 * factor))
            elif operator == ca.OP_MUL and node.dep(0).is_constant():
                stack.append((node.dep(1), factor * float(node.dep(0))))
            elif operator == ca.OP_MUL and node.dep(1).is_constant():
                stack.append((node.dep(0), factor * float(node.dep(1))))
            elif operator == ca.OP_DIV and node.dep(1).is_constant():
                stack.append((node.dep(0), factor / float(node.dep(1))))
            elif made_of(node, self.parameters, LONGEST_SUM):
                terms.shift(factor, node)
            else:
                return None
        return None

    def _rooted(self, terms: _Terms) -> _Terms:
        """The same sum in roots and their derivatives."""
        found = _Terms()
        found.offset, found.size = terms.offset, terms.size
        for name, factor in terms.factors.items():
            alias = self.root(*split_derivative(name))
            found.shift(factor, alias.offset)
            if alias.root is not None:
                found.add(
                    (alias.root, alias.order), factor * alias.factor, terms.sizes[name] * abs(alias.factor)
                )
        return found

    def _use(self, terms: _Terms) -> bool:
        """Turn the sum into an alias if at most two symbols are left in it."""
        rooted = self._rooted(terms)
        left, offset = rooted.left(), rooted.offset
        if not left or len(left) > 2:
            return False
        if len(left) == 1:
            ((name, order), factor) = left[0]
            if order > 0 or name in self.known:
                return False
            self.parents[name] = Alias(None, 0, 0.0, _plus(ZERO, -1 / factor, offset))
            return True
        (a, factor_a), (b, factor_b) = left
        if a[1] == b[1] == 0:
            if self._before(a[0], b[0], abs(factor_a) != abs(factor_b)):
                a, b, factor_a, factor_b = b, a, factor_b, factor_a
        elif a[1] > 0 and b[1] == 0:
            a, b, factor_a, factor_b = b, a, factor_b, factor_a
        if a[1] > 0 or a[0] in self.known or a[0] == b[0] or (b[1] > 0 and not offset.is_zero()):
            return False
        factor = -factor_b / factor_a
        if not 0 < abs(factor) < np.inf:  # the ratio of two numbers may be none
            return False
        self.parents[a[0]] = Alias(b[0], b[1], factor, _plus(ZERO, -1 / factor_a, offset))
        return True

    def _before(self, a: str, b: str, scaled: bool) -> bool:
        """Whether a rather than b is the root of both: of two scales that of a start, by which tolerances are meant."""
        first, second = self.rank[a], self.rank[b]
        if scaled and first[:2] == second[:2] and self.sized[a] != self.sized[b]:
            return self.sized[a] > self.sized[b]
        return first < second

    def _written(self, terms: _Terms) -> ca.SX:
        """A sum as an expression, without what cancels."""
        found = terms.offset
        for (root, order), factor in terms.left():
            found = _plus(found, factor, self.chains.sx(root, order))
        return found

    def _substitute(self, residuals: list[ca.SX]) -> list[ca.SX]:
        if not residuals:
            return []
        vector = ca.vertcat(*residuals)
        old, new = [], []
        for leaf in ca.symvar(vector):
            name, order = split_derivative(leaf.name())
            if name in self.parents:
                alias = self.root(name, order)
                old.append(leaf)
                new.append(alias_expression(alias, self.chains))
        return ca.substitute(vector, ca.vertcat(*old), ca.vertcat(*new)).elements() if old else residuals


def _plus(total: ca.SX, factor: float, offset: ca.SX) -> ca.SX:
    """Total + factor * offset; offsets are nearly always zero, and arithmetic on symbols is slow."""
    if offset is ZERO or offset.is_zero():
        return total
    scaled = _scaled(factor, offset)
    return scaled if total is ZERO or total.is_zero() else plus(total, scaled)


def alias_expression(alias: Alias, chains: Chains) -> ca.SX:
    """The alias written out."""
    if alias.root is None:
        return alias.offset
    return _plus(_scaled(alias.factor, chains.sx(alias.root, alias.order)), 1.0, alias.offset)


def _scaled(factor: float, expression: ca.SX) -> ca.SX:
    """Factor * expression."""
    if factor in (1.0, -1.0):
        return expression if factor == 1.0 else negative(expression)
    return times(factor, expression)
