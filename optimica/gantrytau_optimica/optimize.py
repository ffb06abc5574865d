"""`optimize`: read, build, transcribe, solve."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError, SolveError
from gantrytau.compiler.request import names
from gantrytau_optimica.answers.archive.run_record import require_place, write_record
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.control.controls import read_controls
from gantrytau_optimica.failures.dependence import check_freedom
from gantrytau_optimica.prepared import Guesses, Prepared, parameter_names, read_guesses, solution_given
from gantrytau_optimica.problem.optimization import Optimization
from gantrytau_optimica.problem.problem_checks import one_point
from gantrytau_optimica.problem.read_problem import read_problem
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem
from gantrytau_optimica.refinement.refinement import with_ramps
from gantrytau_optimica.solving.ipopt import Progress, Solver, SolverSettings
from gantrytau_optimica.transcription.mesh import Mesh, mesh_of, with_borders
from gantrytau_optimica.transcription.scheme import collocation
from gantrytau_optimica.transcription.shooting import shoot
from gantrytau_optimica.transcription.transcribe import transcribe

Problem = Optimization | type[Optimization] | SymbolicProblem


def optimize(
    problem: Problem,
    *,
    elements: int | Sequence[float] = 50,
    points: int = 3,
    scheme: str = "radau",
    lengths: Literal["given", "free"] = "given",
    guess: Guesses | None = None,
    controls: Mapping[str, Any] | None = None,
    refine: float | None = None,
    starts: int = 1,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
    record: Any = None,
) -> Optimum:
    """Solve an optimal-control problem.

    problem: a subclass of Optimization or an instance.
    elements: their number, or their lengths relative to each other; points: in each (1 to 9); lengths: "free" lets the
    optimiser place the borders. scheme: "radau", "gauss", or "shooting" (points: Runge-Kutta steps per element).
    guess: name -> number, array or function of time, or another solution; a component -> a solution of that component.
    Default: a straight line between given initial and final values, else start values.
    controls: input -> dict(kind="constant" | "linear" | "ramps", elements=1, max_step=None, step_penalty=0.0).
    refine: relative accuracy to which limits and conditions hold when played back, and to which the objective stands.
    starts: first guesses that are tried; `.search` of the answer tells the branches they led to.
    tolerance: of Ipopt; max_time: s, of one solve; progress: called with (iteration, objective).
    record: a file or folder to which inputs, versions and verdict are written as JSON, whatever the outcome.
    Raises SolveError with `.optimum` and a report when there is no solution, it is not found in time, or Ctrl-C is
    pressed; ModelError for what is written wrongly.
    """
    policy: dict[str, Any] = dict(
        elements=elements, points=points, scheme=scheme, lengths=lengths, guess=guess, controls=controls, refine=refine,
        starts=starts, tolerance=tolerance, max_iterations=max_iterations, max_time=max_time,
    )  # fmt: skip
    if record is not None:
        require_place(record)
    begun, clock = datetime.now(UTC), time.perf_counter()
    read = problem if isinstance(problem, SymbolicProblem) else read_problem(problem)
    read_time = time.perf_counter() - clock
    found: Optimum | None = None
    try:
        found = prepare(read, progress=progress, **policy).solve()
        return found
    except SolveError as error:
        found = error.optimum
        raise
    finally:
        if record is not None and found is not None:
            write_record(found, record, problem=problem, options=policy, started=begun, read_time=read_time)


def prepare(
    problem: Problem,
    *,
    parameters: Sequence[str] = (),
    elements: int | Sequence[float] = 50,
    points: int = 3,
    scheme: str = "radau",
    lengths: Literal["given", "free"] = "given",
    guess: Guesses | None = None,
    controls: Mapping[str, Any] | None = None,
    refine: float | None = None,
    starts: int = 1,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
) -> "Prepared":
    """Read, build and transcribe a problem once, to solve it many times with other values of `parameters`.

    The other keywords are those of `optimize`.
    """
    _check(tolerance, max_iterations, max_time, progress)
    _check_answers(refine, starts)
    shooting = scheme == "shooting"
    if shooting and refine is not None:
        raise ModelError(
            "refine and scheme='shooting' do not go together; use scheme='radau' or 'gauss'",
            argument="refine",
        )
    grid = collocation("radau" if shooting else scheme, points)
    mesh = mesh_of(elements, _free_lengths(lengths))
    wanted = controls.values() if isinstance(controls, Mapping) else ()
    ramps = refine is not None or any(one in ("ramps", {"kind": "ramps"}) for one in wanted)
    if points == 1 and ramps:
        raise ModelError(
            "points=1 does not determine inputs that are ramps, as with refine=; expected at least 2 points",
            argument="points",
        )
    read = problem if isinstance(problem, SymbolicProblem) else read_problem(problem)
    begin = time.perf_counter()
    near, guess = solution_given(guess), read_guesses(guess, read)
    held = [n for name in names(parameters) for n in parameter_names(read, name)]
    built = build(read, guess, held, read_controls(read, controls or {}))
    if one_point(read):
        grid, mesh, shooting, refine = collocation("radau", 1), mesh_of(1), False, None
    meshes = [_with_jumps(mesh, phase) for phase in built.problem.phases]
    if refine is not None or (
        mesh.moving and points > 1
    ):  # free borders would be moved to where limits are passed
        built = replace(built, problem=with_ramps(built.problem, meshes))
    program = shoot(built.problem, meshes, points) if shooting else transcribe(built.problem, meshes, grid)
    check_freedom(program)
    policy = SolverSettings(tolerance, max_iterations, max_time, progress)
    return Prepared(
        built, program, Solver(program, policy), guess, time.perf_counter() - begin, refine, starts, near
    )


def _free_lengths(lengths: Any) -> bool:
    if lengths not in ("given", "free"):
        raise ModelError(
            f"lengths={lengths!r}: expected 'given' or 'free' (the optimiser places the borders of the elements)"
        )
    return lengths == "free"


def _with_jumps(mesh: Mesh, phase: Phase) -> Mesh:
    """The mesh with borders where a known input jumps."""
    jumps = [course.jumps for course in phase.courses if course.jumps.size]
    if not jumps or not (phase.start_time.is_constant() and phase.final_time.is_constant()):
        return mesh
    start, final = float(phase.start_time), float(phase.final_time)
    return with_borders(mesh, (np.concatenate(jumps) - start) / (final - start))


def _check_answers(refine: Any, starts: Any) -> None:
    if refine is not None and (not isinstance(refine, float) or not 1e-9 <= refine < 1):
        raise ModelError(
            f"refine={refine!r}: expected a relative accuracy from 1e-9 to below 1, as 1e-6",
            argument="refine",
        )
    if isinstance(starts, bool) or not isinstance(starts, (int, np.integer)) or starts < 1:
        raise ModelError(f"starts={starts!r}: expected a whole number of at least 1", argument="starts")


def _check(tolerance: Any, max_iterations: Any, max_time: Any, progress: Any) -> None:
    if not isinstance(tolerance, float) or not 0 < tolerance < 1:
        raise ModelError(f"tolerance={tolerance!r}: expected a number between 0 and 1", argument="tolerance")
    if isinstance(max_iterations, bool) or not isinstance(max_iterations, int) or max_iterations < 1:
        raise ModelError(
            f"max_iterations={max_iterations!r}: expected a whole number of at least 1",
            argument="max_iterations",
        )
    if not isinstance(max_time, (int, float)) or not max_time > 0:
        raise ModelError(f"max_time={max_time!r}: expected seconds above 0", argument="max_time")
    if progress is not None and not callable(progress):
        raise ModelError(f"progress={progress!r}: expected a function of (iteration, objective)")
