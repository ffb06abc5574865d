"""`refine=`: solve, play back, improve the mesh, and solve again until the answer holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.answers.playback.switches import Switch
from gantrytau_optimica.answers.playback.switches import switches as switches_of
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces, Signal
from gantrytau_optimica.failures.following_ends import without_following
from gantrytau_optimica.refinement.arc_mesh import arc_mesh, held_at_limits, with_arcs, wrong_signs, zoom_mesh
from gantrytau_optimica.refinement.incumbent import LATE, BestSoFar
from gantrytau_optimica.refinement.remesh import better_mesh, open_elements
from gantrytau_optimica.refinement.singular_arcs import (
    Stretch,
    continuous_on_arcs,
    inside_of_arcs,
    whole_arcs,
    with_borders_at,
)
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.transcribe import transcribed_again

MOST_ROUNDS = 12
MOST_ELEMENTS = 2000
REPLAYED = 1e-7  # relative: what tolerances of solver and integration leave in an objective played back
ZOOMS = 1  # rounds that look closer at where arcs end, before borders stand there
WORSE = 1e-3  # relative: an objective by which another branch, or none, was found
LEAST_CHANGE = 1e-12  # of the objective, by rounding: the mesh is as it was
# times the accuracy: defects below which borders may move; above, they would be moved to err more
SMALL = 30.0


@dataclass(frozen=True)
class Round:
    """What one round of refinement found: elements, objective, largest violation and defect relative to their sizes."""

    elements: int
    objective: float
    violation: float
    defect: float
    iterations: int
    error: float  # of the objective as played back
    size: float  # of the objective
    told: bool = False  # whether limits tell all inputs, between borders that move: no mesh approximates them
    before: float = np.nan  # the objective of the round from which this one was made, NaN for the first

    def __str__(self) -> str:
        return (
            f"which passes limits by {self.violation:.2g} and misses conditions by {self.defect:.2g} of their size, and the "
            f"objective by {abs(self.error) / self.size:.2g}"
        )


@dataclass(frozen=True)
class Refinement:
    """How an answer was refined: wanted accuracy, all rounds, the number of the one that was kept (the last if it was
    reached, else the best), its switches, and why it ended before if it did.
    """

    accuracy: float
    rounds: tuple[Round, ...]
    switches: tuple[Switch, ...]
    reached: bool
    kept: int = 0
    stopped: str = ""

    def __repr__(self) -> str:
        return f"<{self}>"

    def __str__(self) -> str:
        word = "Refined to" if self.reached else "NOT refined to"
        why = f" ({self.stopped})" if self.stopped else ""
        if not self.rounds:
            return f"{word} {self.accuracy:g}{why}"
        first, last = self.rounds[0], self.rounds[-1]
        stands = "the first round is the last"
        if last.told:
            off = abs(last.error) / last.size
            stands = f"the objective is off by {off:.2g} of its size, as all inputs stay at limits"
        elif len(self.rounds) > 1:
            stands = f"the last round changed the objective by {abs(last.objective - last.before):.2g}"
        held = "" if self.reached else f"; round {self.kept + 1} is kept, {self.rounds[self.kept]}"
        return (
            f"{word} {self.accuracy:g} in {len(self.rounds)} rounds{why}, {first.elements} to {last.elements} elements, "
            f"{len(self.switches)} switches; {stands}{held}"
        )


def with_pieces(
    problem: ControlProblem, meshes: Sequence[Mesh], pieces: Callable[[Phase, Pieces, Mesh], Pieces]
) -> ControlProblem:
    """The problem with its inputs in other pieces, by their phase, their own pieces, and the mesh of the phase."""

    def changed(phase: Phase, mesh: Mesh) -> Phase:
        inputs = tuple(replace(s, pieces=pieces(phase, s.pieces, mesh)) for s in phase.inputs)
        return replace(phase, inputs=inputs)

    phases = (changed(phase, mesh) for phase, mesh in zip(problem.phases, meshes, strict=True))
    return replace(problem, phases=tuple(phases))


def kept_pieces(own: Pieces, mesh: Mesh) -> Pieces:
    """Pieces that the caller chose on the borders that they have on a mesh, whatever elements come later."""
    if own.kind in ("free", "ramps") or own.borders:
        return own
    return replace(own, borders=tuple(np.unique(np.append(mesh.borders[:: own.elements], 1.0)).tolist()))


def with_ramps(problem: ControlProblem, meshes: Sequence[Mesh]) -> ControlProblem:
    """The problem with its free inputs as straight lines in each element: what keeps to limits at both ends keeps to
    them between. Inputs in pieces that the caller chose keep the borders that these have on the first mesh; where an
    equality along the path says what they are, which no straight line could follow, inputs stay free.
    """
    following = [phase for phase in problem.phases if _follows(phase)]

    def pieces(phase: Phase, own: Pieces, mesh: Mesh) -> Pieces:
        if phase in following:
            return own
        return Pieces("ramps") if own.kind in ("free", "ramps") else kept_pieces(own, mesh)

    return with_pieces(problem, meshes, pieces)


def _follows(phase: Phase) -> bool:
    """Whether inputs follow from an equality along the path, other than a constant ratio of inputs to each other."""
    symbols = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.inputs))
    own = {s.symbol.element_hash() for s in phase.inputs}

    def among_inputs(expression: ca.SX) -> bool:
        leaves = {leaf.element_hash() for leaf in ca.symvar(expression)}
        return leaves <= own and ca.is_linear(expression, symbols)

    equal = (limit for limit in phase.path_limits if limit.lower == limit.upper)
    return not all(among_inputs(limit.expression) for limit in equal)


def without_ramps(problem: ControlProblem) -> ControlProblem:
    """The problem with inputs that are free at every point instead of ramps."""

    def changed(phase: Phase, signal: Signal) -> Signal:
        ramps = signal in phase.inputs and signal.pieces.kind == "ramps"
        return replace(signal, pieces=Pieces()) if ramps else signal

    return problem.with_signals(changed)


def refined(optimum: Optimum, accuracy: float, solve: Callable[..., Optimum], reached: BestSoFar) -> Optimum:
    """The optimum on better and better meshes until it holds when played back, or the best of them when that is not
    reached: after so many rounds, elements or seconds, or where the next mesh has no solution.

    solve: (program, first guess of its unknowns) -> Optimum, which need not be a success; reached: is kept up to date.
    """
    clock, search, best = reached.clock, optimum.search, optimum
    rounds: list[Round] = []
    moving, moved, stopped, before, by_arcs = True, False, "", np.nan, True
    held: Optimum | None = None  # the answer, whose arcs only get sharper ends
    try:
        while True:
            number = f"round {len(rounds) + 1} of at most {MOST_ROUNDS + 1}"
            clock.enter(f"{number}: playing back")
            rounds.append(replace(_round(optimum), before=before))
            kept = _kept(rounds, accuracy)
            best = optimum if kept == len(rounds) - 1 else best
            reached.best = best.with_notes(refinement=_record(best, rounds, accuracy), search=search)
            if _holds(rounds, accuracy) or _exhausted(rounds):
                break
            clock.enter(f"{number}: solving on the next mesh")
            moving = moving and rounds[-1].defect < SMALL * accuracy
            if moved and not moving and kept < len(rounds) - 1:  # borders were moved to err more
                optimum, by_arcs = best, False
            better, before, moved = None, optimum.objective, False
            if by_arcs and clock.left:
                known = len(rounds) > ZOOMS or _moves(optimum)
                better = solved_by_arcs(optimum, accuracy, known, solve)
                by_arcs = better is not None
            if better is not None:
                optimum, moved = better, _moves(better)
                continue
            smooth = [inside_of_arcs(t) for t in optimum.phases.values()]
            for how in [*(["moving"] if moving else []), "switches", "divided"]:
                meshes = _meshes(optimum, rounds, accuracy, how)
                better = _solved_on(optimum, meshes, solve, smooth) if clock.left else None
                if better is not None:
                    moved = _moves(better)
                    break
                moving = False
            if better is None:
                stopped = "" if clock.left else LATE
                break
            optimum = better
        if _holds(rounds, accuracy) and clock.left:
            held = reached.best
            best = _with_sharp_ends(best, rounds, accuracy, solve, clock)
    except KeyboardInterrupt:
        if held is not None:
            reached.best = held
            raise
        newest = reached.best or best
        refinement = replace(_record(best, rounds, accuracy), reached=False, stopped=reached.reason)
        reached.best = newest.with_notes(refinement=refinement, search=search)
        raise
    return best.with_notes(refinement=_record(best, rounds, accuracy, stopped), search=search)


def _moves(optimum: Optimum) -> bool:
    """Whether borders of its mesh move."""
    return any(layout.mesh.moving for layout in optimum.program.places.layouts)


def solved_by_arcs(
    optimum: Optimum, accuracy: float, known: bool, solve: Callable[..., Optimum]
) -> Optimum | None:
    """On a mesh that shows the arcs, or if they are `known` with borders between them as unknowns.

    None where there are no arcs, the program has no solution, or an input would rather leave the limit of its arc.
    """
    played = list(optimum.playback.phases.values())
    find = arc_mesh if known else zoom_mesh
    meshes = [mesh for mesh in (find(one, accuracy) for one in played) if mesh is not None]
    if len(meshes) < len(played):
        return None
    trajectories = [one.trajectory for one in played]
    problem = with_ramps(optimum.program.problem, meshes)
    if not all(_of_ramps(phase) and _movable(phase) for phase in problem.phases):
        return None
    if known:
        problem = with_arcs(problem, trajectories, meshes)
    located = (trajectories[0].numbers, [mesh.borders for mesh in meshes])
    program = transcribed_again(optimum.program, problem, meshes, located)
    held = held_at_limits(program, trajectories) if known else program
    # each arc at a limit leaves less to choose
    if np.sum(held.lbg == held.ubg) > np.sum(held.lbw < held.ubw):
        problem = without_following(replace(optimum.built, problem=problem))
        program = transcribed_again(optimum.program, problem, meshes, located)
        held = held_at_limits(program, trajectories) if known else program
    if np.sum(held.lbg == held.ubg) > np.sum(held.lbw < held.ubw):
        return None
    better = solve(held, warm_start(trajectories, held), hot=True)
    worse = better.objective - optimum.objective > WORSE * optimum.playback.objective_size
    if not better.success or worse:
        return None
    if not known or better.program is not held:
        return better
    if wrong_signs(held, trajectories, better.solution.bound_multipliers):
        return None
    return replace(better, program=program, built=replace(better.built, problem=problem))


def _exhausted(rounds: Sequence[Round]) -> bool:
    """Whether another round is of no use: there were enough, or the last one changed nothing."""
    last = rounds[-1]
    stands = len(rounds) > 2 and last.elements == rounds[-2].elements
    same = stands and abs(last.objective - last.before) <= LEAST_CHANGE * last.size
    return same or len(rounds) > MOST_ROUNDS or last.elements > MOST_ELEMENTS


def _record(best: Optimum, rounds: Sequence[Round], accuracy: float, stopped: str = "") -> Refinement:
    switches = tuple(s for t in best.phases.values() for s in switches_of(t))
    done = _holds(rounds, accuracy)
    return Refinement(accuracy, tuple(rounds), switches, done, _kept(rounds, accuracy), stopped)


def _kept(rounds: Sequence[Round], accuracy: float) -> int:
    """The last round where it holds, else the one that fails by the least."""
    last = len(rounds) - 1
    if last < 0:  # interrupted in the first
        return 0
    if _holds(rounds, accuracy):
        return last
    return min(range(last, -1, -1), key=lambda k: _off(rounds, k))  # of equals the last


def _off(rounds: Sequence[Round], k: int) -> float:
    """By how much a round fails, relative: by what limits, conditions and objective are off, and by how much the objective
    differs from that of the round before, or after the first.
    """
    one, after = rounds[k], rounds[max(k, min(1, len(rounds) - 1))]
    other = one.before if k else after.objective
    moved = abs(one.objective - other) / after.size
    off = max(one.violation, one.defect, abs(one.error) / one.size, moved)
    return off if np.isfinite(off) else np.inf


def _meshes(optimum: Optimum, rounds: list[Round], accuracy: float, how: str) -> list[Mesh]:
    """The next meshes; where limits and conditions hold already, finer where inputs are rough.

    how: borders at switches "moving" or fixed ("switches"), or the old borders with elements "divided" only.
    """
    stands = len(rounds) > 1 and max(rounds[-1].violation, rounds[-1].defect) <= accuracy
    meshes = []
    for played in optimum.playback.phases.values():
        phase = played.trajectory.phase
        movable = how == "moving" and _movable(phase)
        structure = how != "divided" and _of_ramps(phase)
        meshes.append(better_mesh(played, accuracy, movable, roughness=stands, structure=structure))
    return meshes


def _solved_on(
    optimum: Optimum,
    meshes: list[Mesh],
    solve: Callable[..., Optimum],
    smooth: list[list[Stretch]],
    hot: bool = False,
) -> Optimum | None:
    """The solution on other meshes, continuous on smooth stretches of inputs, from this one; None if it is not found."""
    trajectories = list(optimum.phases.values())
    located = (trajectories[0].numbers, [mesh.borders for mesh in meshes])
    problem = continuous_on_arcs(optimum.program.problem, smooth, meshes)
    program = transcribed_again(optimum.program, problem, meshes, located)
    better = solve(program, warm_start(trajectories, program), hot=hot)
    return better if better.success else None


def _with_sharp_ends(
    optimum: Optimum, rounds: list[Round], accuracy: float, solve: Callable[..., Optimum], clock: Clock
) -> Optimum:
    """The answer with borders where its singular arcs end, as the last round; the answer itself if that does not hold."""
    trajectories = list(optimum.phases.values())
    stretches = [whole_arcs(t) for t in trajectories]
    fixed = _moves(optimum) or not all(_of_ramps(t.phase) and _movable(t.phase) for t in trajectories)
    if fixed or not any(stretches):
        return optimum
    meshes = [with_borders_at(one, t.mesh) for one, t in zip(stretches, trajectories, strict=True)]
    clock.enter("borders where singular arcs end")
    sharp = _solved_on(optimum, meshes, solve, stretches, hot=True)
    if sharp is not None:
        last = replace(_round(sharp), before=rounds[-1].before)
        if _holds([*rounds[:-1], last], accuracy):
            rounds[-1] = last
            return sharp
    return optimum


def _round(optimum: Optimum) -> Round:
    played = optimum.playback
    elements = sum(layout.mesh.elements for layout in optimum.program.places.layouts)
    defect = max((d.relative for d in played.defects), default=0.0) if played.complete else np.inf
    error, size = played.objective_error, played.objective_size
    told = _moves(optimum) and not any(open_elements(t).any() for t in optimum.phases.values())
    return Round(elements, optimum.objective, played.violation, defect, optimum.iterations, error, size, told)


def _holds(rounds: Sequence[Round], accuracy: float) -> bool:
    """Whether limits and conditions hold and the objective stands still, or is known by playing back alone."""
    if not rounds or (len(rounds) < 2 and not rounds[-1].told):
        return False
    last = rounds[-1]
    if max(last.violation, last.defect) > accuracy:
        return False
    unmoved = last.told or abs(last.objective - last.before) <= accuracy * last.size
    return unmoved and abs(last.error) <= max(accuracy, REPLAYED) * last.size


def _movable(phase: Phase) -> bool:
    """Whether borders may move: not where samples tie values to times, nor where the caller chose the pieces."""
    return not phase.courses and not phase.sums


def _of_ramps(phase: Phase) -> bool:
    """Whether all borders may be changed: not where the caller chose the pieces of inputs."""
    return all(s.pieces.kind == "ramps" for s in phase.inputs)
