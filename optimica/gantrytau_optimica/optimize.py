"""`optimize`: read, build, transcribe, solve."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any, Literal, Unpack

from gantrytau import SolveError
from gantrytau.compiler.request import names
from gantrytau.compiler.system import Causality
from gantrytau.progress import shows_progress
from gantrytau_optimica.answers.archive.run_record import require_place, write_record
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.controls import read_controls
from gantrytau_optimica.control.input_rates import with_ramped_rates
from gantrytau_optimica.failures.dependence import check_freedom
from gantrytau_optimica.guesses_and_parameters import parameter_names, read_guesses, solution_given
from gantrytau_optimica.policy import Guesses, Policy, PolicyKeywords, policy_of
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.problem.optimization import Optimization
from gantrytau_optimica.problem.problem_checks import one_point
from gantrytau_optimica.problem.read_problem import read_problem
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem
from gantrytau_optimica.refinement.incumbent import BestSoFar
from gantrytau_optimica.refinement.refinement import with_ramps
from gantrytau_optimica.solving.clock import Clock, Progress
from gantrytau_optimica.solving.ipopt import Solver
from gantrytau_optimica.transcription.mesh import with_jumps
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.transcribe import Scheme, transcribe

Problem = Optimization | type[Optimization] | SymbolicProblem


@shows_progress
def optimize(
    problem: Problem,
    *,
    elements: int | Sequence[float] = 50,
    points: int = 3,
    scheme: Scheme = "radau",
    lengths: Literal["given", "free"] = "given",
    guess: Guesses | None = None,
    controls: Mapping[str, Any] | None = None,
    causality: Causality | None = None,
    refine: float | None = None,
    starts: int = 1,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
    compile: bool = True,
    record: Any = None,
) -> Optimum:
    """Solve an optimal-control problem.

    problem: a subclass of Optimization or an instance.
    elements: their number, or their lengths relative to each other; points: in each (1 to 9); lengths: "free" lets the
    optimiser place the borders. scheme: "radau", "gauss", "lobatto" (points at both ends of an element, as Hermite and
    Simpson's with three), or "shooting" (points: Runge-Kutta steps per element).
    guess: name -> number, array or function of time, or another solution; a component -> a solution of that component.
    Default: a straight line between given initial and final values, else start values.
    controls: input -> dict(kind="constant" | "linear" | "ramps", elements=1, max_step=None, step_penalty=0.0).
    causality: equations of motion solved for forces ("inverse") or accelerations ("forward"); default: the shorter way.
    refine: relative accuracy to which limits and conditions hold when played back, and to which the objective stands; 1e-2
    takes some 2.5 times as long. Default: limits hold at the collocation points alone, and inputs that switch overshoot.
    starts: first guesses that are tried; `.search` of the answer tells the branches they led to.
    tolerance: of Ipopt; max_time: s, of the whole call: a refinement that is not done ends with its best round;
    progress: called with (iteration, objective), and stage= if it takes it: "round 2 of at most 13: playing back".
    compile: whether large functions become machine code where there is a C compiler: it is made beside the solve, and kept
    in the user's cache for later ones; the answer is the same.
    record: a file or folder to which inputs, versions and verdict are written as JSON, whatever the outcome.
    Raises SolveError with `.optimum` and a report when there is no solution, it is not found in time, or Ctrl-C is
    pressed; ModelError for what is written wrongly.
    """
    said = {name: value for name, value in locals().items() if name in PolicyKeywords.__annotations__}
    policy = policy_of("optimize", PolicyKeywords, said)
    if record is not None:
        require_place(record)
    return _optimized(problem, policy, record)


def _optimized(problem: Problem, policy: Policy, record: Any) -> Optimum:
    """`optimize` with its keywords as a record."""
    begun, clock = datetime.now(UTC), Clock(policy.max_time, policy.progress)
    reached = BestSoFar(clock, problem.name if isinstance(problem, SymbolicProblem) else class_name(problem))
    with reached.within_time():
        clock.enter("reading the problem")
        read = problem if isinstance(problem, SymbolicProblem) else read_problem(problem, guess=policy.guess)
        details = dict(problem=problem, options=policy.given, started=begun, read_time=clock.passed)
        clock.enter("building the program")
        found: Optimum | None = None
        try:
            prepared = replace(prepare_with(read, (), policy), reached=reached)
            clock.enter("")
            found = reached.finish(prepared.search())
            return found
        except SolveError as error:
            found = error.optimum
            raise
        except KeyboardInterrupt:
            found = reached.best
            raise
        finally:
            if record is not None and found is not None:
                clock.enter("writing the record")
                write_record(found, record, **details)
    return reached.answer  # which its clock has ended


def class_name(problem: object) -> str:
    """The name of a class, or of that of an instance."""
    return (problem if isinstance(problem, type) else type(problem)).__name__


def prepare(
    problem: Problem, *, parameters: Sequence[str] = (), **policy: Unpack[PolicyKeywords]
) -> Prepared:
    """Read, build and transcribe a problem once, to solve it many times with other values of `parameters`.

    The other keywords are those of `optimize`, but `record`.
    """
    return prepare_with(problem, parameters, policy_of("prepare", PolicyKeywords, policy))


def prepare_with(problem: Problem, parameters: Sequence[str], policy: Policy) -> Prepared:
    """`prepare` with its keywords as a record."""
    read = problem if isinstance(problem, SymbolicProblem) else read_problem(problem, guess=policy.guess)
    begin = time.perf_counter()
    near, guess = solution_given(policy.guess), read_guesses(policy.guess, read)
    held = [n for name in names(parameters) for n in parameter_names(read, name)]
    built = _built(read, guess, held, policy)
    if one_point(read):  # a static problem: one element, one point
        policy = replace(
            policy, elements=1, points=1, scheme="radau", lengths="given", controls=None, refine=None
        )
    built, program = _kept_program(built, policy)
    solver = Solver(program, replace(policy.solver, loops=bool(built.system.loops)))
    return Prepared(
        built, program, solver, guess, time.perf_counter() - begin, policy.refine, policy.starts, near
    )


def _kept_program(built: Built, policy: Policy) -> tuple[Built, Program]:
    """What is transcribed, and its program: those of the last call where this one is about the same."""
    made, mesh = built.read.dae.made, policy.mesh
    how = policy.scheme, policy.points, policy.compile, policy.refine is None
    wanted = built, mesh.borders.tobytes(), mesh.moving, *how
    before, *found = made.get("program", ((),))
    if before != wanted or found[1].assembled.awaited:
        found = _transcribed(built, policy)
        if any(built is one for one in made.values()):
            made["program"] = wanted, *found
    return found[0], found[1]


def _transcribed(built: Built, policy: Policy) -> tuple[Built, Program]:
    """The problem with inputs as they are transcribed, and its program."""
    meshes = [with_jumps(policy.mesh, phase) for phase in built.problem.phases]
    if policy.refine is not None or (policy.mesh.moving and policy.points > 1):
        # free borders would be moved to where limits are passed
        built = replace(built, problem=with_ramps(built.problem, meshes))
    elif policy.points > 1 and policy.transcription.refinable:
        built = replace(built, problem=with_ramped_rates(built.problem))
    program = transcribe(built.problem, policy.transcription.divided(meshes), policy.transcription)
    check_freedom(program)
    return built, program


def _built(read: SymbolicProblem, guess: Mapping[str, Any], held: Sequence[str], policy: Policy) -> Built:
    """The problem in the form that is transcribed, kept with the model where nothing but the problem decides on it."""
    controls = read_controls(read, policy.controls or {})
    if guess or controls or read.courses or read.links:
        return build(read, guess, held, controls, policy.causality)
    made, key = read.dae.made, ("built", *held, policy.causality)
    if key not in made or not made[key].read.says_the_same(read):
        made[key] = build(read, guess, held, controls, policy.causality)
    return made[key]
