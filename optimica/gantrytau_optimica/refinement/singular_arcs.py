"""Inputs on singular arcs: continuous, as the objective hardly feels how they jump between elements.

H_u = 0 on an arc, and H_u does not depend on u:  errors of H_u of order h^3 would be jumps of u of order h
"""

from dataclasses import replace

import numpy as np

from gantrytau_optimica.answers.playback.arcs import arcs, input_sides
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.trajectory import Trajectory

SAME = 1e-9  # of the horizon, by rounding


def continuous_on_arcs(
    problem: ControlProblem, trajectories: list[Trajectory], meshes: list[Mesh]
) -> ControlProblem:
    """The problem with ramps that are continuous inside of singular arcs of a solution, and may jump elsewhere."""

    def changed(phase: Phase, trajectory: Trajectory, mesh: Mesh) -> Phase:
        inside = _inside(trajectory, mesh)
        inputs = []
        for signal in phase.inputs:
            if signal.pieces.kind == "ramps":
                on = inside.get(signal.name, np.zeros(mesh.elements, bool))
                jumps = ~(on[1:] & on[:-1])
                borders = () if jumps.all() else (0.0, *mesh.borders[1:-1][jumps].tolist(), 1.0)
                signal = replace(signal, pieces=Pieces("ramps", borders=borders))
            inputs.append(signal)
        return replace(phase, inputs=tuple(inputs))

    phases = map(changed, problem.phases, trajectories, meshes)
    return replace(problem, phases=tuple(phases))


def _inside(trajectory: Trajectory, mesh: Mesh) -> dict[str, np.ndarray]:
    """Elements (n,) of a mesh on singular arcs, by their input; an element of the solution at which an arc of any input
    ends is left out, as the law may jump inside of it.
    """
    knots, _ = input_sides(trajectory)
    old, times = trajectory.mesh.borders, trajectory.times(mesh.borders)
    mixed = np.any((old[:-1, None] <= knots + SAME) & (knots - SAME <= old[1:, None]), axis=1)
    element, _ = trajectory.mesh.locate((mesh.borders[:-1] + mesh.borders[1:]) / 2)
    middles = (times[:-1] + times[1:]) / 2
    found: dict[str, np.ndarray] = {}
    for arc in arcs(trajectory):
        if arc.side == "singular":
            on = (middles > arc.begin) & (middles < arc.end) & ~mixed[element]
            found[arc.name] = found.get(arc.name, np.zeros(on.size, bool)) | on
    return found
