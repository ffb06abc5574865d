"""A CasADi function for some points, a few in one call."""

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.interruption import on_interrupt
from gantrytau.kernels import code_size
from gantrytau.simulation.events.at_places import AtPlaces

BLOCKS = 64, 8  # points between two looks for Ctrl-C, which is heard in a second where none is in reach
SMALL = 10_000  # instructions: of functions with more, the second number


class PointByPoint:
    """From arguments (N, k), which are numbers, to results (N, m) of a function, all zeros stored."""

    def __init__(self, function: ca.Function):
        sizes = [function.numel_in(i) for i in range(function.n_in())]
        self._count = sum(sizes)
        kind: Any = ca.SX if function.is_a("SXFunction") else ca.MX
        self._argument = kind.sym("q", self._count)
        parts = ca.vertsplit(self._argument, list(np.cumsum([0, *sizes]))) if sizes else []
        self._results = [ca.densify(y) for y in function.call(parts)]

    def __call__(self, q: np.ndarray) -> list[np.ndarray]:
        """Results one by one."""
        return _in_blocks(self._function, q, self._block)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian of all results, below each other, by all arguments, (N, m, k)."""
        (found,) = _in_blocks(self._jacobian, q, self._block)
        return found.reshape(len(q), self._count, sum(y.numel() for y in self._results)).transpose(0, 2, 1)

    @cached_property
    def _block(self) -> int:
        return BLOCKS[code_size(self._function.function) > SMALL]

    @cached_property
    def _function(self) -> AtPlaces:
        return AtPlaces(ca.Function("points", [self._argument], self._results))

    @cached_property
    def _jacobian(self) -> AtPlaces:
        """The Jacobian, column after column."""
        whole = ca.vertcat(*map(ca.vec, self._results))
        found = ca.densify(ca.jacobian(whole, self._argument))
        return AtPlaces(ca.Function("jacobian", [self._argument], [found]))


def _in_blocks(function: AtPlaces, q: np.ndarray, size: int) -> list[np.ndarray]:
    """Results of a function of one argument, so many points at once, until an end is asked for."""
    asked: list[bool] = []
    parts = []
    # inside CasADi it would be a RuntimeError, or a failed iteration
    with on_interrupt(lambda: asked.append(True)):
        for first in range(0, max(len(q), 1), size):
            parts.append(function(q[first : first + size]))
            if asked:
                raise KeyboardInterrupt
    return [np.concatenate(results) for results in zip(*parts, strict=True)]
