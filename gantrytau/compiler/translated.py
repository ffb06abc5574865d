"""The translated model: the frozen record that simulation, writing and the answers read."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.compiler.aliases import Reduced, alias_expression
from gantrytau.compiler.blocks.solution import Block
from gantrytau.compiler.index_reduction import Indexed, Key
from gantrytau.compiler.parameters import ParameterTable
from gantrytau.compiler.request import Request
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.states import StateChoice
from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import derivative_name, split_derivative


@dataclass(frozen=True, eq=False)
class Translated:
    """A differential-algebraic system of index one, sorted into blocks that are solved one after another.

    Names are those of the model; a vector's name stands for its elements.
    known: the inputs, then sampled variables, then the forces of friction that sticks; asked: start values as the model
    gives them; start: consistent numbers of all symbols; redundant: constraints that were left out.
    """

    request: Request
    flat: FlatModel
    table: ParameterTable
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

    @property
    def name(self) -> str:
        """Class of the model."""
        return self.flat.name

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states (scalars), as the model calls them: a speed by its own name, not `der(...)`."""
        return tuple(self.spoken(name) for name in self.choice.states)

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
    def mobility(self) -> int:
        """Number of ways in which the positions can change."""
        return sum(1 for n in self.choice.states if self.indexed.orders.get(n, 0) > 1)

    @property
    def vectors(self) -> Mapping[str, FlatVariable]:
        """Declared quantities by their whole names."""
        return self.flat.vectors

    def expand(self, name: str) -> tuple[str, ...]:
        """The scalar names of `name` (a scalar, a vector, or a derivative of one); ModelError if unknown."""
        return self.flat.expand(name)

    @cached_property
    def _spoken_names(self) -> dict[str, str]:
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
        """What the model calls a symbol: a speed by its own name, not `der(...)`."""
        return self._spoken_names.get(name, name)

    def expression(self, name: str) -> ca.SX:
        """A scalar variable, derivative or parameter in the symbols of the reduced equations."""
        base, order = split_derivative(name)
        if base == self.flat.time.name():
            return self.flat.time
        if base in self.table.symbols:
            return self.table.expressions.get(base, self.table.symbols[base])
        if base in self.flat.definitions:
            return self.reduced.definitions.resolved(name)
        alias = self.reduced.aliases[base]
        if alias.root is not None:
            shifted = type(alias)(
                alias.root, alias.order + order, alias.factor, alias.offset if order == 0 else ca.SX(0)
            )
            found = alias_expression(shifted, self.reduced.chains)
        else:
            found = alias.offset if order == 0 else ca.SX(0)
        return found if alias.offset.is_constant() else self.table.reduce(found)

    def reduce(self, expression: ca.SX) -> ca.SX:
        """An expression of the flat model's symbols in the symbols of the reduced equations; others stay."""
        leaves = [
            leaf for leaf in ca.symvar(expression) if split_derivative(leaf.name())[0] in self.flat.scalars
        ]
        new = [self.expression(leaf.name()) for leaf in leaves]
        return ca.substitute(expression, ca.vertcat(*leaves), ca.vertcat(*new)) if leaves else expression

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
