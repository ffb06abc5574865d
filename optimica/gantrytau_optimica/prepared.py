"""A problem ready to be solved, again and again, with other parameters and guesses."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError, SolveError
from gantrytau.border.refusal import Given
from gantrytau.border.units import given
from gantrytau.describing.record import Record
from gantrytau.flattening.shapes import elements_of
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import with_guesses
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import FreeNumber
from gantrytau_optimica.control.first_guesses.guesses import number_guess
from gantrytau_optimica.control.root_margins import with_margins
from gantrytau_optimica.failures.end_closure import open_ends
from gantrytau_optimica.failures.end_equilibrium import held_ends
from gantrytau_optimica.failures.reach import out_of_reach, reach_text
from gantrytau_optimica.failures.relaxation import worth_relaxing
from gantrytau_optimica.guesses_and_parameters import parameter_names, read_guesses, solution_given
from gantrytau_optimica.policy import Guesses as GivenGuesses
from gantrytau_optimica.refinement.attempts import Attempts
from gantrytau_optimica.refinement.incumbent import LATE, BestSoFar
from gantrytau_optimica.refinement.motions import as_motion, stopped_told
from gantrytau_optimica.refinement.multistart import best_refined, searched
from gantrytau_optimica.refinement.refinement import refined
from gantrytau_optimica.refinement.strategy import FROM_BRANCH, FirstGuess, Solves
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.ipopt import Solver
from gantrytau_optimica.transcription.program import Program, first_guess

GUESS = "try another ", Given("guess")
REMEDIES = {
    "no solution: the limits contradict each other": (
        "Widen or correct a limit named here, or ",
        *GUESS,
        ".",
    ),
    "iteration limit reached": ("Allow more with ", Given("max_iterations"), ", or ", *GUESS, "."),
    "time limit reached": ("Allow more with ", Given("max_time"), ", or ", *GUESS, "."),
    "diverging: the problem may be unbounded": (
        "Limit what runs away, or ",
        *GUESS,
        " or ",
        Given("starts"),
        ".",
    ),
}
OTHERWISE = "Try another ", Given("guess"), ", more ", Given("elements"), ", or look at .optimum."


@dataclass(frozen=True, eq=False)
class Prepared(Record):
    """A problem ready to be solved, again and again. build_time: s."""

    built: Built
    program: Program
    solver: Solver
    guess: Mapping[str, Any]
    build_time: float
    refine: float | None = None
    starts: int = 1
    near: bool = False  # whether the guess is a solution
    reached: BestSoFar | None = None  # by the call at hand

    def __repr__(self) -> str:
        size, rows = self.program.places.size, self.program.assembled.rows
        return f"<Prepared {self.built.read.name}: {size} unknowns, {rows} conditions>"

    def solve(
        self, parameters: Mapping[str, Any] | None = None, guess: GivenGuesses | None = None
    ) -> Optimum:
        """Solve with these values of the parameters named in `prepare`, others as declared; errors of `optimize`."""
        settings = self.solver.settings
        reached = BestSoFar(Clock(settings.max_time, settings.progress), self.built.read.name)
        with reached.within_time():
            return reached.finish(replace(self, reached=reached).search(parameters, guess))
        return reached.answer

    def search(
        self, parameters: Mapping[str, Any] | None = None, guess: GivenGuesses | None = None
    ) -> Optimum:
        """`solve` as a part of a call that has `reached` something already, and looks after Ctrl-C itself."""
        read, reached = self.built.read, self.reached
        assert reached is not None
        given = self.guess if guess is None else read_guesses(guess, read)
        values = self._values(parameters or {})
        free = tuple(self._number(n, values, given) for n in self.built.problem.free)
        built = replace(self.built, problem=replace(self.built.problem, free=free))
        if parameters or guess is not None:
            built = replace(built, problem=with_margins(with_guesses(built, given)))
        program = self.program.with_numbers(built.problem)
        lost = out_of_reach(built)
        opened = "" if lost else open_ends(built)
        if lost or opened:
            unsolved = self.solver.unsolved(program, first_guess(program))
            reached.keep(Optimum(read.name, built, program, unsolved, self.build_time))
            raise SolveError(
                f"{read.name}: no solution: {opened or reach_text(lost)}. Correct these conditions, or the "
                "parameters of the model.",
                equations=[x.equation for x in lost],
                optimum=reached.best,
            )
        first = first_guess(program)
        if isinstance(guess, Optimum) and guess.program.assembled is self.program.assembled:
            first = guess.solution.w
        near = self.near if guess is None else solution_given(guess)
        accuracy, ramps = self.refine or 0.0, self.refine is not None
        solves = Solves(self.solver, reached, self.build_time, accuracy)
        optimum = self._best(solves, FirstGuess(built, program, first, ramps, near))
        if not ramps:
            return optimum
        better = best_refined(
            optimum, lambda one: refined(one, accuracy, solves.on_next_mesh(one), reached), reached
        )
        return stopped_told(better)

    def _best(self, solves: Solves, start: FirstGuess) -> Optimum:
        """The optimum from the guess, or the best from several. Raises SolveError if none is found."""
        reached, search = solves.reached, None
        if self.starts == 1:
            best = solves.from_guess(start)
        else:
            ways = [attempt.settings(self.solver.settings) for attempt in FROM_BRANCH]
            whole = Attempts(start.built, start.program, ways, reached, self.build_time)
            best, search = searched(lambda: solves.from_guess(start), whole, self.starts, start.ramps)
            if (
                search is not None and best.program.assembled is self.program.assembled
            ):  # else it was looked at
                best = solves.lowest(best, self.solver)
        best = solves.off_margins(best, start.first)
        if search is not None:
            best = best.with_notes(search=search)
            if not best.success and not solves.left:
                raise reached.stopped(LATE)

        def solve(program: Program, first: np.ndarray) -> Optimum:
            built = replace(best.built, problem=program.problem)
            return solves.in_turn(FirstGuess(built, program, first, start.ramps))[0]

        return solved_or_raise(as_motion(best, solve, lambda: solves.left))

    def _values(self, parameters: Mapping[str, Any]) -> dict[str, float]:
        found: dict[str, float] = {}
        held = [n.name for n in self.built.problem.free if n.held]
        for name, value in parameters.items():
            elements = parameter_names(self.built.read, name)
            if any(element not in held for element in elements):
                named = Given("parameters", [name])
                raise ModelError(
                    f"expected some of {held}, as named in prepare", place=self.built.read.name, found=named
                )
            expected = f"{len(elements)} finite numbers"
            flat = self.built.read.dae.flat
            value = given(name, value, flat.unit(name))
            numbers = elements_of(name, value, flat.shape(name), expected, expected)
            found.update(zip(elements, numbers, strict=True))
        return found

    def _number(
        self, number: FreeNumber, values: Mapping[str, float], guess: Mapping[str, Any]
    ) -> FreeNumber:
        if not number.held:
            return replace(number, guess=number_guess(number.name, guess, number.guess))
        value = values.get(number.name, self.built.read.dae.parameter_values[number.name])
        return replace(number, guess=value, min=value, max=value)


def solved_or_raise(optimum: Optimum) -> Optimum:
    """The optimum if it is one; else SolveError with the report, and what would have to give."""
    solution, program = optimum.solution, optimum.program
    if solution.success:
        return optimum
    remedy = REMEDIES.get(solution.status, OTHERWISE)
    ways = f"\n{optimum.relaxed}" if worth_relaxing(program, solution) else ""
    ends = "".join(f"\n{said}" for said in held_ends(optimum.built))
    raise SolveError(f"{optimum.report()}{ways}{ends}\n", *remedy, optimum=optimum)
