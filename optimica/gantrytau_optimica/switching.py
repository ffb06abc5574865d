"""The switching structure of a solution: where inputs and limits change between lower limit, upper limit and neither."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau_optimica.playback import limits_of, range_of
from gantrytau_optimica.sorting import bare_limit, signal_limits
from gantrytau_optimica.trajectory import Trajectory

AT_LIMIT = 1e-4  # of its range, from which on a limit counts as reached


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
        side = _sides(ends, low, high)
        found += _changes(signal.name, side, ends, (low, high), borders)
    return found


def _sides(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """-1, 0 or 1: at the lower limit, between, at the upper limit."""
    width = high - low if np.isfinite(low) and np.isfinite(high) else max(np.max(np.abs(values)), 1e-9)
    side = np.zeros(values.shape, int)
    if np.isfinite(low):
        side[values <= low + AT_LIMIT * width] = -1
    if np.isfinite(high):
        side[values >= high - AT_LIMIT * width] = 1
    return side


def _changes(
    name: str, side: np.ndarray, ends: np.ndarray, limits: tuple[float, float], borders: np.ndarray
) -> list[Switch]:
    """Switches of one input. An element that is mixed between two that are not holds one in its inside."""
    whole = np.where(side[:, 0] == side[:, 1], side[:, 0], 0)
    found: list[Switch] = []
    k, n = 0, whole.size
    while k < n - 1:
        if whole[k] == whole[k + 1]:
            k += 1
            continue
        before, after = int(whole[k]), int(whole[k + 1])
        share = borders[k + 1]
        if before and not after and k + 2 < n and whole[k + 2] and whole[k + 2] != before:
            # one element on the way from one limit to the other: the switch is where its mean lies between them
            after = int(whole[k + 2])
            low, high = limits
            mean = np.clip((ends[k + 1].mean() - low) / (high - low), 0.02, 0.98)
            part = mean if before > 0 else 1 - mean
            share = borders[k + 1] + part * (borders[k + 2] - borders[k + 1])
            k += 1
        found.append(Switch(float(share), name, SIDES[before], SIDES[after]))
        k += 1
    return found


def _of_limits(trajectory: Trajectory) -> list[Switch]:
    """Limits on states and expressions: stretches of collocation points at which they are reached."""
    phase = trajectory.phase
    inputs = {s.name for s in phase.inputs}
    limits = [
        limit
        for limit in limits_of(phase)
        if (bare := bare_limit(limit, phase)) is None or bare[0] not in inputs
    ]
    if not limits:
        return []
    shares = trajectory.fractions
    rows = trajectory.values(ca.vertcat(*(limit.expression for limit in limits)), trajectory.time)
    found = []
    for limit, row in zip(limits, rows, strict=True):
        width = range_of(limit, row)
        side = _sides(row / width, limit.lower / width, limit.upper / width)
        for k in np.flatnonzero(np.diff(side)):
            share = 0.5 * (shares[k] + shares[k + 1])
            found.append(Switch(float(share), limit.name, SIDES[int(side[k])], SIDES[int(side[k + 1])]))
    return found
