"""Sizes of the states of a model: errors below the tolerance times the size do not count."""

import math
from collections.abc import Iterable

import casadi as ca
import numpy as np

from gantrytau.compiler.translated import Translated
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.time_grid import Trail

SMALL = 1e-3  # of the size that is taken, if nothing is said: what stays below has another one
LEAST = 1e-6  # of the largest state that it hangs together with: a smaller one may be rounding
ROUNDING = 8 * np.finfo(float).eps  # of the largest start among such states: a smaller one is rounding
STEP = 0.002  # of a run: a step of the integrator through the rounding errors of the rates
LOOKED_AT = 64  # places of a run at most, at which rates are asked for their rounding


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
    wished, started = dae.asked.wished or dae.asked.values, dae.asked.started
    given = np.array([wished[n] if n in started else 0.0 for n in coordinates.states])
    found = np.array([dae.start[n] for n in coordinates.states])
    # a start that was moved from zero is rounding
    kept = np.where(np.abs(found - given) <= SMALL * np.abs(given), np.abs(given), 0.0)
    small = (0 < kept) & (kept < SMALL)
    for own in _together(coordinates) if small.any() else ():
        small[own] &= kept[own] > ROUNDING * np.abs(found[own]).max()
    return _rounded(
        nominal.get(n) or (kept[k] if small[k] else 1.0) for k, n in enumerate(coordinates.states)
    )


def seen_sizes(
    coordinates: Coordinates, trail: Trail, done: int, tolerance: float
) -> tuple[float, ...] | None:
    """Sizes of the states after a run up to a place, if those before were much too large; else None.

    States that hang together are asked together: a small one among large ones may be nothing but rounding, and keeps its
    size; so are all where rates are lost in rounding: an integrator would follow that in ever smaller steps.
    """
    before, largest = np.array(coordinates.sizes), np.abs(trail.x[: done + 1]).max(axis=0)
    if not np.any((largest > 0) & (largest < SMALL * before)):
        return None
    known, found = nominal_sizes(coordinates.dae), before.copy()
    step = STEP * float(trail.t[done] - trail.t[0])
    least = _noise(coordinates, trail, done) * step / tolerance
    for own in _together(coordinates):
        top = max(largest[own].max(), least[own].max())
        if 0 < top and np.all(np.maximum(largest, least)[own] < SMALL * before[own]):
            free = np.array([coordinates.states[k] not in known for k in own])
            sizes = np.maximum(largest[own], max(LEAST * top, least[own].max()))
            found[own[free]] = sizes[free]
    return None if np.array_equal(_rounded(found), before) else _rounded(found)


def _together(coordinates: Coordinates) -> list[np.ndarray]:
    """Places of the states that hang together, an array each."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(coordinates.states)
    if coordinates.algebraics:  # they join all that they depend on, and all that depends on them
        return [np.arange(n)]
    rows, columns = map(np.array, ca.jacobian_sparsity(coordinates.ode, coordinates.x).get_triplet())
    joined = csr_matrix((np.ones(rows.size), (rows, columns)), shape=(n, n))
    count, label = connected_components(joined, directed=False)
    return [np.flatnonzero(label == one) for one in range(count)]


def _noise(coordinates: Coordinates, trail: Trail, done: int) -> np.ndarray:
    """What rounding makes of the rates, (n,) in units of the states per s: their change where all that they follow from is
    another by its rounding.
    """
    places = np.unique(np.linspace(0, done, LOOKED_AT).astype(int))
    x, z, t, w = trail.x[places], trail.z[places], trail.t[places, None], trail.rows(places)
    found = []
    for sign in (-2, -1, 0, 1, 2):
        near = 1 + sign * np.finfo(float).eps
        found.append(coordinates.rates(x * near, z * near, t * near, t, w)[0])
    return np.nan_to_num(np.ptp(found, axis=0)).max(axis=0)


def _rounded(sizes: Iterable[float]) -> tuple[float, ...]:
    """The nearest powers of two: to divide by them makes no error."""
    return tuple(2.0 ** round(math.log2(size)) for size in sizes)
