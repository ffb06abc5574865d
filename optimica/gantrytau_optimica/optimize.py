"""`optimize`: read, build, transcribe, solve."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError, Result, SolveError
from gantrytau.translation import names
from gantrytau_optimica.building import Built, build, with_guesses
from gantrytau_optimica.checking import static
from gantrytau_optimica.controls import read_controls
from gantrytau_optimica.guesses import guess_of, number_guess
from gantrytau_optimica.ipopt import Policy, Progress, Solver
from gantrytau_optimica.mesh import Mesh, mesh_of, with_borders
from gantrytau_optimica.optimization import Optimization
from gantrytau_optimica.optimum import Optimum
from gantrytau_optimica.program import Program, check_freedom, transcribe
from gantrytau_optimica.reach import out_of_reach, reach_text
from gantrytau_optimica.reading import ReadProblem, read_problem
from gantrytau_optimica.records import FreeNumber, Phase
from gantrytau_optimica.relaxation import worth_relaxing
from gantrytau_optimica.saved import SavedOptimum
from gantrytau_optimica.scheme import collocation
from gantrytau_optimica.shooting import shoot

Problem = Optimization | type[Optimization] | ReadProblem
Guesses = Mapping[str, Any] | Result | Optimum | SavedOptimum
ROUNDS = 5  # of solving again with points at moving times read from other elements

REMEDIES = {
    "no solution: the limits contradict each other": "Widen or correct a limit named here, or try another guess=.",
    "iteration limit reached": "Allow more with max_iterations=, or try another guess=.",
    "time limit reached": "Allow more with max_time=, or try another guess=.",
    "interrupted": "What was reached so far is in .optimum.",
}


def optimize(
    problem: Problem,
    *,
    elements: int | Sequence[float] = 50,
    points: int = 3,
    scheme: str = "radau",
    lengths: Literal["given", "free"] = "given",
    guess: Guesses | None = None,
    controls: Mapping[str, Any] | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
) -> Optimum:
    """Solve an optimal-control problem by direct collocation.

    problem: a subclass of Optimization or an instance; elements, points: of the mesh, points per element (1 to 9);
    scheme: "radau", "gauss", or "shooting" (points: Runge-Kutta steps per element); guess: name -> number, array or
    function of time, or another solution; default: a straight line between given initial and final values, else start
    values. tolerance: of Ipopt; max_time: s; progress: called with (iteration, objective).
    Raises SolveError with `.optimum` and a report when there is no solution, it is not found in time, or Ctrl-C is
    pressed; ModelError for what is written wrongly.
    """
    return prepare(
        problem,
        elements=elements,
        points=points,
        scheme=scheme,
        lengths=lengths,
        guess=guess,
        controls=controls,
        tolerance=tolerance,
        max_iterations=max_iterations,
        max_time=max_time,
        progress=progress,
    ).solve()


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
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
) -> "Prepared":
    """Read, build and transcribe a problem once, to solve it many times with other values of `parameters`.

    The other keywords are those of `optimize`.
    """
    _check(tolerance, max_iterations, max_time, progress)
    shooting = scheme == "shooting"
    grid = collocation("radau" if shooting else scheme, points)
    mesh = mesh_of(elements, _free_lengths(lengths))
    read = problem if isinstance(problem, ReadProblem) else read_problem(problem)
    begin = time.perf_counter()
    guess = _guesses(guess, read)
    held = [n for name in names(parameters) for n in _parameter(read, name)]
    built = build(read, guess, held, read_controls(read, controls or {}))
    if static(read.dae):
        grid, mesh, shooting = collocation("radau", 1), mesh_of(1), False
    meshes = [_with_jumps(mesh, phase) for phase in built.problem.phases]
    program = shoot(built.problem, meshes, points) if shooting else transcribe(built.problem, meshes, grid)
    check_freedom(program)
    policy = Policy(tolerance, max_iterations, max_time, progress)
    return Prepared(built, program, Solver(program, policy), guess, time.perf_counter() - begin)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A problem ready to be solved, again and again. build_time: s."""

    built: Built
    program: Program
    solver: Solver
    guess: Mapping[str, Any]
    build_time: float

    def __repr__(self) -> str:
        size, rows = self.program.places.size, self.program.assembled.rows
        return f"<Prepared {self.built.read.name}: {size} unknowns, {rows} conditions>"

    def solve(self, parameters: Mapping[str, Any] | None = None, guess: Guesses | None = None) -> Optimum:
        """Solve with these values of the parameters named in `prepare`, others as declared; errors of `optimize`."""
        read = self.built.read
        given = self.guess if guess is None else _guesses(guess, read)
        values = self._values(parameters or {})
        free = tuple(self._number(n, values, given) for n in self.built.problem.free)
        built = replace(self.built, problem=replace(self.built.problem, free=free))
        if parameters or guess is not None:
            built = replace(built, problem=with_guesses(built, given))
        program = self.program.with_numbers(built.problem)
        lost = out_of_reach(built)
        if lost:
            unsolved = self.solver.unsolved(program, _first(program, built))
            raise SolveError(
                f"{read.name}: no solution: {reach_text(lost)}. Correct these conditions, or the "
                "parameters of the model.",
                equations=[x.equation for x in lost],
                optimum=Optimum(read.name, built, program, unsolved, self.build_time),
            )
        solution = self.solver.solve(program, _first(program, built))
        for _ in range(ROUNDS):
            if not solution.success or not program.astray(solution.w):
                break
            program = _relocated(program, solution.w)
            solution = Solver(program, self.solver.policy).solve(program, solution.w)
        optimum = Optimum(read.name, built, program, solution, self.build_time)
        if not solution.success:
            remedy = REMEDIES.get(solution.status, "Try another guess=, more elements=, or look at .optimum.")
            ways = f"\n{optimum.relaxed}" if worth_relaxing(program, solution) else ""
            raise SolveError(f"{optimum.report()}{ways}\n{remedy}", optimum=optimum)
        return optimum

    def _values(self, parameters: Mapping[str, Any]) -> dict[str, float]:
        found: dict[str, float] = {}
        held = [n.name for n in self.built.problem.free if n.held]
        for name, value in parameters.items():
            elements = _parameter(self.built.read, name)
            numbers = np.asarray(value, dtype=float).ravel(order="F")
            if any(element not in held for element in elements):
                raise ModelError(
                    f"{name}: was not named in prepare(parameters=[...]), expected one of {held}"
                )
            if numbers.size != len(elements) or not np.all(np.isfinite(numbers)):
                raise ModelError(f"{name}: found {value!r}, expected {len(elements)} finite numbers")
            found.update(zip(elements, numbers.tolist(), strict=True))
        return found

    def _number(
        self, number: FreeNumber, values: Mapping[str, float], guess: Mapping[str, Any]
    ) -> FreeNumber:
        if not number.held:
            return replace(number, guess=number_guess(number.name, guess, number.guess))
        value = values.get(number.name, self.built.read.dae.table.values[number.name])
        return replace(number, guess=value, min=value, max=value)


