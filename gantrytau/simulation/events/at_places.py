"""A function of CasADi at many places, from and to memory of NumPy: its own way there takes longer than most functions."""

from collections.abc import Callable, Sequence
from threading import Lock

import casadi as ca
import numpy as np

from gantrytau.kernels import Kernel

SIZES = 64, 8, 1  # places in one call: to make CasADi's map of more takes longer than it saves


class AtPlaces:
    """A function with memory of its own, by its kernel where there is one; all arguments are dense columns, all results
    dense.
    """

    def __init__(self, function: ca.Function):
        self.function = function
        self._widths = [function.numel_out(k) for k in range(function.n_out())]
        self._lock = Lock()
        written = function.is_a("SXFunction") or function.is_a("MXFunction")
        self._kernel = Kernel(function) if written else None
        self._memories = {1: self._memory(function, 1)}

    @staticmethod
    def _memory(
        f: ca.Function, size: int
    ) -> tuple[list[np.ndarray], list[np.ndarray], Callable[[], None], ca.FunctionBuffer]:
        """Arguments and results of a call at so many places, a row each, the call, and what lives as long as it."""
        given = [np.zeros((size, f.numel_in(k))) for k in range(f.n_in())]
        found = [np.zeros((size, f.numel_out(k))) for k in range(f.n_out())]
        memory, go = (f if size == 1 else f.map(size)).buffer()
        for k, array in enumerate(given):
            memory.set_arg(k, array.data)
        for k, array in enumerate(found):
            memory.set_res(k, array.data)
        return given, found, go, memory

    def __call__(self, *arguments: np.ndarray | float) -> list[np.ndarray]:
        """Values (places, elements) of each result, matrices column after column.

        arguments: (places, n) each, (places,) for numbers, or what is the same at all places: (1, n), or a number. At
        least the first has a row for each place.
        """
        places = len(arguments[0])  # type: ignore[arg-type]
        found = [np.empty((places, width)) for width in self._widths]
        rows = [a[:, None] if isinstance(a, np.ndarray) and a.ndim == 1 else a for a in arguments]
        with self._lock:
            if self._kernel is not None and self._kernel.called(places):
                self._memories.clear()
            first = 0
            for size in SIZES:
                if size <= places - first:
                    last = places - (places - first) % size
                    self._fill(size, range(first, last, size), rows, found)
                    first = last
        return found

    def compiled(self) -> bool:
        """Wait for the kernel; whether it is there."""
        with self._lock:
            there = self._kernel is not None and self._kernel.wait()
            if there:
                self._memories.clear()
            return there

    def _fill(
        self, size: int, firsts: range, rows: Sequence[np.ndarray | float], found: list[np.ndarray]
    ) -> None:
        """Results from the first places on, so many in a call; rows: arguments with one for each place, or for all."""
        if size not in self._memories:
            self._memories[size] = self._memory(
                self._kernel.function if self._kernel else self.function, size
            )
        given, results, go, memory = self._memories[size]
        places = len(found[0])
        varying = []
        for own, array in zip(given, rows, strict=True):
            if isinstance(array, np.ndarray) and len(array) == places:
                varying.append((own, array))
            else:
                own[:] = array
        for first in firsts:
            for own, array in varying:
                own[:] = array[first : first + size]
            go()
            if memory.ret():  # as a kernel says what CasADi raises
                raise RuntimeError(f"{self.function.name()} failed")
            for one, own in zip(found, results, strict=True):
                one[first : first + size] = own
