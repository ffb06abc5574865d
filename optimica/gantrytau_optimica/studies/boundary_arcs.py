"""How an objective moves with parameters where limits along the path bind for a while.

On a fixed mesh such an arc begins and ends at a border, whatever the parameters are: the multipliers are those of an optimum
that may not move it. With the borders next to its ends free, what they gain vanishes at the optimum, so that the objective
has its derivative at fixed borders (the envelope theorem; Fiacco (1983), section 3.4).
"""

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.answers.playback.ranges import measured
from gantrytau_optimica.answers.playback.switches import AT_LIMIT, switches
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.refinement.refinement import without_ramps
from gantrytau_optimica.solving.ipopt import Solution, Solver, SolverSettings
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory
from gantrytau_optimica.transcription.transcribe import transcribed_again

SAME = 1e-2  # relative: within it two objectives are those of one motion on two meshes
PASSED = 1e-6  # of its range: by how much a limit may be passed between the points
BETWEEN = 7  # places in every element where that is looked at
MOST = 400  # iterations
LEAST = 1e-3  # of the horizon: ends that are closer are one
FEWEST = 2  # elements of an arc


def with_free_ends(optimum: Optimum) -> tuple[Program, Solution] | None:
    """The optimum once more, with the ends of its arcs at limits free to move; None where none is found, or no arc."""
    trajectories = list(optimum.phases.values())
    scheme = optimum.program.scheme
    meshes = [_mesh(trajectory) for trajectory in trajectories]
    fixed = any(t.phase.courses or t.phase.sums or t.layout.knots.size for t in trajectories)
    if fixed or not scheme.refinable or scheme.points.size == 1 or not any(mesh.moving for mesh in meshes):
        return None
    if any(s.pieces.kind not in ("free", "ramps") for t in trajectories for s in t.phase.inputs):
        return None
    located = (trajectories[0].numbers, [mesh.borders for mesh in meshes])
    program = transcribed_again(optimum.program, without_ramps(optimum.program.problem), meshes, located)
    first = warm_start(trajectories, program)
    program = _held(program, first)
    solution = Solver(program, SolverSettings(barrier="near", max_iterations=MOST)).solve(program, first)
    near = abs(solution.objective - optimum.objective) <= SAME * abs(optimum.objective)
    return (program, solution) if solution.success and near and _holds(program, solution) else None


def _holds(program: Program, solution: Solution) -> bool:
    """Whether limits hold between the points as well: an arc that is none passes them there."""
    numbers = solution.w[program.places.free]
    for layout in program.places.layouts:
        found = Trajectory(program.problem, layout, solution.w, numbers)
        times = found.times(np.linspace(0.0, 1.0, BETWEEN * layout.mesh.elements + 1))
        for limit, row, size in measured(found, lambda e, found=found, times=times: found.values(e, times)):
            if np.max(np.maximum(limit.lower - row, row - limit.upper)) > PASSED * size:
                return False
    return True


def _held(program: Program, w: np.ndarray) -> Program:
    """The program with what binds all along an arc as equations there: else a border may rest where inputs half switch."""
    x = w / program.places.scale
    rows = np.array(program.assembled.nlp(x, [])[1]).ravel()
    (lbw, ubw), (lbg, ubg) = (
        (low.copy(), high.copy()) for low, high in ((program.lbw, program.ubw), (program.lbg, program.ubg))
    )
    for number, layout in enumerate(program.places.layouts):
        nx, points = len(layout.phase.states), layout.fractions.size
        knots = np.array([0, *layout.mesh.moving, layout.mesh.elements]) * (points // layout.mesh.elements)
        for k in range(len(layout.phase.signals)):
            places = layout.of(k)[-points:]  # without the start of a state
            for arc in pairwise(knots.tolist()):
                _hold(x, lbw, ubw, places, arc, early=k < nx)
        jumping = _jumping(layout.phase)
        for group in program.groups:
            if group.kind == "path" and group.phase == number:
                for arc in pairwise(knots.tolist()):
                    _hold(rows, lbg, ubg, group.rows, arc, early=group.name not in jumping)
    return replace(program, lbw=lbw, ubw=ubw, lbg=lbg, ubg=ubg)


def _jumping(phase: Phase) -> set[str]:
    """Limits in which an input or an algebraic stands, which may jump."""
    symbols = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in (*phase.algebraics, *phase.inputs)))
    return {limit.name for limit in phase.path_limits if ca.depends_on(limit.expression, symbols)}


def _hold(
    values: np.ndarray, low: np.ndarray, high: np.ndarray, places: np.ndarray, arc: tuple[int, int], early: bool
):  # fmt: skip
    """What is at a limit in the middle of an arc is held there all along; early: at the border before it as well."""
    begin, end = arc
    margin = (end - begin) // 4
    middle, whole = places[begin + margin : end - margin], places[max(begin - int(early), 0) : end]
    for own, other in ((low, high), (high, low)):
        bound = own[middle]
        width = np.where(
            np.isfinite(other[middle]), np.abs(other[middle] - bound), np.maximum(np.abs(bound), 1.0)
        )
        if np.all(np.isfinite(bound)) and np.all(np.abs(values[middle] - bound) <= AT_LIMIT * width):
            other[whole] = own[whole]


def _mesh(trajectory: Trajectory) -> Mesh:
    """As many equal elements between the ends of arcs, which may move; the same mesh where no limit on states binds."""
    jumping = {s.name for s in trajectory.phase.inputs} | _jumping(trajectory.phase)
    found, borders = switches(trajectory), trajectory.mesh.borders
    if all(s.name in jumping for s in found):
        return Mesh(borders)
    near = max(np.median(trajectory.mesh.widths), LEAST)
    ends = [0.0]
    for share in sorted(s.share for s in found):  # an input and the limit that it leads to end together
        if near < share < 1 - near and share - ends[-1] > near:
            ends.append(share)
    counts = np.maximum(np.round(np.diff([*ends, 1.0]) * trajectory.mesh.elements), FEWEST).astype(int)
    parts = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(ends, [*ends[1:], 1.0], counts, strict=True)]
    return Mesh(np.concatenate([[0.0], *parts]), tuple(int(k) for k in np.cumsum(counts)[:-1]))
