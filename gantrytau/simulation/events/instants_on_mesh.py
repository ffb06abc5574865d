"""The instants at which sampled variables take new values, laid into the mesh of a simulation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau.border.refusal import ModelError

SAME = 1e-9  # of the shortest period, below which two times are one: 0.1 + 0.2 is not 0.3
MOST = 10_000_000  # instants of one simulation


@dataclass(frozen=True, eq=False)
class Instants:
    """mesh: times (n,) in s, with all instants among them; due: which variables are sampled there, (n, variables)."""

    mesh: np.ndarray
    due: np.ndarray


def instants(mesh: np.ndarray, names: Sequence[str], periods: np.ndarray) -> Instants:
    """A mesh of times with the instants mesh[0] + k * period of each variable added to it.

    Instants that differ by rounding only, from a time of the mesh or among rates, are one. ModelError for a
    period so short that the simulation would not end.
    """
    begin, end = mesh[0], mesh[-1]
    same = max(SAME * np.min(periods, initial=np.inf), _rounding(mesh))
    times: dict[float, np.ndarray] = {}
    for name, period in zip(names, periods.tolist(), strict=True):
        if (end - begin) / period > MOST or period < 4 * same:
            raise ModelError(
                f"{name} is sampled every {period:g} s, more than {MOST} times until {end:g} s; take a longer period or "
                "a shorter time"
            )
        count = int(np.floor((end + same - begin) / period))
        times[period] = begin + period * np.arange(count + 1)
    for some in times.values():
        new = some[np.abs(mesh[_nearest(mesh, some)] - some) > same]
        mesh = np.union1d(mesh, new)
    due = np.zeros((mesh.size, len(names)), dtype=bool)
    for column, period in enumerate(periods.tolist()):
        due[_nearest(mesh, times[period]), column] = True
    return Instants(mesh, due)


def on_mesh(mesh: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Times, those that differ from one of the mesh by rounding only put there."""
    near = mesh[_nearest(mesh, times)]
    return np.where(np.abs(near - times) <= _rounding(mesh), near, times)


def _rounding(mesh: np.ndarray) -> float:
    """Tolerance below which two times of a mesh are the same, s."""
    return 8 * float(np.spacing(max(abs(mesh[0]), abs(mesh[-1]))))


def _nearest(mesh: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Places of the mesh (n > 1) that are nearest to some times."""
    after = np.clip(np.searchsorted(mesh, times), 1, mesh.size - 1)
    return np.where(times - mesh[after - 1] < mesh[after] - times, after - 1, after)
