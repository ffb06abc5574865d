"""A function of CasADi at many places, from and to memory of NumPy: its own way there takes longer than most functions."""

from threading import Lock

import casadi as ca
import numpy as np

MANY = 100  # places, for which it pays to make a function of all


class AtPlaces:
    """A function with memory of its own for one place; all arguments are dense columns, all results dense."""

    def __init__(self, function: ca.Function):
        self.function = function
        self._given = [np.zeros(function.numel_in(k)) for k in range(function.n_in())]
        self._found = [np.zeros(function.numel_out(k)) for k in range(function.n_out())]
        self._lock = Lock()
        memory, self._go = function.buffer()
        self._memory = memory  # lives as long as what calls it
        for k, array in enumerate(self._given):
            memory.set_arg(k, array.data)
        for k, array in enumerate(self._found):
            memory.set_res(k, array.data)

    def __call__(self, *arguments: np.ndarray | float) -> list[np.ndarray]:
        """Values (places, elements) of each result, matrices column after column.

        arguments: (places, n) each, (places,) for numbers, or what is the same at all places: (1, n), or a number. At
        least the first has a row for each place.
        """
        places = len(arguments[0])  # type: ignore[arg-type]
        found = [np.empty((places, array.size)) for array in self._found]
        if places >= MANY:
            self._together(places, arguments, found)
            return found
        with self._lock:
            for k in range(places):
                for own, array in zip(self._given, arguments, strict=True):
                    own[:] = array[k] if isinstance(array, np.ndarray) and len(array) == places else array
                self._go()
                for one, own in zip(found, self._found, strict=True):
                    one[k] = own
        return found

    def _together(
        self, places: int, arguments: tuple[np.ndarray | float, ...], found: list[np.ndarray]
    ) -> None:
        memory, go = self.function.map(places).buffer()
        given = []
        for own, array in zip(self._given, arguments, strict=True):
            rows = np.reshape(array, (-1, own.size)) if own.size else np.zeros((places, 0))
            given.append(np.ascontiguousarray(np.broadcast_to(rows, (places, own.size)), dtype=float))
        for k, array in enumerate(given):
            memory.set_arg(k, array.data)
        for k, array in enumerate(found):
            memory.set_res(k, array.data)
        go()


def at_places(function: ca.Function, *arguments: np.ndarray | float) -> list[np.ndarray]:
    """Values of a function that is asked seldom, see `AtPlaces`."""
    return AtPlaces(function)(*arguments)
