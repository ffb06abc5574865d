"""A run that goes on with other constraints, where those that were kept at the start do not hold a mechanism any more.

Of constraints that repeat each other some are left out, which may be any of them at one pose and not at another: of the six
residuals of Bennett's linkage no three hold it all the way round. Where a run stops for that, it goes back to where those
that were kept are still sound, others are chosen there, and it starts anew.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.compiler.redundancy import soundness
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.results.result import Result
from gantrytau.simulation.integration import Run
from gantrytau.simulation.to_result import result_of

SOUND = 0.1  # of the independence of all constraints, that those kept must have where others take their place
LOOKED_AT = 64  # places of a run at most


def other_constraints(run: Run) -> tuple[np.ndarray, Translated] | None:
    """Times that are left of a run that stopped, and the model from the first of them on with other constraints; None where
    there are no others. The times are places of the run, as even as these.
    """
    dae = run.coordinates.dae
    if not dae.redundant or dae.flat.sampled or dae.flat.whens or not run.done:
        return None
    places = np.unique(np.linspace(0, run.done, min(run.done, LOOKED_AT) + 1).astype(int))
    course = _numbers(run, places)
    sound = soundness(dae.flat, dae.table, frozenset(dae.known), dae.redundant, course)
    there = int(np.flatnonzero(sound > SOUND)[-1]) if np.any(sound > SOUND) else 0
    # where those that were kept are sound to the end, the choice is not why it stops
    if places[there] in (0, run.done):
        return None
    flat = replace(dae.flat, initial_equations=())
    try:
        found = translate_flat(flat, dae.request, course[there], course[: there + 1])
    except (StructureError, InitializationError):
        return None
    if {e.name for e in found.redundant} == {e.name for e in dae.redundant}:
        return None
    return np.unique(run.trail.t[places[there] :]), found


def _numbers(run: Run, places: np.ndarray) -> list[dict[str, float]]:
    """All variables and their derivatives by name at some places."""
    trail = run.trail
    rows = trail.t[places], trail.x[places], trail.z[places], trail.rows(places)
    found = result_of(run.coordinates, *rows, None)
    return [{name: float(found[name][k]) for name in found.names} for k in range(len(places))]


def joined(parts: Sequence[Result], grid: np.ndarray) -> Result:
    """Results of runs one after another, at the times of a grid."""
    if len(parts) == 1:
        return parts[0]
    ends = [*(part.time[0] for part in parts[1:]), np.inf]
    rows = [(part.time < end) & np.isin(part.time, grid) for part, end in zip(parts, ends, strict=True)]
    names = [name for name in parts[0].names if all(name in part for part in parts)]
    values = {
        name: np.concatenate([part[name][kept] for part, kept in zip(parts, rows, strict=True)])
        for name in names
    }
    times = np.concatenate([part.time[kept] for part, kept in zip(parts, rows, strict=True)])
    first = parts[0].select(names)
    words = {name: first.description(name) for name in names}
    own: dict[str, Any] = dict(title=first.title, held=first.held, ended=parts[-1].ended, modes=first.modes)
    own |= dict(shapes=first.shapes, displays={name: first.display(name) for name in names})
    own["limits"] = first.limits
    return Result(times, values, units=first.units, descriptions=words, **own)
