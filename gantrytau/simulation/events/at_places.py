"""A function of CasADi at many places, from and to memory of NumPy: its own way there takes longer than most functions."""

from collections.abc import Callable
from threading import Lock

import casadi as ca
import numpy as np

FEW, MANY = 128, 1024  # places in one call of a function that is made for so many


class AtPlaces:
    """A function with memory of its own; all arguments are dense columns, all results dense."""

    def __init__(self, function: ca.Function):
        self.function = function
        self._lock = Lock()
        self._memories = {1: self._memory(1)}

    def _memory(self, size: int) -> tuple[list[np.ndarray], list[np.ndarray], Callable[[], None], object]:
        """Arguments and results of a call at so many places, a row each, the call, and what lives as long as it."""
        f = self.function
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
        size = 1 if places < FEW else FEW if places < MANY else MANY
        with self._lock:
            if size not in self._memories:
                self._memories[size] = self._memory(size)
            given, results, go, _ = self._memories[size]
            found = [np.empty((places, array.shape[1])) for array in results]
            for first in range(0, places, size):
                count = min(size, places - first)
                for own, array in zip(given, arguments, strict=True):
                    if not (isinstance(array, np.ndarray) and len(array) == places):
                        own[:] = array
                    elif size == 1:
                        own[0] = array[first]
                    else:
                        own[:count] = np.reshape(array[first : first + count], (count, own.shape[1]))
                go()
                for one, own in zip(found, results, strict=True):
                    one[first : first + count] = own[:count]
        return found


def at_places(function: ca.Function, *arguments: np.ndarray | float) -> list[np.ndarray]:
    """Values of a function that is asked seldom, see `AtPlaces`."""
    return AtPlaces(function)(*arguments)
