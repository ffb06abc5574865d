"""The program of a structure that is known: inputs held at their limits on arcs, borders between arcs as unknowns.

    minimise over switching times and what is between limits;  on an arc at a limit  u = limit

A border that moves and an input that is free beside it say the same: only one of them may be chosen.
"""

from dataclasses import replace

import numpy as np

from gantrytau_optimica.answers.playback.arcs import input_sides
from gantrytau_optimica.answers.playback.replay import Replayed
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.refinement.remesh import at_knots, zoomed
from gantrytau_optimica.transcription.layout import Layout
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory

SLIP = 1e-6  # of the largest multiplier: by how much one may have the wrong sign


def arc_mesh(played: Replayed, accuracy: float) -> Mesh | None:
    """Borders at the ends of all arcs of inputs, which move, other elements as their errors ask; None without arcs."""
    knots, _ = input_sides(played.trajectory)
    if not knots.size:
        return None
    borders = at_knots(played, accuracy, knots)
    moving = np.searchsorted(borders, knots)
    return Mesh(borders, tuple(int(k) for k in moving))


def zoom_mesh(played: Replayed, accuracy: float) -> Mesh | None:
    """A mesh on which arcs can be told from what coarse elements make of them; None without arcs."""
    knots, _ = input_sides(played.trajectory)
    return zoomed(played, accuracy, knots) if knots.size else None


def with_arcs(problem: ControlProblem, trajectories: list[Trajectory], meshes: list[Mesh]) -> ControlProblem:
    """The problem with inputs that are continuous on arcs between limits: their jumps there would be noise of the mesh."""

    def changed(phase: Phase, trajectory: Trajectory, mesh: Mesh) -> Phase:
        _, sides = input_sides(trajectory)
        inner = mesh.borders[1:-1]
        moves = np.isin(np.arange(1, mesh.elements), mesh.moving)
        inputs = []
        for signal in phase.inputs:
            side = sides[signal.name].at(_middles(mesh))
            jumps = moves | (np.diff(side) != 0) | (side[1:] != 0)
            pieces = Pieces("ramps", borders=(0.0, *inner[jumps].tolist(), 1.0))
            inputs.append(replace(signal, pieces=pieces))
        return replace(phase, inputs=tuple(inputs))

    phases = map(changed, problem.phases, trajectories, meshes)
    return replace(problem, phases=tuple(phases))


def held_at_limits(program: Program, trajectories: list[Trajectory]) -> Program:
    """The program with inputs held at their limits on arcs."""
    lower, upper = program.lbw.copy(), program.ubw.copy()
    for unknowns, side, limit in _held(program, trajectories):
        del side
        lower[unknowns] = upper[unknowns] = limit / program.places.scale[unknowns]
    return replace(program, lbw=lower, ubw=upper)


def wrong_signs(program: Program, trajectories: list[Trajectory], multipliers: np.ndarray) -> bool:
    """Whether an input would rather leave the limit at which it is held, by bound multipliers (n,)."""
    largest, worst = 0.0, 0.0
    for unknowns, side, _ in _held(program, trajectories):
        pulls = multipliers[unknowns].sum(axis=1) * side  # by the whole element: the ends of a ramp share it
        largest = max(largest, float(np.max(np.abs(pulls), initial=0.0)))
        worst = max(worst, float(np.max(-pulls, initial=0.0)))
    return worst > SLIP * largest


def _held(program: Program, trajectories: list[Trajectory]) -> list[tuple[np.ndarray, int, float]]:
    """Unknowns (k, 2) of inputs on arcs at a limit, -1 or 1 for its side, and the limit."""
    found = []
    for layout, trajectory in zip(program.places.layouts, trajectories, strict=True):
        _, sides = input_sides(trajectory)
        limits = signal_limits(trajectory.phase, trajectory.problem.name)
        for number, signal in enumerate(layout.phase.inputs, _first_input(layout)):
            side = sides[signal.name].at(_middles(layout.mesh))
            for which, limit in zip((-1, 1), limits[signal.name], strict=True):
                if np.any(side == which):
                    found.append((layout.tracks[number].unknowns[side == which], which, limit))
    return found


def _first_input(layout: Layout) -> int:
    return len(layout.phase.states) + len(layout.phase.algebraics)


def _middles(mesh: Mesh) -> np.ndarray:
    return (mesh.borders[:-1] + mesh.borders[1:]) / 2
