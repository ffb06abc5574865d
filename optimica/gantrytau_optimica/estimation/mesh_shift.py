"""How far an estimate lies off because the motion is computed on a mesh: one step towards that of half the elements.

    r': residuals on the halved mesh at the same parameters;  dp = -(J'J)^-1 J' (r' - r)

A step of Gauss and Newton: collocation loses at least a factor of four with half the length, so dp is most of the error.
"""

import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.estimation.residuals import residuals
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.transcribe import transcribe


def mesh_shift(
    optimum: Optimum, problem: ControlProblem, jacobian: np.ndarray, errors: np.ndarray
) -> np.ndarray:
    """What the parameters of the columns of `jacobian` (N, k) change on a mesh of half the lengths, about; (k,).

    problem: that of the optimum with deviations as they were given; errors: its residuals (N,). The result is NaN
    where the motion on the other mesh is not found.
    """
    program = optimum.program
    meshes = [_halved(layout.mesh) for layout in program.places.layouts]
    finer = residuals(transcribe(problem, meshes, program.places.layouts[0].scheme))
    near = warm_start(list(optimum.phases.values()), finer.program)
    w = finer.on_manifold(near, optimum.solution.w[program.places.free])
    if w is None:
        return np.full(jacobian.shape[1], np.nan)
    return -np.linalg.lstsq(jacobian, finer.values(w) - errors, rcond=None)[0]


def _halved(mesh: Mesh) -> Mesh:
    """Every element cut into two."""
    middles = (mesh.borders[:-1] + mesh.borders[1:]) / 2
    return Mesh(np.sort(np.concatenate([mesh.borders, middles])), (), mesh.shortest)
