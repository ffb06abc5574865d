"""The translated model: the frozen record that simulation, writing and the answers read."""

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.checks import instance
from gantrytau.compiler.aliases import Alias, Reduced, alias_expression
from gantrytau.compiler.blocks.pattern import SparsityPattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import Block, SolvedBlocks, solve_anew, solve_blocks
from gantrytau.compiler.index_reduction import Indexed, Key
from gantrytau.compiler.parameters import ParameterTable
from gantrytau.compiler.request import Request
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.states import StateChoice
from gantrytau.compiler.symbol_spaces import column
from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import derivative_name, split_derivative


@dataclass(frozen=True)
class Origin:
    """The equations of one block, by name, and the symbols that they give.

    tears: found together; inner: what follows from these, one after another; root: whether the one tear is the root
    of a quadratic.
    """

    equations: tuple[str, ...]
    tears: tuple[str, ...]
    inner: tuple[str, ...]
    root: bool


@dataclass(frozen=True, eq=False)
class Translated:
    """A differential-algebraic system of index one, sorted into blocks that are solved one after another.

    Names are those of the model; a vector's name stands for its elements.
    known: the inputs, then sampled variables, then Discretes, then the forces of friction that sticks; asked: start
    values as the model gives them; start: consistent numbers of all symbols; redundant: constraints that were left out.
    """

    request: Request
    flat: FlatModel
    reduced: Reduced
    indexed: Indexed
    choice: StateChoice
    blocks: tuple[Block, ...]
    known: tuple[str, ...]
    asked: StartValues
    start: Mapping[str, float]
    redundant: tuple[Equation, ...] = ()

    def __repr__(self) -> str:
        counts = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.blocks)} blocks"
        return f"<{type(self).__name__} {self.name}: {counts}>"

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in ("made", "_numbers")}

    @property
    def name(self) -> str:
        """Class of the model."""
        return self.flat.name

    @cached_property
    def made(self) -> dict[Hashable, Any]:
        """What was made of it at some cost, by what it was made for; released with it, and not sent along."""
        return {}

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states (scalars), as the model calls them: a speed by its own name, not `der(...)`."""
        return tuple(self._own_names.get(name, name) for name in self.choice.states)

    @property
    def algebraics(self) -> tuple[str, ...]:
        """Unknowns that have to be found by iteration, because their block has no closed form."""
        return tuple(y.name() for block in self.blocks if block.solution is None for y in block.tears)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what is known from outside, scalars."""
        events = set(self.flat.event_names)
        return tuple(n for n in self.known if n not in events)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the declared outputs, scalars."""
        return tuple(n for v in self.flat.variables if v.kind == "output" for n in v.elements)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters, scalars."""
        return tuple(n for p in self.flat.parameters for n in p.elements)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of all variables, scalars, aliases and propagated quantities included."""
        return (*(n for v in self.flat.variables for n in v.elements), *self.flat.definitions)

    @property
    def table(self) -> ParameterTable:
        """The parameters sorted out."""
        return self.reduced.table

    @property
    def parameter_values(self) -> Mapping[str, float]:
        """Numbers of all parameters, by scalar name."""
        return self.table.values

    @property
    def parameter_symbols(self) -> Mapping[str, ca.SX]:
        """Symbols of all parameters, by scalar name; in the equations only those of `adjustable` are left."""
        return self.table.symbols

    @property
    def adjustable(self) -> tuple[str, ...]:
        """Parameters that are symbols of the equations; the others follow from them, or shape the equations."""
        return self.table.independent

    @cached_property
    def origins(self) -> tuple[Origin, ...]:
        """Which equations give which symbols, block by block."""
        return tuple(origin_of(self, block) for block in self.blocks)

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """Names of all reduced symbols but parameters and time: unknowns and what is known, with their derivatives."""
        return tuple(self.indexed.symbols(self.reduced.known))

    @cached_property
    def openings(self) -> ca.SX:
        """How far constraints that were left out as redundant are violated: m or rad, in small mechanisms of their length.

        That is the largest length at the start, in whole thousands.
        """
        if not self.redundant:
            return column([])
        residuals = self.to_reduced(column([e.residual for e in self.redundant])).elements()
        lengths = [n for v in self.flat.variables if v.unit == "m" for n in v.elements]
        length = float(np.abs(self.numbers(lengths, self.start)).max(initial=0.0)) or 1.0
        size = min(1.0, 10.0 ** (3 * round(math.log10(length) / 3)))
        rows = zip(self.redundant, residuals, strict=True)
        return column([r if "orientation" in e.name else r / size for e, r in rows])

    @property
    def mobility(self) -> int:
        """Number of ways in which the positions can change."""
        return sum(1 for n in self.choice.states if self.indexed.orders.get(n, 0) > 1)

    @property
    def vectors(self) -> Mapping[str, FlatVariable]:
        """Declared quantities by their whole names."""
        return self.flat.vectors

    def expand(self, name: str) -> tuple[str, ...]:
        """The scalar names of `name` (a scalar, a vector, or a derivative of one); ModelError if unknown."""
        return self.flat.expand(instance(self.name, "name", name, str, "one name, a string"))

    @cached_property
    def _own_names(self) -> dict[str, str]:
        """Names of variables that are exactly a derivative of another one."""
        found: dict[str, str] = {}
        for name, alias in self.reduced.aliases.items():
            plain = alias.factor == 1.0 and alias.offset.is_constant() and float(alias.offset) == 0.0
            if alias.root is not None and alias.order > 0 and plain:
                key = derivative_name(alias.root, alias.order)
                if key not in found or name.count(".") < found[key].count("."):
                    found[key] = name
        return found

    def spoken(self, name: str) -> str:
        """What the model calls a symbol: `tool.v[0]` for `der(tool.r[0])`, `der(tool.v[0])` for its derivative."""
        base, order = split_derivative(name)
        for k in range(order, 0, -1):
            own = self._own_names.get(derivative_name(base, k))
            if own is not None:
                return derivative_name(own, order - k)
        return name

    def expression(self, name: str) -> ca.SX:
        """A scalar variable, derivative or parameter in reduced symbols."""
        base, order = split_derivative(name)
        if base == self.flat.time.name():
            return self.flat.time if order == 0 else ca.SX(order == 1)
        if base in self.table.symbols:
            return self.table.expressions.get(base, self.table.symbols[base]) if order == 0 else ca.SX(0)
        alias = self.root(name)
        if alias is None:
            return self.reduced.definitions.reduced(name)
        return alias_expression(alias, self.reduced.chains)

    def to_reduced(self, expression: ca.SX) -> ca.SX:
        """An expression of the model's symbols in reduced symbols; others stay."""
        return self.reduced.to_reduced(expression)

    def root(self, name: str) -> Alias | None:
        """What a scalar variable or derivative is of its root; None for what is no variable."""
        return self.reduced.root(name)

    def number(self, expression: ca.SX | float) -> float:
        """The value of an expression of parameters."""
        return self.table.number(ca.SX(expression))

    def numbers(self, names: Iterable[str], values: Mapping[str, float]) -> np.ndarray:
        """Values of scalars, from numbers of all symbols of the reduced equations."""
        names = tuple(names)
        if names not in self._numbers:
            expressions = ca.SX(ca.vertcat(*(self.expression(n) for n in names)))
            leaves = ca.symvar(expressions)
            function = ca.Function("numbers", [ca.vertcat(*leaves)], [ca.densify(expressions)])
            self._numbers[names] = ([leaf.name() for leaf in leaves], function)
        leaves, function = self._numbers[names]
        return np.array(function(ca.DM([values[name] for name in leaves]))).ravel()

    @cached_property
    def _numbers(self) -> dict[tuple[str, ...], tuple[list[str], ca.Function]]:
        return {}

    def equation_name(self, key: Key) -> str:
        """Where an equation of a block comes from."""
        index, times = key
        name = self.reduced.equations[index].name
        return name if times == 0 else f"{name}, differentiated {'once' if times == 1 else f'{times} times'}"


