"""A CasADi function for some points, a few in one call, through buffers of NumPy's memory.

The way through CasADi's own matrices takes a hundred times longer.
"""

from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.interruption import on_interrupt

BLOCK = 8  # points of one call: they take longer than the call, and Ctrl-C is heard in a second where none is in reach


class PointByPoint:
    """From arguments (N, k), which are numbers, to results (N, m) of a function, all zeros stored."""

    def __init__(self, function: ca.Function):
        self._sizes = [function.numel_in(i) for i in range(function.n_in())]
        self._count = sum(self._sizes)
        q = ca.MX.sym("q", self._count)
        parts = ca.vertsplit(q, list(np.cumsum([0, *self._sizes]))) if self._sizes else []
        self._results = [ca.densify(y) for y in function.call(parts)]
        self._argument = q

    def __call__(self, q: np.ndarray) -> list[np.ndarray]:
        """Results one by one."""
        return _in_blocks(self._function, q)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian of all results, below each other, by all arguments, (N, m, k)."""
        (found,) = _in_blocks(self._jacobian, q)
        return found.reshape(len(q), self._count, sum(y.numel() for y in self._results)).transpose(0, 2, 1)

    @cached_property
    def _function(self) -> ca.Function:
        return ca.Function("points", [self._argument], self._results)

    @cached_property
    def _jacobian(self) -> ca.Function:
        """The Jacobian, column after column."""
        whole = ca.vertcat(*map(ca.vec, self._results))
        return ca.Function("jacobian", [self._argument], [ca.densify(ca.jacobian(whole, self._argument))])


def _in_blocks(function: ca.Function, q: np.ndarray) -> list[np.ndarray]:
    """Results of a function of one argument, a block of points in one call."""
    found = [np.empty((len(q), function.numel_out(i))) for i in range(function.n_out())]
    asked: list[bool] = []
    # inside CasADi it would be a RuntimeError, or a failed iteration
    with on_interrupt(lambda: asked.append(True)):
        _fill(function, q, found, asked)
    return found


def _fill(function: ca.Function, q: np.ndarray, found: list[np.ndarray], asked: list[bool]) -> None:
    """Results into `found`: the first rows in blocks, then the rest; until an end is asked for."""
    count = len(q)
    whole = count - count % BLOCK
    for size, firsts in ((BLOCK, range(0, whole, BLOCK)), (count - whole, range(whole, count, BLOCK))):
        if not firsts:
            continue
        buffer, run = function.map(size).buffer()
        inside = np.empty((size, q.shape[1]))
        outside = [np.empty((size, x.shape[1])) for x in found]
        buffer.set_arg(0, inside.data)
        for i, memory in enumerate(outside):
            buffer.set_res(i, memory.data)
        for first in firsts:
            inside[:] = q[first : first + size]
            run()
            if asked:
                raise KeyboardInterrupt
            for memory, result in zip(outside, found, strict=True):
                result[first : first + size] = memory