def _relocated(program: Program, w: np.ndarray) -> Program:
    """The program with the points at moving times read from the elements in which they now lie."""
    layouts = program.places.layouts
    borders = [layout.placed(w).borders for layout in layouts]
    located = (w[program.places.free], borders)
    return transcribe(program.problem, [layout.mesh for layout in layouts], layouts[0].scheme, located)


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


def _check(tolerance: Any, max_iterations: Any, max_time: Any, progress: Any) -> None:
    if not isinstance(tolerance, float) or not 0 < tolerance < 1:
        raise ModelError(f"tolerance={tolerance!r}: expected a number between 0 and 1")
    if isinstance(max_iterations, bool) or not isinstance(max_iterations, int) or max_iterations < 1:
        raise ModelError(f"max_iterations={max_iterations!r}: expected a whole number of at least 1")
    if not isinstance(max_time, (int, float)) or not max_time > 0:
        raise ModelError(f"max_time={max_time!r}: expected seconds above 0")
    if progress is not None and not callable(progress):
        raise ModelError(f"progress={progress!r}: expected a function of (iteration, objective)")


def _guesses(guess: Any, read: ReadProblem) -> dict[str, Any]:
    if isinstance(guess, (Result, Optimum)):
        return guess_of(guess, read.dae)
    if isinstance(guess, SavedOptimum):
        return guess.guesses(read.dae)
    if guess is not None and not isinstance(guess, Mapping):
        raise ModelError(
            f"guess={guess!r}: expected {{name: number, array or function of time}}, a Result or an Optimum"
        )
    for name in guess or {}:
        read.dae.expand(name)
    return dict(guess or {})


def _parameter(read: ReadProblem, name: str) -> tuple[str, ...]:
    elements = read.dae.expand(name)
    if elements[0] not in read.dae.table.symbols:
        raise ModelError(f"{read.name}: {name} is no parameter, expected one; declare it as a Parameter")
    return tuple(elements)


def _first(program: Program, built: Built) -> np.ndarray:
    """The guess as unknowns of the program, inside of their bounds."""
    places = program.places
    w = np.zeros(places.size)
    w[places.free] = [number.guess for number in built.problem.free]
    for layout, phase in zip(places.layouts, built.problem.phases, strict=True):
        w[layout.knots] = layout.mesh.borders[list(layout.mesh.moving)]
        for number, signal in enumerate(phase.signals):
            mine = layout.of(number)
            w[mine] = signal.guess(layout.moment[mine - layout.first])
    return np.clip(w, program.lbw * places.scale, program.ubw * places.scale)
