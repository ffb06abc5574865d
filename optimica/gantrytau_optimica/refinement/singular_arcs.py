"""Inputs on singular arcs: continuous, as the objective hardly feels how they jump between elements.

    d2/dt2 H_u = a + b u = 0 on an arc:  an error of H_u of order h^3 is one of u of order h

An arc begins inside of an element, whose mean of the input tells where: borders stand there in the end.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from gantrytau_optimica.answers.playback.arcs import NEAR, arcs, input_sides
from gantrytau_optimica.answers.playback.switches import input_range
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.trajectory import Trajectory

FEWEST = 8  # elements of an arc whose ends are told from its inside
MIXED = 2  # elements beside the end of an arc that feel it
TELLING = 7  # elements from the end of an arc, up to which one tells the course there
CLOSE = 0.1  # of an element: borders closer to the end of an arc give way to it
SAME = 1e-9  # of the horizon, by rounding

Stretch = tuple[str, float, float]  # an input, and shares of the horizon from and to which it is smooth


def continuous_on_arcs(
    problem: ControlProblem, stretches: list[list[Stretch]], meshes: list[Mesh]
) -> ControlProblem:
    """The problem with ramps that are continuous on stretches, by phase, and may jump at all other borders."""

    def changed(phase: Phase, smooth: list[Stretch], mesh: Mesh) -> Phase:
        inner, inputs = mesh.borders[1:-1], []
        for signal in phase.inputs:
            if signal.pieces.kind == "ramps":
                ends = [(begin, end) for name, begin, end in smooth if name == signal.name]
                on = [(inner > begin + SAME) & (inner < end - SAME) for begin, end in ends]
                jumps = ~np.any(on, axis=0) if on else np.ones(inner.size, bool)
                borders = () if jumps.all() else (0.0, *inner[jumps].tolist(), 1.0)
                signal = replace(signal, pieces=Pieces("ramps", borders=borders))
            inputs.append(signal)
        return replace(phase, inputs=tuple(inputs))

    phases = map(changed, problem.phases, stretches, meshes)
    return replace(problem, phases=tuple(phases))


def inside_of_arcs(trajectory: Trajectory) -> list[Stretch]:
    """Stretches of singular arcs but for elements beside the end of an arc of any input: a law may jump inside of them."""
    borders = trajectory.mesh.borders
    return [(n, borders[i + (i > 0)], borders[j - (j + 1 < borders.size)]) for n, i, j in _runs(trajectory)]


def whole_arcs(trajectory: Trajectory) -> list[Stretch]:
    """Stretches of singular arcs up to where the means of inputs over the elements at their ends tell that they end."""
    borders = trajectory.mesh.borders
    n, found = trajectory.mesh.elements, []
    for name, i, j in _runs(trajectory):
        if j - i < FEWEST:
            continue
        values, limits = _ramps(trajectory, name)
        begin = borders[i] + _at_limit(borders, values, i, limits)
        end = borders[j] - _at_limit(1 - borders[::-1], values[::-1, ::-1], n - j, limits)
        found.append((name, begin, end))
    return found


def with_borders_at(stretches: list[Stretch], mesh: Mesh) -> Mesh:
    """The mesh with borders at the ends of stretches."""
    borders = mesh.borders
    for end in sorted({end for _, *ends in stretches for end in ends}):
        k = int(np.clip(np.searchsorted(borders, end), 1, borders.size - 1))
        off = np.abs(borders - end)
        near = off <= CLOSE * (borders[k] - borders[k - 1])
        if not (near[0] or near[-1]) and off.min() > SAME:
            borders = np.sort(np.append(borders[~near], end))
    return Mesh(borders)


def _runs(trajectory: Trajectory) -> list[tuple[str, int, int]]:
    """Inputs on singular arcs, and the borders between which no arc of any input ends."""
    borders, found = trajectory.mesh.borders, []
    knots, _ = input_sides(trajectory)
    for arc in arcs(trajectory):
        if arc.side == "singular":
            begin, end = np.interp([arc.begin, arc.end], trajectory.times(borders), borders)
            cuts = np.array([begin, *knots[(knots > begin + SAME) & (knots < end - SAME)], end])
            at = np.argmin(np.abs(borders[:, None] - cuts), axis=0).tolist()
            found += [(arc.name, i, j) for i, j in pairwise(at) if j - i > 2]
    return found


def _ramps(trajectory: Trajectory, name: str) -> tuple[np.ndarray, tuple[float, float]]:
    """Values (n, 2) of an input at the ends of its elements, and its limits."""
    phase = trajectory.phase
    number = next(k for k, s in enumerate(phase.signals) if s.name == name)
    values = trajectory.w[trajectory.layout.tracks[number].unknowns]
    return values[:, [0, -1]], signal_limits(phase, trajectory.problem.name)[name]


def _at_limit(borders: np.ndarray, values: np.ndarray, first: int, limits: tuple[float, float]) -> float:
    """How long an input is still at the limit that it comes from where element `first` begins."""
    width = input_range(values, *limits)
    near = [x for x in limits if first > 0 and abs(values[first - 1].mean() - x) <= NEAR * width]
    mixed, after = slice(first, first + MIXED), slice(first + MIXED, first + TELLING)
    middles, means = (borders[:-1] + borders[1:]) / 2 - borders[first], values.mean(axis=1)
    course = np.polynomial.Polynomial.fit(middles[after], means[after], 2)
    widths = np.diff(borders)[mixed]
    gap = near[0] - course(0.0) if near else 0.0
    if abs(gap) <= NEAR * width:
        return 0.0
    return float(np.clip(widths @ (means[mixed] - course(middles[mixed])) / gap, 0.0, widths.sum()))
