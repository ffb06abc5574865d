"""The switching structure of a solution: where inputs and limits change between lower limit, upper limit and neither."""

from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.answers.playback.ranges import measured
from gantrytau_optimica.control.limits import bare_limit, signal_limits
from gantrytau_optimica.transcription.trajectory import Trajectory

AT_LIMIT = 1e-4  # of its range, from which on a limit counts as reached
MIXED = 3  # elements between opposite limits that are taken for one switch, not for an arc of its own


@dataclass(frozen=True)
class Switch:
    """A share of the horizon at which `name` changes, from and to one of "lower", "upper" and "between"."""

    share: float
    name: str
    before: str
    after: str


SIDES = {-1: "lower", 0: "between", 1: "upper"}


def switches(trajectory: Trajectory) -> list[Switch]:
    """All switches in order of time: of inputs with limits, and of limits on other expressions."""
    found = [*_of_inputs(trajectory), *_of_limits(trajectory)]
    return sorted(found, key=lambda s: s.share)


def _of_inputs(trajectory: Trajectory) -> list[Switch]:
    """Inputs made of ramps: the side of each element, and where within an element it changes."""
    phase, borders = trajectory.phase, trajectory.mesh.borders
    limits = signal_limits(phase, trajectory.problem.name)
    first = len(phase.states) + len(phase.algebraics)
    found: list[Switch] = []
    for number, signal in enumerate(phase.inputs, first):
        low, high = limits[signal.name]
        if signal.pieces.kind != "ramps" or not (np.isfinite(low) or np.isfinite(high)):
            continue
        ends = trajectory.w[trajectory.layout.tracks[number].unknowns]
        side = sides(ends, low, high, input_range(ends, low, high))
        found += changes(signal.name, side, ends, (low, high), borders)
    return found


def input_range(values: np.ndarray, low: float, high: float) -> float:
    """The range of an input: between its limits, else the size of its values."""
    return high - low if np.isfinite(low) and np.isfinite(high) else float(np.max(np.abs(values)))


def sides(values: np.ndarray, low: float, high: float, width: float) -> np.ndarray:
    """-1, 0 or 1: at the lower limit, between, at the upper limit, to a share of its range `width`."""
    side = np.zeros(values.shape, int)
    if np.isfinite(low):
        side[values <= low + AT_LIMIT * width] = -1
    if np.isfinite(high):
        side[values >= high - AT_LIMIT * width] = 1
    return side


def changes(
    name: str, side: np.ndarray, ends: np.ndarray, limits: tuple[float, float], borders: np.ndarray
) -> list[Switch]:
    """Switches of one input. A few mixed elements between two opposite limits hold one switch: where their mean says."""
    whole = np.where(side[:, 0] == side[:, 1], side[:, 0], 0)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(whole)) + 1])
    stops = np.append(starts[1:], whole.size)
    found: list[Switch] = []
    skip = False
    for k in range(starts.size - 1):
        if skip:
            skip = False
            continue
        before, after = int(whole[starts[k]]), int(whole[starts[k + 1]])
        share = borders[starts[k + 1]]
        mixed = stops[k + 1] - starts[k + 1]
        if (
            before
            and not after
            and mixed <= MIXED
            and k + 2 < starts.size
            and whole[starts[k + 2]] == -before
        ):
            after, skip = -before, True
            widths = np.diff(borders)[starts[k + 1] : stops[k + 1]]
            mean = float(widths @ ends[starts[k + 1] : stops[k + 1]].mean(axis=1)) / float(widths.sum())
            part = np.clip((mean - limits[0]) / (limits[1] - limits[0]), 0.02, 0.98)
            share += (part if before > 0 else 1 - part) * widths.sum()
        found.append(Switch(float(share), name, SIDES[before], SIDES[after]))
    return found


def _of_limits(trajectory: Trajectory) -> list[Switch]:
    """Limits on states and expressions: stretches of collocation points at which they are reached; an equality always is."""
    phase = trajectory.phase
    inputs = {s.name for s in phase.inputs}
    shares, found = trajectory.fractions, []
    for limit, row, size in measured(trajectory, lambda e: trajectory.values(e, trajectory.time)):
        bare = bare_limit(limit, phase)
        if limit.lower == limit.upper or (bare is not None and bare[0] in inputs):
            continue
        side = sides(row, limit.lower, limit.upper, size)
        for k in np.flatnonzero(np.diff(side)):
            share = 0.5 * (shares[k] + shares[k + 1])
            found.append(Switch(float(share), limit.name, SIDES[int(side[k])], SIDES[int(side[k + 1])]))
    return found
