"""One program solved from other first unknowns, here or in another process."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.refinement.incumbent import BestSoFar
from gantrytau_optimica.solving.assembly import jumps, solved_assembled
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.ipopt import Pressed, Solution, Solver, SolverSettings
from gantrytau_optimica.solving.moving_points import settled
from gantrytau_optimica.transcription.program import Program

LEAST_TIME = 1e-3  # s, that Ipopt is given where none is left

Ended = tuple[Solution, Program | None]


def timed_solver(program: Program, settings: SolverSettings, clock: Clock) -> Solver:
    """A solver that ends with the call."""
    return Solver(program, replace(settings, max_time=max(clock.left, LEAST_TIME)))


def attempted(
    built: Built, program: Program, solver: Solver, first: np.ndarray, reached: BestSoFar, build_time: float
) -> Optimum:
    """Where the solver ends from a first guess of the unknowns of a program; what was reached knows it as well.

    ModelError where a time that moves has left its horizon.
    """
    clock = reached.clock
    try:
        solution = solved_assembled(solver, program, built.system.loops, first, clock)
        program, solution = settled(
            program, solution, lambda p, w: timed_solver(p, solver.settings, clock).solve(p, w, clock)
        )
        built = replace(built, problem=program.problem)
    except Pressed as pressed:
        reached.keep(Optimum(built.read.name, built, program, pressed.solution, build_time))
        raise
    if solution.success:
        program.require_points(solution.w)
    optimum = Optimum(built.read.name, built, program, solution, build_time)
    if solution.success:
        jump = next(filter(None, (jumps(built, one) for one in optimum.phases.values())), "")
        if jump:
            optimum = replace(optimum, solution=replace(solution, success=False, status=jump))
    reached.keep(optimum)
    return optimum


class Attempts:
    """A program to be solved from first unknowns w; sent to another process it makes its solvers there, for the time that
    is left.

    settings: of the solvers that are tried, one after the other until there is a solution.
    """

    def __init__(
        self,
        built: Built,
        program: Program,
        settings: Sequence[SolverSettings],
        reached: BestSoFar,
        build_time: float,
    ):
        self.built, self.program, self.settings = built, program, tuple(settings)
        self.reached, self.build_time = reached, build_time
        self.solvers: dict[int, Solver] = {}

    def __getstate__(self) -> tuple[Any, ...]:
        settings = tuple(replace(one, progress=None) for one in self.settings)
        return self.built, self.program, settings, self.reached.clock.left

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        built, program, settings, left = state
        self.__init__(built, program, settings, BestSoFar(Clock(left), built.read.name), 0.0)

    def __call__(self, first: np.ndarray) -> Ended:
        """Where the solver ended, and the program if times that move made it another one."""
        found: Ended | None = None
        for number in range(len(self.settings)):
            found = self._once(self.solver(number), first)
            if found[0].success or not self.reached.clock.left:
                break
        assert found is not None
        return found

    def solver(self, number: int) -> Solver:
        """The solver with those settings, made once."""
        if number not in self.solvers:
            self.solvers[number] = timed_solver(self.program, self.settings[number], self.reached.clock)
        return self.solvers[number]

    def _once(self, solver: Solver, first: np.ndarray) -> Ended:
        args = self.built, self.program, solver, first, self.reached, self.build_time
        try:
            found = attempted(*args)
        except ModelError as error:  # this first guess leads to no solution, others may
            return replace(solver.unsolved(self.program, first), status=str(error)), None
        return found.solution, None if found.program is self.program else found.program

    def optimum(self, ended: Ended) -> Optimum:
        """The end of a solve, here or elsewhere, as an optimum that is taken note of."""
        solution, other = ended
        program = self.program if other is None else other
        built = replace(self.built, problem=program.problem)
        optimum = Optimum(built.read.name, built, program, solution, self.build_time)
        self.reached.keep(optimum)
        return optimum
