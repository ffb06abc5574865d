"""`optimize`: read, build, transcribe, solve."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau import ModelError, Result, SolveError
from gantrytau_optimica.building import Built, build
from gantrytau_optimica.scheme import collocation
from gantrytau_optimica.guesses import guess_of
from gantrytau_optimica.optimization import Optimization
from gantrytau_optimica.optimum import Optimum
from gantrytau_optimica.reading import ReadProblem, read_problem
from gantrytau_optimica.ipopt import Progress, Solver
from gantrytau_optimica.program import Program, transcribe


def optimize(
    problem: Optimization | type[Optimization] | ReadProblem,
    *,
    elements: int = 50,
    points: int = 3,
    scheme: str = "radau",
    guess: Mapping[str, Any] | Result | Optimum | None = None,
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
    if not isinstance(elements, int) or elements < 1:
        raise ModelError(f"elements={elements!r}: expected a whole number of at least 1")
    read = problem if isinstance(problem, ReadProblem) else read_problem(problem)
    begin = time.perf_counter()
    if isinstance(guess, (Result, Optimum)):
        guess = guess_of(guess, read.dae)
    for name in guess or {}:
        read.dae.expand(name)
    built = build(read, dict(guess or {}))
    program = transcribe(built.problem, np.linspace(0.0, 1.0, elements + 1), collocation(scheme, points))
    _check_freedom(read.name, program)
    solver = Solver(
        program, tolerance=tolerance, max_iterations=max_iterations, max_time=max_time, progress=progress
    )
    building = time.perf_counter() - begin
    solution = solver.solve(_first(program, built))
    optimum = Optimum(read.name, built, program, solution, building)
    if not solution.success:
        raise SolveError(
            f"{optimum.report()}\nTry another guess= or more elements=, widen a limit, or look at .optimum.",
            optimum=optimum,
        )
    return optimum


def _first(program: Program, built: Built) -> np.ndarray:
    """The guess as unknowns of the program, inside of their bounds."""
    problem = built.problem
    w = np.zeros(program.scale.size)
    inside = program.mesh[:-1, None] + np.diff(program.mesh)[:, None] * program.scheme.points
    for signals, table in (
        (problem.states, program.states),
        (problem.algebraics, program.algebraics),
        (problem.inputs, program.inputs),
    ):
        for column, signal in enumerate(signals):
            w[table[..., column]] = signal.guess(inside.ravel()).reshape(inside.shape)
    for column, signal in enumerate(problem.states):
        w[program.starts[:, column]] = signal.guess(program.mesh)
    w[program.free] = [number.guess for number in problem.free]
    return np.clip(w, program.lbw * program.scale, program.ubw * program.scale)


def _check_freedom(name: str, program: Program) -> None:
    equalities = int(np.sum(program.lbg == program.ubg))
    fixed = int(np.sum(program.lbw == program.ubw))
    unknowns = program.scale.size - fixed
    if unknowns == 0:
        raise ModelError(f"{name}: nothing is free; declare a Free number or an Input")
    if equalities > unknowns:
        raise ModelError(
            f"{name}: {equalities} conditions for {unknowns} unknowns; there are more conditions at the ends than "
            "the inputs can meet: remove some, or free a number"
        )
