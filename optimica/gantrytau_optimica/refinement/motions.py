"""Answers that are no motion of the model: stationary points of equations on a mesh too coarse for them, solved again.

    d(k + 1) = exp(A h) d(k) + int exp(A (h - t)) (f - dx/dt) dt,  A = df/dx        over element k, along its polynomials

Where this grows large, inputs are played back: they have to lead to the ends that the solution has.
"""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
from scipy.linalg import expm

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces, Signal
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.trajectory import Trajectory
from gantrytau_optimica.transcription.transcribe import transcribe

DOUBLED = 3  # times that elements are halved
DOUBTFUL = (
    0.1  # of its size: by how much a state may end elsewhere, to first order, before inputs are played back
)
RESOLVED = 1e-6  # of its size: misses of a state in an element, below which a plant that runs away is no fault of the mesh
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)  # more than points of an element
PLACES, WEIGHTS = 0.5 + 0.5 * NODES, 0.5 * WEIGHTS
# rates by the place from values of a polynomial at the places
RATES = 2 * np.polynomial.legendre.legval(NODES, np.polynomial.legendre.legder(np.eye(10))).T
RATES = RATES @ np.linalg.inv(np.polynomial.legendre.legvander(NODES, 9))


def as_motion(
    found: Optimum, solve: Callable[[Program, np.ndarray], Optimum], left: Callable[[], float]
) -> Optimum:
    """The answer if it is a motion, else that on twice the elements, or on twice these; at last it is no success.

    solve: (program, first guess) -> Optimum; left: s.
    """
    missed, doubled = _missed(found), 0
    while missed and doubled < DOUBLED and left():
        program = _doubled(found)
        again = solve(program, first_guess(program))
        if not again.success:
            break
        found, missed, doubled = again, _missed(again), doubled + 1
    if not missed:
        return found
    status = f"no motion: played back, {missed}"
    return replace(found, solution=replace(found.solution, success=False, status=status))


def _missed(found: Optimum) -> str:
    """What inputs miss by more than its size, in words; "" of a motion, or of an answer that is none."""
    trajectories = list(found.phases.values())
    scheme = found.program.places.layouts[0].scheme.scheme
    if not found.success or scheme == "shooting" or not any(_doubtful(one) for one in trajectories):
        return ""
    if not found.playback.complete:  # which the report tells: an integrator that stops proves no other motion
        return ""
    worst = max(found.playback.defects, key=lambda d: d.relative, default=None)
    if worst is None or worst.relative <= 1.0:
        return ""
    return f"`{worst.name}` is missed by {abs(worst.amount):.3g}"


def _doubtful(trajectory: Trajectory) -> bool:
    """Whether inputs may lead elsewhere than to the ends of the solution, to first order."""
    phase, mesh = trajectory.phase, trajectory.mesh
    n, m = len(phase.states), len(phase.algebraics)
    if not n:
        return False
    element = np.repeat(np.arange(mesh.elements), PLACES.size)
    place = np.tile(PLACES, mesh.elements)
    times = trajectory.times(mesh.borders[element] + place * mesh.widths[element])
    signals = trajectory.at(element, place, times)
    unknowns = ca.vertcat(*(s.symbol for s in (*phase.states, *phase.algebraics)))
    equations = ca.densify(ca.vertcat(phase.ode, phase.residuals))
    look = trajectory.function(ca.horzcat(equations, ca.jacobian(equations, unknowns)))
    found = np.array(look(times[None, :], signals)).reshape(n + m, times.size, -1).swapaxes(0, 1)
    if not np.all(np.isfinite(found)):
        return True
    rows = found[:, :n]  # rates, and their slopes by states and algebraics
    if m:  # the algebraics follow: dz = -g_z^-1 (g + g_x dx)
        try:
            rows = rows[..., : n + 1] - rows[..., n + 1 :] @ np.linalg.solve(
                found[:, n:, n + 1 :], found[:, n:, : n + 1]
            )
        except np.linalg.LinAlgError:
            return True
    rows = rows.reshape(mesh.elements, PLACES.size, n, n + 1)
    spans = np.diff(trajectory.times(mesh.borders))
    slopes = np.einsum("epij,p->eij", rows[..., 1:], WEIGHTS) * spans[:, None, None]
    x = signals[:n].reshape(n, mesh.elements, PLACES.size)
    rests = rows[..., 0] * spans[:, None, None] - (x @ RATES.T).transpose(1, 2, 0)
    misses = np.einsum("epij,epj,p->ei", expm(slopes[:, None] * (1 - PLACES[:, None, None])), rests, WEIGHTS)
    sizes = np.array([s.nominal for s in phase.states])
    if np.all(np.abs(misses) <= RESOLVED * sizes):
        return False
    off = np.zeros(n)
    for growth, miss in zip(expm(slopes), misses, strict=True):
        off = growth @ off + miss
    return not np.all(np.abs(off) <= DOUBTFUL * sizes)


def _doubled(found: Optimum) -> Program:
    """The program on elements of half the length, inputs in pieces of the same lengths."""
    layouts = found.program.places.layouts
    meshes = [_halved(layout.mesh) for layout in layouts]
    problem = _with_pieces(found.program.problem)
    return transcribe(problem, meshes, layouts[0].scheme)


def _halved(mesh: Mesh) -> Mesh:
    middles = (mesh.borders[:-1] + mesh.borders[1:]) / 2
    borders = np.insert(mesh.borders, np.arange(1, mesh.borders.size), middles)
    return replace(mesh, borders=borders, moving=tuple(2 * k for k in mesh.moving))


def _with_pieces(problem: ControlProblem) -> ControlProblem:
    def pieces(own: Pieces) -> Pieces:
        grouped = own.kind in ("constant", "linear") and not own.borders
        return replace(own, elements=2 * own.elements) if grouped else own

    def changed(phase: Phase, signal: Signal) -> Signal:
        return replace(signal, pieces=pieces(signal.pieces)) if signal in phase.inputs else signal

    return problem.with_signals(changed)
