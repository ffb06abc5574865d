"""`refine=`: solve, play back, improve the mesh, and solve again until the answer holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.answers.playback.switches import Switch
from gantrytau_optimica.answers.playback.switches import switches as switches_of
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Pieces, Signal
from gantrytau_optimica.refinement.remesh import better_mesh
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.transcribe import transcribe

MOST_ROUNDS = 12
MOST_ELEMENTS = 2000
REPLAYED = 1e-7  # relative: what tolerances of solver and integration leave in an objective played back
SMALL = (
    30.0  # times the accuracy: defects below which borders may move; above, they would be moved to err more
)


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


@dataclass(frozen=True)
class Refinement:
    """How an answer was refined: wanted accuracy, all rounds, the switches at the end, and whether it was reached."""

    accuracy: float
    rounds: tuple[Round, ...]
    switches: tuple[Switch, ...]
    reached: bool

    def __repr__(self) -> str:
        return f"<{self}>"

    def __str__(self) -> str:
        first, last = self.rounds[0], self.rounds[-1]
        word = "Refined to" if self.reached else "NOT refined to"
        change = abs(self.rounds[-1].objective - self.rounds[-2].objective) if len(self.rounds) > 1 else 0.0
        return (
            f"{word} {self.accuracy:g} in {len(self.rounds)} rounds, {first.elements} to {last.elements} elements, "
            f"{len(self.switches)} switches; the last round changed the objective by {change:.2g}"
        )


def with_ramps(problem: ControlProblem, meshes: Sequence[Mesh]) -> ControlProblem:
    """The problem with its free inputs as straight lines in each element: what keeps to limits at both ends keeps to
    them between. Inputs in pieces that the caller chose keep the borders that these have on the first mesh.
    """

    def pieces(signal: Signal, mesh: Mesh) -> Pieces:
        own = signal.pieces
        if own.kind in ("free", "ramps"):
            return Pieces("ramps")
        borders = np.unique(np.append(mesh.borders[:: own.elements], 1.0))
        return replace(own, borders=tuple(borders.tolist()))

    def changed(phase: Phase, mesh: Mesh) -> Phase:
        inputs = tuple(replace(s, pieces=pieces(s, mesh)) for s in phase.inputs)
        return replace(phase, inputs=inputs)

    phases = (changed(phase, mesh) for phase, mesh in zip(problem.phases, meshes, strict=True))
    return replace(problem, phases=tuple(phases))


def without_ramps(problem: ControlProblem) -> ControlProblem:
    """The problem with inputs that are free at every point instead of ramps."""

    def changed(phase: Phase) -> Phase:
        inputs = (replace(s, pieces=Pieces()) if s.pieces.kind == "ramps" else s for s in phase.inputs)
        return replace(phase, inputs=tuple(inputs))

    return replace(problem, phases=tuple(changed(phase) for phase in problem.phases))


def refined(optimum: Optimum, accuracy: float, solve: Callable[..., Optimum]) -> Optimum:
    """The optimum on better and better meshes until it holds when played back.

    solve: (program, first guess of its unknowns) -> Optimum, which need not be a success.
    """
    search = optimum.search
    rounds: list[Round] = [_round(optimum)]
    moving = True
    while True:
        switches = tuple(s for t in optimum.phases.values() for s in switches_of(t))
        done = _holds(rounds, accuracy)
        if done or len(rounds) > MOST_ROUNDS or rounds[-1].elements > MOST_ELEMENTS:
            return replace(
                optimum, refinement=Refinement(accuracy, tuple(rounds), switches, done), search=search
            )
        moving = moving and rounds[-1].defect < SMALL * accuracy
        for how in [*(["moving"] if moving else []), "switches", "divided"]:
            better = _solved_on(optimum, _meshes(optimum, rounds, accuracy, how), solve)
            if better is not None:
                break
            moving = False
        else:
            return replace(
                optimum, refinement=Refinement(accuracy, tuple(rounds), switches, False), search=search
            )
        optimum = better
        rounds.append(_round(optimum))


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


def _solved_on(optimum: Optimum, meshes: list[Mesh], solve: Callable[..., Optimum]) -> Optimum | None:
    """The solution on other meshes, from this one, or None if it is not found."""
    trajectories = list(optimum.phases.values())
    located = (trajectories[0].numbers, [mesh.borders for mesh in meshes])
    scheme = optimum.program.places.layouts[0].scheme
    program = transcribe(optimum.program.problem, meshes, scheme, located)
    better = solve(program, warm_start(trajectories, program))
    return better if better.success else None


def _round(optimum: Optimum) -> Round:
    played = optimum.playback
    elements = sum(layout.mesh.elements for layout in optimum.program.places.layouts)
    defect = max((d.relative for d in played.defects), default=0.0) if played.complete else np.inf
    error, size = played.objective_error, played.objective_size
    return Round(elements, optimum.objective, played.violation, defect, optimum.iterations, error, size)


def _holds(rounds: list[Round], accuracy: float) -> bool:
    """Whether limits and conditions hold and the objective stands still."""
    last = rounds[-1]
    if len(rounds) < 2 or max(last.violation, last.defect) > accuracy:
        return False
    unmoved = abs(last.objective - rounds[-2].objective) <= accuracy * last.size
    return unmoved and abs(last.error) <= max(accuracy, REPLAYED) * last.size


def _movable(phase: Phase) -> bool:
    """Whether borders may move: not where samples tie values to times, nor where the caller chose the pieces."""
    return not phase.courses and not phase.sums


def _of_ramps(phase: Phase) -> bool:
    """Whether all borders may be changed: not where the caller chose the pieces of inputs."""
    return all(s.pieces.kind == "ramps" for s in phase.inputs)
