"""The arcs of a solution: which inputs and limits bind, on which side, from when to when."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau_optimica.answers.playback.ranges import measured
from gantrytau_optimica.answers.playback.switches import changes, input_range
from gantrytau_optimica.control.limits import bare_limit, signal_limits
from gantrytau_optimica.transcription.trajectory import Trajectory

NEAR = 2e-2  # of its range: an input this close to its limit on a mesh is at it
SHORT = 1e-4  # of the horizon: what is shorter is no arc
WORDS = {-1: "min", 0: "between", 1: "max"}


@dataclass(frozen=True)
class Arc:
    """`name` is at its limit or between them from `begin` to `end`, in s.

    side: "max" or "min"; "between" limits; "singular" where an input is between its limits and nothing else binds.
    """

    name: str
    side: str
    begin: float
    end: float

    def __str__(self) -> str:
        return f"{self.name} {self.side} {self.begin:.6g} to {self.end:.6g} s"


@dataclass(frozen=True, eq=False)
class Sides:
    """-1, 0 or 1 on stretches (k,) of the horizon, which end at shares `ends` (k - 1,)."""

    sides: np.ndarray
    ends: np.ndarray

    def at(self, shares: np.ndarray) -> np.ndarray:
        """The side at shares of the horizon, (n,)."""
        return self.sides[np.searchsorted(self.ends, shares)]


def arcs(trajectory: Trajectory) -> list[Arc]:
    """All arcs of inputs that have limits, and those of other limits where they bind, by name and time."""
    _, inputs = input_sides(trajectory)
    limited = signal_limits(trajectory.phase, trajectory.problem.name)
    others = _of_limits(trajectory)
    found: list[Arc] = []
    for name, sides in inputs.items():
        if not np.any(np.isfinite(limited[name])):
            continue
        borders = np.concatenate([[0.0], sides.ends, [1.0]])
        for side, begin, end in zip(sides.sides, borders[:-1], borders[1:], strict=True):
            begin, end = trajectory.times(np.array([begin, end])).tolist()
            word = WORDS[int(side)]
            if word == "between" and _singular(trajectory, name, (begin + end) / 2, others):
                word = "singular"
            found.append(Arc(name, word, begin, end))
    return [*found, *others]


def _singular(trajectory: Trajectory, name: str, middle: float, others: list[Arc]) -> bool:
    """Whether nothing else binds in the middle of an arc, and no equation or cost is curved by the input."""
    phase = trajectory.phase
    symbol = next(s.symbol for s in phase.inputs if s.name == name)
    straight = ca.is_linear(ca.vertcat(phase.ode, phase.residuals, phase.integrand), symbol)
    return straight and not any(a.begin <= middle <= a.end for a in others)


def input_sides(trajectory: Trajectory) -> tuple[np.ndarray, dict[str, Sides]]:
    """Shares of the horizon at which inputs begin or end an arc, (k,), and the sides of each input by its name."""
    phase, borders = trajectory.phase, trajectory.mesh.borders
    limits = signal_limits(phase, trajectory.problem.name)
    first = len(phase.states) + len(phase.algebraics)
    found: dict[str, Sides] = {}
    for number, signal in enumerate(phase.inputs, first):
        low, high = limits[signal.name]
        track = trajectory.layout.tracks[number]
        ends = trajectory.w[track.unknowns][:, [0, -1]]
        width = input_range(ends, low, high)
        side = np.where(ends <= low + NEAR * width, -1, np.where(ends >= high - NEAR * width, 1, 0))
        whole = np.where(side[:, 0] == side[:, 1], side[:, 0], 0)
        switched = changes(signal.name, side, ends, (low, high), borders)
        shares = np.array([s.share for s in switched])
        names = {"lower": -1, "between": 0, "upper": 1}
        found[signal.name] = Sides(np.array([whole[0], *(names[s.after] for s in switched)]), shares)
    every = np.sort(np.concatenate([np.zeros(0), *(s.ends for s in found.values())]))
    every = every[(every > SHORT) & (every < 1 - SHORT)]
    apart = np.concatenate([[True], np.diff(every) > SHORT])[: every.size]
    return every[apart], found


def _of_limits(trajectory: Trajectory) -> list[Arc]:
    """Limits on states and expressions, where they bind at one collocation point after another."""
    phase, times = trajectory.phase, trajectory.time
    names = {s.name for s in phase.inputs}
    found: list[Arc] = []
    for limit, row, size in measured(trajectory, lambda e: trajectory.values(e, times)):
        bare = bare_limit(limit, phase)
        if limit.lower == limit.upper or (bare is not None and bare[0] in names):
            continue
        near = 1e-4 * size
        side = np.where(row <= limit.lower + near, -1, np.where(row >= limit.upper - near, 1, 0))
        starts = np.concatenate([[0], np.flatnonzero(np.diff(side)) + 1])
        stops = np.append(starts[1:], side.size) - 1
        for a, b in zip(starts, stops, strict=True):
            if side[a] and b > a:
                found.append(Arc(limit.name, WORDS[int(side[a])], float(times[a]), float(times[b])))
    return found
