"""A CasADi function of scalars computed for many points at once: each instruction by NumPy for a block of points.

An instruction of NumPy's takes half a microsecond to begin and less than a nanosecond a point, so that blocks are
as long as the numbers between stay in the cache.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.language.instructions import computed

POINTS = 2048  # of a block: of 256 to 2048, measured, the quickest for programs of 100 to 2000 instructions


def _chosen(condition: Any, x: Any, out: np.ndarray | None = None) -> np.ndarray:
    """X where the condition holds, else 0."""
    found = np.where(condition != 0, x, 0.0)
    if out is None:
        return found
    np.copyto(out, found)
    return out


# of columns; the last argument, which may be left out, is where the result goes
OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: np.positive,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_FMOD: np.fmod,
    ca.OP_FABS: np.fabs,
    ca.OP_SIGN: np.sign,
    ca.OP_COPYSIGN: np.copysign,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_INV: np.reciprocal,
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_TANH: np.tanh,
    ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh,
    ca.OP_ATANH: np.arctanh,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_LOG1P: np.log1p,
    ca.OP_EXPM1: np.expm1,
    ca.OP_HYPOT: np.hypot,
    ca.OP_TWICE: lambda x, out=None: np.add(x, x, out),
    ca.OP_IF_ELSE_ZERO: _chosen,
}


class NotForArrays(Exception):
    """A function calls what NumPy does not compute, such as a table: it goes point by point."""


class ArrayProgram:
    """An SX function for many points: (k, N) an argument, a row a scalar and a column a point; (l, N) a result.

    Raises NotForArrays for an instruction that is not known.
    """

    def __init__(self, function: ca.Function):
        self._sizes = [function.numel_out(i) for i in range(function.n_out())]
        # step k gives the value k; None: it is there
        steps: list[tuple[Callable[..., Any] | None, list[int]]] = []
        inputs: dict[int, tuple[int, int]] = {}
        constants: dict[int, float] = {}

        def value(operation: Callable[..., Any] | None, operands: list[int]) -> int:
            steps.append((operation, operands))
            return len(steps) - 1

        def symbol(argument: int, element: int) -> int:
            place = value(None, [])
            inputs[place] = argument, element
            return place

        def number(x: float) -> int:
            place = value(None, [])
            constants[place] = x
            return place

        def operated(operator: int, operands: list[int]) -> int:
            if operator not in OPERATIONS:
                raise NotForArrays(f"operation {operator} of {function.name()}")
            return value(OPERATIONS[operator], operands)

        results = computed(function, symbol, number, operated)
        found = [(i, x) for i, nonzeros in enumerate(results) for x in nonzeros]
        slots, self._count = _slots(steps, inputs, {x for _, x in found})
        slots.update((place, self._count + k) for k, place in enumerate(constants))
        self._constants = [np.array(x) for x in constants.values()]
        self._inputs = [(slots[place], *where) for place, where in inputs.items()]
        self._steps = [
            (operation, [*(slots[x] for x in operands), slots[place]])
            for place, (operation, operands) in enumerate(steps)
            if operation is not None
        ]
        rows = [row for i in range(function.n_out()) for row in _places(function.sparsity_out(i))]
        self._results = [(i, row, slots[x]) for (i, x), row in zip(found, rows, strict=True)]

    def __call__(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """Results (l, N) of arguments (k, N); zeros that are not stored are zeros."""
        count = arguments[0].shape[1]
        found = [np.zeros((size, count)) for size in self._sizes]
        work = np.ones((self._count, min(count, POINTS)))  # behind the last points are any
        rows = [*work, *self._constants]
        bound = [(operation, [rows[x] for x in places]) for operation, places in self._steps]
        with np.errstate(all="ignore"):
            for first in range(0, count, POINTS):
                part = slice(first, min(first + POINTS, count))
                size = part.stop - first
                for slot, argument, element in self._inputs:
                    work[slot, :size] = arguments[argument][element, part]
                for operation, operands in bound:
                    operation(*operands)
                for i, row, slot in self._results:
                    values = rows[slot]
                    found[i][row, part] = values[:size] if values.ndim else values
        return found


def _places(pattern: ca.Sparsity) -> list[int]:
    """Indices of the nonzeros in the matrix, column after column."""
    return [r + c * pattern.size1() for r, c in zip(pattern.row(), pattern.get_col(), strict=True)]


def _slots(
    steps: Sequence[tuple[Any, list[int]]], inputs: Iterable[int], kept: set[int]
) -> tuple[dict[int, int], int]:
    """The row of memory of each value, used again when it has been read for the last time; and how many rows there are."""
    last = {x: place for place, (_, operands) in enumerate(steps) for x in operands}
    slots = {place: k for k, place in enumerate(inputs)}  # all are there before the first step
    free: list[int] = []
    count = len(slots)
    for place, (operation, operands) in enumerate(steps):
        if operation is None:
            continue
        if free:
            slots[place] = free.pop()
        else:
            slots[place], count = count, count + 1
        gone = {x for x in (*operands, place) if last.get(x, place) == place and x in slots and x not in kept}
        free += [slots[x] for x in gone]
    return slots, count
