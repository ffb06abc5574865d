"""The three alphabets in which expressions are written, and the ways from one to the next.

| alphabet | symbols | who writes in it |
|---|---|---|
| of the model | variables, propagated quantities, their derivatives, parameters, time, as users name them | `FlatModel` |
| reduced | roots of aliases and their derivatives, independent parameters, time | residuals of `Indexed`, blocks |
| of a system | states, algebraics, inputs, independent parameters, time | `System`, and the solvers above it |

Each alphabet holds symbols of the one before it, so that what is in the later one already stays as it is.
`Reduced.to_reduced` leads from the first to the second (`Translated.expression` for one name, `Reduced.root` for the
root behind it), `System.to_system` from the second to the third. What is solved block by block leads on by a
`Substitution`, whatever the last symbols are.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.symbols import derivative_name, split_derivative


class Chains:
    """Symbols of variables and their derivatives, the missing ones made when asked for."""

    def __init__(self, flat: FlatModel):
        self._sx: dict[str, ca.SX] = dict(flat.derivatives)
        for variable in flat.variables:
            self._sx.update(zip(variable.elements, variable.symbol.elements(), strict=True))

    def sx(self, root: str, order: int = 0) -> ca.SX:
        """The symbol of the order-th derivative of a variable."""
        name = derivative_name(root, order)
        if name not in self._sx:
            self._sx[name] = ca.SX.sym(name)
        return self._sx[name]

    def named(self, name: str) -> ca.SX:
        """The symbol of that name, `x` or `der(x)`."""
        return self.sx(*split_derivative(name))

    def rate(self, name: str) -> ca.SX:
        """The symbol of the derivative of the symbol of that name."""
        base, order = split_derivative(name)
        return self.sx(base, order + 1)


@dataclass(frozen=True, eq=False)
class Substitution:
    """Symbols and what they stand for, in an order in which each needs only symbols before it."""

    definitions: tuple[tuple[ca.SX, ca.SX], ...]

    def inserted(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """The expressions without any of the symbols; what they have in common is written once."""
        if not self.definitions or not expressions:
            return list(expressions)
        symbols, values = [s for s, _ in self.definitions], [e for _, e in self.definitions]
        _, found = ca.substitute_inplace(symbols, values, list(expressions), False)
        return list(found)


def column(elements: Sequence[ca.SX]) -> ca.SX:
    """Scalars and columns below each other; (0, 1) for none."""
    return ca.vertcat(*elements) if elements else ca.SX(0, 1)


def together(change: Callable[[ca.SX], ca.SX], expressions: Sequence[ca.SX]) -> list[ca.SX]:
    """Dense expressions, changed together as one column: shared subexpressions are visited once."""
    dense = [e if e.is_dense() else ca.densify(e) for e in expressions]
    found = change(column([e if e.is_column() else ca.vec(e) for e in dense]))
    pieces = ca.vertsplit(found, np.cumsum([0, *(e.numel() for e in dense)]).tolist())
    return [x if e.is_column() else ca.reshape(x, *e.shape) for x, e in zip(pieces, dense, strict=True)]


def called(function: ca.Function, *arguments: np.ndarray) -> list[np.ndarray]:
    """The nonzeros of a function's results at dense arguments, written by CasADi into memory of NumPy's."""
    memory, go = function.buffer()
    given = [np.array(one, dtype=float).ravel() for one in arguments]  # they have to outlive the call
    found = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
    for k, one in enumerate(given):
        memory.set_arg(k, one.data)
    for k, one in enumerate(found):
        memory.set_res(k, one.data)
    go()
    return found


def values_at(expression: ca.SX, point: Mapping[str, float]) -> np.ndarray:
    """The numbers of an expression where its symbols have these values, as a dense array of its shape."""
    leaves = ca.symvar(expression)
    function = ca.Function("values", [ca.vertcat(*leaves)], [expression])
    (nonzeros,) = called(function, np.array([point[leaf.name()] for leaf in leaves]))
    if expression.is_dense():
        return nonzeros.reshape(expression.shape, order="F")
    found = np.zeros(expression.shape)
    rows, columns = expression.sparsity().get_triplet()
    found[rows, columns] = nonzeros
    return found


def made_of(expression: ca.SX, names: Collection[str], nodes: int) -> bool:
    """Whether an expression has no symbols but these; of most that have others the first few nodes tell."""
    stack = [expression]
    for _ in range(nodes):
        if not stack:
            return True
        one = stack.pop()
        if one.is_symbolic() and one.name() not in names:
            return False
        stack += [one.dep(k) for k in range(one.n_dep())]
    return all(leaf.name() in names for leaf in ca.symvar(expression))
