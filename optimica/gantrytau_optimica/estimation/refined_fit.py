"""A fit on better and better meshes, until what it says no longer depends on them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.estimation.fit_on_mesh import MeshFit, Solve, Step, fit_on_mesh
from gantrytau_optimica.estimation.mesh_error import (
    MeshError,
    better_meshes,
    carried_over,
    error_against,
    halved,
    mesh_error,
)
from gantrytau_optimica.estimation.residuals import residuals
from gantrytau_optimica.estimation.weights import Weighing
from gantrytau_optimica.fitting.rank import LocalJacobian, null_space
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.transcribe import transcribed_again

MOST_ROUNDS, FEW_ROUNDS = 14, 3  # the latter where limits of the model hold the motion
MOST_ELEMENTS = 6000
BLIND = 2  # rounds in which all elements are cut because the data seem to tell nothing of a parameter

Ended = Literal["", "time", "lost", "elements", "chosen"]


class TimeOver(Exception):
    """No time is left; what was solved before stands."""


@dataclass(frozen=True, eq=False)
class RefinedFit:
    """The last fit, what its mesh costs (None: not known), and why it ended before it stood ("": it stands)."""

    fit: MeshFit
    error: MeshError | None
    ended: Ended


def refined_fit(
    fit: MeshFit,
    weighing: Weighing,
    solve: Solve,
    step: Step,
    further: bool,
    keep: Callable[[MeshFit], None],
) -> RefinedFit:
    """The fit on meshes that are refined where it matters, until it stands; further: whether they may be.

    keep: told of every fit that is found.
    """
    error: MeshError | None = None
    blind = 0
    try:
        for number in range(MOST_ROUNDS + 1):
            step(_cost(fit))
            error, better = mesh_error(fit, weighing.known), None
            if fit.limited:
                better = fit_on(halved(fit), fit, None, weighing, solve, step)
                error = error_against(fit, better, weighing.known) if better is not None else None
            resolved = error is not None and (blind == BLIND or _resolved(fit, error))
            if error is not None and error.stands and (resolved or not further):
                return RefinedFit(fit, error, "")
            if not further:
                return RefinedFit(fit, error, "chosen")
            if number == (FEW_ROUNDS if fit.limited else MOST_ROUNDS):
                break
            blind += not resolved
            if better is None:
                whole = error is None or error.numbers_stand or not resolved
                meshes = halved(fit) if error is None or whole else better_meshes(fit, error)
                if sum(m.elements for m in meshes) > MOST_ELEMENTS:
                    break
                better = fit_on(meshes, fit, error, weighing, solve, step)
            if better is None:
                return RefinedFit(fit, error, "lost")
            keep(better)
            fit, error = better, None
    except TimeOver:
        return RefinedFit(fit, error, "time")
    return RefinedFit(fit, error, "elements")


def _cost(fit: MeshFit) -> float:
    """Sum of squares."""
    return float(np.sum((fit.errors * fit.weights.roots) ** 2))


def _resolved(fit: MeshFit, error: MeshError) -> bool:
    """Whether the mesh is fine enough to say which parameters the data determine."""
    inner, roots = fit.inner, fit.weights.roots[:, None]
    here, there = (
        LocalJacobian(j[:, inner] * roots, fit.numbers[inner]) for j in (fit.jacobian, error.jacobian)
    )
    return null_space(here, fit.sizes[inner], there).resolved


def fit_on(
    meshes: Sequence[Mesh],
    fit: MeshFit,
    error: MeshError | None,
    weighing: Weighing,
    solve: Solve,
    step: Step,
) -> MeshFit | None:
    """The fit on other meshes, from this one; None where it is not found. Raises TimeOver."""
    program = fit.residuals.program
    if error is not None:
        program, w = error.finer.program, error.w
        pairs = zip(meshes, program.meshes, strict=True)
        if all(np.array_equal(mesh.borders, same.borders) for mesh, same in pairs):
            return fit_on_mesh(error.finer, w, weighing, fit.weights, solve, step)
    else:
        w = fit.w
    step(_cost(fit))
    found = residuals(transcribed_again(program, meshes=meshes))
    return fit_on_mesh(found, carried_over(program, w, found.program), weighing, fit.weights, solve, step)


def weighted(problem: ControlProblem, roots: np.ndarray) -> ControlProblem:
    """The problem with the deviations of its samples divided by roots (N,) of weights."""
    phases, begin = [], 0
    for phase in problem.phases:
        sums = []
        for one in phase.sums:
            sums.append(replace(one, deviations=one.deviations / roots[begin : begin + one.times.size]))
            begin += one.times.size
        phases.append(replace(phase, sums=tuple(sums)))
    return replace(problem, phases=tuple(phases))
