"""`optimize`: read, build, transcribe, solve."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError, Result, SolveError
from gantrytau.translation import names
from gantrytau_optimica.building import Built, build, number_guess, with_guesses
from gantrytau_optimica.guesses import guess_of
from gantrytau_optimica.ipopt import Progress, Solver
from gantrytau_optimica.optimization import Optimization
from gantrytau_optimica.optimum import Optimum
from gantrytau_optimica.program import Program, transcribe
from gantrytau_optimica.reach import out_of_reach, reach_text
from gantrytau_optimica.reading import ReadProblem, read_problem
from gantrytau_optimica.records import FreeNumber
from gantrytau_optimica.scheme import collocation

Problem = Optimization | type[Optimization] | ReadProblem
Guesses = Mapping[str, Any] | Result | Optimum

REMEDIES = {
    "no solution: the limits contradict each other": "Widen or correct a limit named here, or try another guess=.",
    "iteration limit reached": "Allow more with max_iterations=, or try another guess=.",
    "time limit reached": "Allow more with max_time=, or try another guess=.",
    "interrupted": "What was reached so far is in .optimum.",
}


def optimize(
    problem: Problem,
    *,
    elements: int = 50,
    points: int = 3,
    scheme: str = "radau",
    guess: Guesses | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
) -> Optimum:
    """Solve an optimal-control problem by direct collocation.

    problem: a subclass of Optimization or an instance; elements, points: of the mesh, points per element (1 to 9);
    scheme: "radau" or "gauss"; guess: name -> number, array or function of time, or another solution; default: a
    straight line between given initial and final values, else start values. tolerance: of Ipopt; max_time: s;
    progress: called with (iteration, objective).
    Raises SolveError with `.optimum` and a report when there is no solution, it is not found in time, or Ctrl-C is
    pressed; ModelError for what is written wrongly.
    """
    return prepare(
        problem,
        elements=elements,
        points=points,
        scheme=scheme,
        guess=guess,
        tolerance=tolerance,
        max_iterations=max_iterations,
        max_time=max_time,
        progress=progress,
    ).solve()


def prepare(
    problem: Problem,
    *,
    parameters: Sequence[str] = (),
    elements: int = 50,
    points: int = 3,
    scheme: str = "radau",
    guess: Guesses | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 1000,
    max_time: float = 300.0,
    progress: Progress | None = None,
) -> "Prepared":
    """Read, build and transcribe a problem once, to solve it many times with other values of `parameters`.

    The other keywords are those of `optimize`.
    """
    _check(elements, tolerance, max_iterations, max_time, progress)
    grid = collocation(scheme, points)
    read = problem if isinstance(problem, ReadProblem) else read_problem(problem)
    begin = time.perf_counter()
    guess = _guesses(guess, read)
    held = [n for name in names(parameters) for n in _parameter(read, name)]
    built = build(read, guess, held)
    program = transcribe(built.problem, np.linspace(0.0, 1.0, elements + 1), grid)
    _check_freedom(read.name, program)
    solver = Solver(
        program, tolerance=tolerance, max_iterations=max_iterations, max_time=max_time, progress=progress
    )
    return Prepared(built, program, solver, guess, time.perf_counter() - begin)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A problem ready to be solved, again and again. build_time: s."""

    built: Built
    program: Program
    solver: Solver
    guess: Mapping[str, Any]
    build_time: float

    def __repr__(self) -> str:
        return f"<Prepared {self.built.read.name}: {self.program.places.size} unknowns, {len(self.program.rows)} conditions>"

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
        optimum = Optimum(read.name, built, program, solution, self.build_time)
        if not solution.success:
            remedy = REMEDIES.get(solution.status, "Try another guess=, more elements=, or look at .optimum.")
            raise SolveError(f"{optimum.report()}\n{remedy}", optimum=optimum)
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


def _check(elements: Any, tolerance: Any, max_iterations: Any, max_time: Any, progress: Any) -> None:
    if isinstance(elements, bool) or not isinstance(elements, int) or elements < 1:
        raise ModelError(f"elements={elements!r}: expected a whole number of at least 1")
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
    problem = built.problem
    w = np.zeros(program.places.scale.size)
    inside = (
        program.places.mesh[:-1, None] + np.diff(program.places.mesh)[:, None] * program.places.scheme.points
    )
    for signals, table in (
        (problem.states, program.places.states),
        (problem.algebraics, program.places.algebraics),
        (problem.inputs, program.places.inputs),
    ):
        for column, signal in enumerate(signals):
            w[table[..., column]] = signal.guess(inside.ravel()).reshape(inside.shape)
    for column, signal in enumerate(problem.states):
        w[program.places.starts[:, column]] = signal.guess(program.places.mesh)
    w[program.places.free] = [number.guess for number in problem.free]
    return np.clip(w, program.lbw * program.places.scale, program.ubw * program.places.scale)


def _check_freedom(name: str, program: Program) -> None:
    equalities = int(np.sum(program.lbg == program.ubg))
    fixed = int(np.sum(program.lbw == program.ubw))
    unknowns = program.places.scale.size - fixed
    if unknowns == 0:
        raise ModelError(f"{name}: nothing is free; declare a Free number or an Input")
    if equalities > unknowns:
        raise ModelError(
            f"{name}: {equalities} conditions for {unknowns} unknowns on this mesh, expected no more conditions than "
            "unknowns; remove some at the ends or along the path, or free a number"
        )
