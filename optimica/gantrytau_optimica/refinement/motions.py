"""Answers that are no motion of the model: stationary points of equations on a mesh too coarse for them, solved again.

    d(k + 1) = exp(A h) d(k) + r + A int exp(A (h - t)) r(t) dt,  A = df/dx,  r(t) = x(0) + int f dt - x(t)

over element k, along its polynomials. Where d grows large, inputs are played back: they have to lead to the solution's ends.
"""

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau.compiler.symbol_spaces import called
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.answers.playback.sweeps import INTEGRALS, PLACES
from gantrytau_optimica.refinement.refinement import kept_pieces, with_pieces
from gantrytau_optimica.refinement.remesh import divided
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.trajectory import Trajectory
from gantrytau_optimica.transcription.transcribe import transcribed_again

DOUBLED = 3  # times that elements are halved
DOUBTFUL = 0.1  # of its size: first-order estimate of a state's deviation from which inputs are played back
TERMS = 14  # of the series of an exponential: with sums of rows up to a half the rest is rounding
TINY = 1e-300
MOST_HALVINGS = 1100  # of the largest double
RESOLVED = 1e-6  # of its size: misses of a state in an element, below which a plant that runs away is no fault of the mesh


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
        return stopped_told(found)
    status = f"no motion: played back, {missed}"
    return replace(found, solution=replace(found.solution, success=False, status=status))


def stopped_told(found: Optimum) -> Optimum:
    """The answer, called a solution on its mesh only where its playback, if it was played, stopped on the way."""
    if not found.success or "playback" not in vars(found) or found.playback.complete:
        return found
    status = f"{found.status} on this mesh only: played back, {found.playback.lines()[0]}"
    return found.with_notes(solution=replace(found.solution, status=status))


def _missed(found: Optimum) -> str:
    """What inputs miss by more than its size, in words; "" of a motion, or of an answer that is none."""
    if (
        not found.success
        or not found.program.scheme.refinable
        or not any(map(_doubtful, found.phases.values()))
    ):
        return ""
    if not found.playback.complete:  # algebraics may be singular between two points that the solution passes
        plain = not any(one.phase.algebraics for one in found.phases.values())
        away = plain or any(p.away > 1.0 for p in found.playback.phases.values())
        return found.playback.lines()[0] if away else ""
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
    element, place = np.repeat(np.arange(mesh.elements), PLACES.size), np.tile(PLACES, mesh.elements)
    times = trajectory.times(mesh.borders[element] + place * mesh.widths[element])
    signals = trajectory.at(element, place, times)
    unknowns = ca.vertcat(*(s.symbol for s in (*phase.states, *phase.algebraics)))
    equations = ca.densify(ca.vertcat(phase.ode, phase.residuals))
    columns = ca.horzcat(equations, ca.jacobian(equations, unknowns))
    look = trajectory.function(columns.nz[:]).map(times.size)
    rows = np.zeros((times.size, n + m + 1, n + m))
    (nonzeros,) = called(look, times, signals.T)
    row, column = (np.array(part) for part in columns.sparsity().get_triplet())
    rows[:, column, row] = nonzeros.reshape(times.size, -1)
    rows = rows.swapaxes(1, 2)
    if not np.all(np.isfinite(rows)):
        return True
    try:  # the algebraics follow: dz = -g_z^-1 (g + g_x dx)
        followed = np.linalg.solve(rows[:, n:, n + 1 :], rows[:, n:, : n + 1])
    except np.linalg.LinAlgError:
        return True
    rows = rows[:, :n, : n + 1] - rows[:, :n, n + 1 :] @ followed  # rates, and their Jacobian by states
    rows = rows.reshape(mesh.elements, PLACES.size, n, n + 1)
    spans = np.diff(trajectory.times(mesh.borders))[:, None, None]
    jacobian = np.einsum("epij,p->eij", rows[..., 1:], INTEGRALS[-1]) * spans
    x = signals[:n].reshape(n, mesh.elements, PLACES.size).transpose(1, 2, 0)
    rests = x[:, :1] + INTEGRALS @ rows[..., 0] * spans - x
    grown = np.einsum(
        "epij,epj,p->ei", exponentials(jacobian[:, None] * (1 - PLACES[:, None, None])), rests, INTEGRALS[-1]
    )
    misses = rests[:, -1] + np.einsum("eij,ej->ei", jacobian, grown)
    sizes = np.array([s.nominal for s in phase.states])
    if np.all(np.abs(misses) <= RESOLVED * sizes):
        return False
    off = np.zeros(n)
    for growth, miss in zip(exponentials(jacobian), misses, strict=True):
        off = growth @ off + miss
    return not np.all(np.abs(off) <= DOUBTFUL * sizes)


def exponentials(matrices: np.ndarray) -> np.ndarray:
    """Exponentials of many small matrices (..., n, n), by series of their parts and squares of these."""
    size = np.abs(matrices).sum(axis=-1).max(axis=-1, initial=0.0)
    halvings = np.clip(np.ceil(np.log2(np.maximum(size, TINY))) + 1, 0, MOST_HALVINGS).astype(int)
    parts = matrices / np.exp2(halvings)[..., None, None]
    found = term = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    for k in range(1, TERMS):
        term = term @ parts / k
        found = found + term
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(halvings.max(initial=0)):
            more = halvings > k
            found[more] = found[more] @ found[more]
    return found


def _doubled(found: Optimum) -> Program:
    """The program on elements of half the length, inputs in the pieces that they have."""
    meshes = found.program.meshes
    halved = [
        replace(m, borders=divided(m.borders, np.full(m.elements, 2)), moving=tuple(2 * k for k in m.moving))
        for m in meshes
    ]
    problem = with_pieces(found.program.problem, meshes, lambda _, own, mesh: kept_pieces(own, mesh))
    return transcribed_again(found.program, problem, halved)
