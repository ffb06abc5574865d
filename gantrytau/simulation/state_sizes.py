"""How large the states of a model are: below the tolerance of that, their errors do not count."""

import math
from collections.abc import Iterable

import casadi as ca
import numpy as np

from gantrytau.compiler.translated import Translated
from gantrytau.simulation.full_coordinates import Coordinates

SMALL = 1e-3  # of the size that is taken, if nothing is said: what stays below has another one
LEAST = 1e-6  # of the largest state that it hangs together with: a smaller one may be rounding


def nominal_sizes(dae: Translated) -> dict[str, float]:
    """Size by symbol of the reduced equations, of variables with `nominal`."""
    found: dict[str, float] = {}
    for variable in dae.flat.variables:
        for name, nominal in zip(variable.elements, variable.nominal or (), strict=False):
            alias = dae.reduced.aliases.get(name)
            size = abs(dae.table.number(nominal))
            if alias is not None and alias.root is not None and np.isfinite(size) and size > 0:
                found[alias.symbol] = size / abs(alias.factor)
    return found


def first_sizes(coordinates: Coordinates) -> tuple[float, ...]:
    """Sizes of the states before anything is known of the motion: `nominal`, a small start that is given, else 1."""
    dae, nominal = coordinates.dae, nominal_sizes(coordinates.dae)
    given = {n: dae.asked.values[n] for n in coordinates.states if n in dae.asked.started}
    # a start that was moved from zero is rounding
    kept = {n: abs(v) for n, v in given.items() if abs(dae.start[n] - v) <= SMALL * abs(v)}
    small = {n: start for n, start in kept.items() if 0 < start < SMALL}
    return _rounded(nominal.get(n) or small.get(n, 1.0) for n in coordinates.states)


def seen_sizes(coordinates: Coordinates, largest: np.ndarray) -> tuple[float, ...] | None:
    """Sizes of the states after a run, if those before were much too large; else None.

    largest: absolute value of each state in the run, (n,). States that hang together are asked together: a small one
    among large ones may be nothing but rounding, and keeps its size.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    before = np.array(coordinates.sizes)
    if not np.any((largest > 0) & (largest < SMALL * before)):
        return None
    pattern = ca.jacobian_sparsity(ca.vertcat(coordinates.ode, coordinates.algebraic), coordinates.x)
    n, rows, columns = len(before), *map(np.array, pattern.get_triplet())
    if coordinates.algebraics:  # they join all that they depend on, and all that depends on them
        label = np.zeros(n, dtype=int)
    else:
        joined = csr_matrix((np.ones(rows.size), (rows, columns)), shape=(n, n))
        _, label = connected_components(joined, directed=False)
    known = nominal_sizes(coordinates.dae)
    found = before.copy()
    for one in np.unique(label):
        own = np.flatnonzero(label == one)
        top = largest[own].max()
        if 0 < top and np.all(largest[own] < SMALL * before[own]):
            free = np.array([coordinates.states[k] not in known for k in own])
            found[own[free]] = np.maximum(largest[own], LEAST * top)[free]
    return None if np.array_equal(found, before) else _rounded(found)


def _rounded(sizes: Iterable[float]) -> tuple[float, ...]:
    """The nearest powers of two: to divide by them makes no error."""
    return tuple(2.0 ** round(math.log2(size)) for size in sizes)
