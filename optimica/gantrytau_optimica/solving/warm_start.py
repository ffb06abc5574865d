"""A solution carried over to another mesh, as the first guess of the next solve."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory

INSIDE = 1e-9  # of an element: a value at a border is read from its own side


def warm_start(trajectories: Sequence[Trajectory], program: Program) -> np.ndarray:
    """Unknowns of `program` from a solution of the same problem on other meshes, inside of their bounds."""
    places = program.places
    w = np.zeros(places.size)
    w[places.free] = trajectories[0].numbers
    for old, layout in zip(trajectories, places.layouts, strict=True):
        borders = layout.mesh.borders
        w[layout.knots] = borders[list(layout.mesh.moving)]
        for number, track in enumerate(layout.tracks):
            element = np.repeat(np.arange(layout.mesh.elements), track.nodes.shape[1])
            place = np.clip(track.nodes.ravel(), INSIDE, 1 - INSIDE)
            times = old.times(borders[element] + place * layout.mesh.widths[element])
            w[track.unknowns.ravel()] = old.signals(times)[number]
        if len(layout.phase.states):
            w[layout.starts] = old.signals(old.times(borders))[: len(layout.phase.states)].T
    return np.clip(w, program.lbw * places.scale, program.ubw * places.scale)