def origin_of(dae: Translated, block: Block) -> Origin:
    """Where a block of its equations comes from."""
    return Origin(
        tuple(dae.equation_name(key) for key in block.equations),
        tuple(y.name() for y in block.tears),
        tuple(symbol.name() for symbol, _ in block.inner),
        block.root is not None,
    )


def solved(dae: Translated, pattern: SparsityPattern) -> SolvedBlocks:
    """Blocks of its equations, solved in the order of a pattern."""
    guide = Guide(dae.start, dae.parameter_values, dae.choice.states)
    return solve_blocks(pattern.blocks, dae.indexed.residuals, _symbols(dae, pattern.blocks), guide)


def carefully(dae: Translated, quick: SolvedBlocks) -> SolvedBlocks:
    """The same blocks, those that divide by what may vanish solved anew without."""
    guide = Guide(dae.start, dae.parameter_values, dae.choice.states, careful=True)
    symbols = _symbols(dae, [(b.equations, b.unknowns) for b in quick.blocks])
    return solve_anew(quick, dae.indexed.residuals, symbols, guide)


def _symbols(dae: Translated, blocks: Iterable[tuple[tuple[Key, ...], tuple[str, ...]]]) -> dict[str, ca.SX]:
    return {n: dae.reduced.chains.named(n) for _, names in blocks for n in names}
