"""A control problem on meshes becomes a nonlinear program, by the method that was chosen."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.transcription.collocate import collocate
from gantrytau_optimica.transcription.lobatto import lobatto
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.scheme import Collocation, gauss, radau
from gantrytau_optimica.transcription.shooting import shoot, shooting

Scheme = Literal["radau", "gauss", "lobatto", "shooting"]
MOST_POINTS = 9  # per element
Located = tuple[np.ndarray, Sequence[np.ndarray]]


@dataclass(frozen=True)
class Method:
    """A transcription method, which a word of Scheme names.

    scheme: points per element -> how a solution is read, and what may be done with the program; rows: (problem, meshes,
    scheme, located) -> program, its rows and their Jacobians; least: points per element.
    """

    scheme: Callable[[int], Collocation]
    rows: Callable[[ControlProblem, Sequence[Mesh], Collocation, Located | None], Program] = collocate
    least: int = 1


METHODS: Mapping[str, Method] = {
    "radau": Method(radau),
    "gauss": Method(gauss),
    "lobatto": Method(lobatto, least=2),
    "shooting": Method(shooting, shoot),
}


def transcribe(
    problem: ControlProblem, meshes: Sequence[Mesh], scheme: Collocation, located: Located | None = None
) -> Program:
    """The nonlinear program of `problem` on one mesh per phase, as the scheme has divided them.

    located: free numbers, and borders by phase, for which points at moving times are looked up (default: the guess).
    """
    return METHODS[scheme.scheme].rows(problem, meshes, scheme, located)


def transcribed_again(
    program: Program,
    problem: ControlProblem | None = None,
    meshes: Sequence[Mesh] | None = None,
    located: Located | None = None,
) -> Program:
    """The problem of a program, or another one, on its meshes, or others, by its method."""
    problem, meshes = problem or program.problem, program.meshes if meshes is None else meshes
    return transcribe(problem, meshes, program.scheme, located)
