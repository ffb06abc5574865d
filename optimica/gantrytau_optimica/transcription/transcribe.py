"""A control problem on meshes becomes a nonlinear program, by the scheme that was chosen."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.transcription.collocate import collocate
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.scheme import Collocation
from gantrytau_optimica.transcription.shooting import Shooting, shoot_steps


def transcribe(
    problem: ControlProblem,
    meshes: Sequence[Mesh],
    scheme: Collocation,
    located: tuple[np.ndarray, Sequence[np.ndarray]] | None = None,
) -> Program:
    """The nonlinear program of `problem` on one mesh per phase; those of shooting hold the steps already.

    located: free numbers, and borders by phase, for which points at moving times are looked up (default: the guess).
    """
    if isinstance(scheme, Shooting):
        return shoot_steps(problem, meshes, scheme)
    return collocate(problem, meshes, scheme, located)
