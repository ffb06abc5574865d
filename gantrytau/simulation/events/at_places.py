"""A function of CasADi at many places, from and to memory of NumPy: its own way there takes longer than most functions."""

import casadi as ca
import numpy as np

MANY = 100  # places, for which it pays to make a function of all


def at_places(function: ca.Function, *arguments: np.ndarray) -> list[np.ndarray]:
    """Values (places, elements) of each result, matrices column after column, at arguments (places, n) each.

    All arguments and results are dense, an argument a column or a number.
    """
    places = len(arguments[0])
    found = [np.zeros((places, function.numel_out(k))) for k in range(function.n_out())]
    given = [np.ascontiguousarray(a, dtype=float) for a in arguments]
    together = places >= MANY
    memory, go = function.map(places).buffer() if together else function.buffer()
    for here in (slice(None),) if together else range(places):
        for k, array in enumerate(given):
            memory.set_arg(k, array[here].data)
        for k, array in enumerate(found):
            memory.set_res(k, array[here].data)
        go()
    return found
