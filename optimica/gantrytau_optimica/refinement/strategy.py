"""The order of attempts of a solve: which run, for how many iterations, what each changes, and when it applies.

From one first guess ATTEMPTS are made from top to bottom, until one is good enough or the time of the call is over. Those
below it are made from a solution that is known already, on another mesh or in another form of the program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.first_guesses.guesses import guess_of
from gantrytau_optimica.failures.following_ends import Ends, contradicted, following_ends, without_following
from gantrytau_optimica.refinement.attempts import attempted, timed_solver
from gantrytau_optimica.refinement.incumbent import BestSoFar
from gantrytau_optimica.refinement.refinement import solved_by_arcs, without_ramps
from gantrytau_optimica.refinement.root_regularisation import off_margins
from gantrytau_optimica.solving.ipopt import NOT_BEGUN, Barrier, Solver, SolverSettings, objective_size
from gantrytau_optimica.solving.saddle_escape import aside, beside_obstacles, places_aside
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.transcribe import transcribed_again

STRAYED = 1e-2  # relative: by how much an objective is worse on the next mesh if its branch was lost
FAR = 1e2  # times larger or smaller than its guess is a free number whose size the guess did not tell
VANISHED = 1e-7  # of its size: what a solve leaves of a number that is zero
BENT = (0.1, -0.1)  # of their sizes: how far signals of a guess are bent aside where ends follow from others
MOST_LEFT = 3  # solutions that are no minimum, which a solve leaves

NO_MINIMUM = "stationary but no minimum, as the objective falls to a side; try another guess= or starts="


@dataclass(frozen=True, eq=False)
class FirstGuess:
    """A program to be solved from one first guess of its unknowns.

    near: whether the guess is a solution nearby; ramps: whether inputs are ramps because the answer is to be refined;
    failed: whether an attempt that counts has failed.
    """

    built: Built
    program: Program
    first: np.ndarray
    ramps: bool
    near: bool = False
    failed: bool = False

    @property
    def loops(self) -> bool:
        """Whether positions of loops are found by iteration."""
        return bool(self.built.system.loops)

    @cached_property
    def following(self) -> Ends:
        """Conditions at the end that follow from others there."""
        return following_ends(self.built) if self.program.scheme.refinable else []


@dataclass(frozen=True)
class Attempt:
    """One attempt of Ipopt on a program.

    iterations: at most, None for those of the caller; barrier, firm: those of SolverSettings; applies: where it is made;
    solve: on what, by default the program as it is from its first guess. failure: "dropped", "counts" as that of the
    problem, or "explains" why the others fail. What counts goes on with the next attempt, too, where positions rest on
    the limits that keep loops assembled.
    """

    name: str
    iterations: int | None
    barrier: Barrier = "adaptive"
    firm: bool = True
    applies: Callable[[FirstGuess], bool] = lambda start: True
    solve: Callable[[Solves, Attempt, FirstGuess], Optimum | None] | None = None
    failure: Literal["dropped", "counts", "explains"] = "dropped"

    def settings(self, callers: SolverSettings) -> SolverSettings:
        """Those of the caller as this attempt has them."""
        most = min(callers.max_iterations, self.iterations or callers.max_iterations)
        return replace(callers, barrier=self.barrier, firm=self.firm, max_iterations=most)


def without_following_ends(solves: Solves, attempt: Attempt, start: FirstGuess) -> Optimum | None:
    """Without conditions at the end that follow from others there, on which a solve gets stuck, from both sides of the
    guess, which may be a point of symmetry; no success where the motion found ends elsewhere, None where none is found.
    """
    ends = start.following
    problem = without_following(start.built, ends)
    lighter = transcribed_again(start.program, problem)
    built, first = replace(start.built, problem=problem), first_guess(lighter)
    solver = solves.solver_of(attempt, lighter)
    sides = [solves.lowest_from(built, lighter, solver, aside(lighter, first, far)) for far in BENT]
    found = [one for one in sides if one.success]
    there = [one for one in found if not contradicted(one.phases.values(), ends)]
    if there or not found:
        return min(there, key=lambda one: one.objective, default=None)
    status = f"no solution: {contradicted(found[0].phases.values(), ends)}"
    return replace(found[0], solution=replace(found[0].solution, success=False, status=status))


def over_free_inputs(solves: Solves, attempt: Attempt, start: FirstGuess) -> Optimum | None:
    """From the answer with inputs that are free at every point: by its arcs if they tell all, else with ramps on its mesh;
    that answer itself where ramps have none, None where it is not found.
    """
    plain = transcribed_again(start.program, without_ramps(start.built.problem))
    built = replace(start.built, problem=plain.problem)
    free, _ = solves.in_turn(FirstGuess(built, plain, first_guess(plain), ramps=False))
    if not free.success:
        return None

    def hold(program: Program, first: np.ndarray, hot: bool) -> Optimum:
        return solves.attempt(ON_ARCS, start.built, program, first)

    by_arcs = solved_by_arcs(free, solves.accuracy, True, hold) if solves.left else None
    if by_arcs is not None:
        return by_arcs
    first = warm_start(list(free.phases.values()), start.program)
    for way in (replace(attempt, barrier="near"), attempt):
        if solves.left:
            again = solves.attempt(way, start.built, start.program, first)
            if again.success:
                return again
    return free


ATTEMPTS = (
    Attempt("on the branch of a solution given as guess", 400, "near", applies=lambda start: start.near),
    Attempt("without conditions at the end that follow from others", 300, applies=lambda start: bool(start.following),
            solve=without_following_ends, failure="explains"),
    # loops keep inputs as ramps from coming quickly
    Attempt("ramps, from inputs that are free", 300, applies=lambda start: start.ramps and start.loops,
            solve=over_free_inputs),
    # limits that count as much as the objective; GT-A with ramps takes 86 to 118 iterations
    Attempt("firm limits", 300, applies=lambda start: not start.ramps, failure="counts"),
    Attempt("firm limits, ramps", 150, applies=lambda start: start.ramps, failure="counts"),
    Attempt("ramps, from inputs that are free", 300, solve=over_free_inputs,
            applies=lambda start: start.ramps and not start.loops and start.failed),
    # a barrier that falls no faster than step by step
    Attempt("patient barrier", 300, "patient", applies=lambda start: not start.ramps, failure="counts"),
    Attempt("patient barrier, ramps", 150, "patient", applies=lambda start: start.ramps, failure="counts"),
    Attempt("the objective as it is", None, firm=False, failure="counts"),
)  # fmt: skip

# with inputs held at limits on arcs: programs that have a solution take 1 to 20 iterations
ON_ARCS = Attempt("inputs held on arcs", 30, "hot")
# closer to the structure of a solution: most take less than half
CLOSER = Attempt("closer to where arcs end", 60, "hot")
# three links take 30 to 40 iterations, on many elements 90; a high barrier where the low one leads to a worse branch
ON_NEXT_MESH = (Attempt("on the next mesh", 150, "near"), Attempt("on the next mesh, high barrier", 400))
# from a branch on a coarse mesh GT-A takes 31 to 98 iterations; more leads to one known
FROM_BRANCH = (Attempt("branch on the whole mesh", 200, "near"), Attempt("the same, high barrier", 200))
# closer to zeros of square roots, where many more iterations lead nowhere
NEAR_ROOTS = Attempt("closer to zeros of square roots", 100, "near")
RESIZED = Attempt("sizes of free numbers as they were found", None, "near")


@dataclass(frozen=True, eq=False)
class Solves:
    """The solves of one call, which share its settings, its clock and its best answer.

    solver: of the program of the caller; accuracy: of the refinement, 0 without.
    """

    solver: Solver
    reached: BestSoFar
    build_time: float
    accuracy: float = 0.0

    @property
    def left(self) -> float:
        """Time left in s."""
        return self.reached.clock.left

    def solver_of(self, attempt: Attempt, program: Program) -> Solver:
        """A solver with the settings of an attempt, which ends with the call."""
        return timed_solver(program, attempt.settings(self.solver.settings), self.reached.clock)

    def attempt(self, attempt: Attempt, built: Built, program: Program, first: np.ndarray) -> Optimum:
        """Where an attempt ends from first unknowns of a program, maxima and saddles left."""
        return self.lowest_from(built, program, self.solver_of(attempt, program), first)

    def in_turn(self, start: FirstGuess) -> tuple[Optimum, Attempt]:
        """The best of ATTEMPTS from one first guess, and which it was."""
        best: tuple[Optimum, Attempt] | None = None
        explained: tuple[Optimum, Attempt] | None = None
        for attempt in ATTEMPTS:
            if not attempt.applies(start):
                continue
            if attempt.solve is not None:
                found = attempt.solve(self, attempt, start)
            else:
                found = self.attempt(attempt, start.built, start.program, start.first)
            if attempt.failure != "counts":
                if found is not None and found.success:
                    return found, attempt
                explained = (found, attempt) if found and attempt.failure == "explains" else explained
                continue
            assert found is not None
            if best is None or not best[0].success or (found.success and found.objective < best[0].objective):
                best = found, attempt
            enough = best[0].success and not best[0].solution.held
            if enough or best[0].solution.status == NOT_BEGUN or not self.left:
                break
            start = replace(start, failed=not best[0].success)
        assert best is not None
        return best if explained is None or best[0].success else explained

    def from_guess(self, start: FirstGuess) -> Optimum:
        """The best from one first guess; not on the branch of a guess that is a solution, with sizes as they were found."""
        found, attempt = self.in_turn(start)
        return self._resized(found) if found.success and attempt is not ATTEMPTS[0] else found

    def on_next_mesh(self, optimum: Optimum) -> Callable[..., Optimum]:
        """A function (program on the next mesh, first unknowns, hot) -> Optimum, hot: with the lowest barrier, once."""

        def solve(program: Program, first: np.ndarray, hot: bool = False) -> Optimum:
            low, high = ON_NEXT_MESH
            if hot:
                low = ON_ARCS if any(layout.knots.size for layout in program.places.layouts) else CLOSER
            found = self.attempt(low, optimum.built, program, first)
            worse = found.objective - optimum.objective > STRAYED * optimum.playback.objective_size
            if not (hot or (found.success and not worse) or not self.left):
                other = self.attempt(high, optimum.built, program, first)
                if other.success and not (found.success and found.objective < other.objective):
                    found = other
            return replace(found, left=optimum.left + found.left)

        return solve

    def off_margins(self, found: Optimum, first: np.ndarray) -> Optimum:
        """An optimum that rests on no margins of square roots, if there is one nearby and time to look for it."""

        def solve(built: Built, program: Program, near: bool) -> Optimum:
            if near:
                return self.attempt(NEAR_ROOTS, built, program, found.solution.w)
            return self.lowest_from(built, program, self.solver, first)

        return off_margins(found, solve) if self.left else found

    def _resized(self, found: Optimum) -> Optimum:
        """The optimum once more with sizes as it has them, where a free number ended far from the size of its guess."""
        problem, layouts = found.program.problem, found.program.places.layouts
        sizes = {n.name: n.size for n in problem.free}
        far = [
            n
            for n, x in found.free.items()
            if VANISHED < abs(x) / sizes[n] < 1 / FAR or abs(x) > FAR * sizes[n]
        ]
        if not far or not found.program.scheme.refinable or not self.left:
            return found
        pieces = {s.name: s.pieces for phase in problem.phases for s in phase.inputs}
        held = [n.name for n in problem.free if n.held]
        built = build(found.built.read, guess_of(found, found.dae), held, pieces, found.built.causality)
        free = tuple(
            replace(new, guess=old.guess, min=old.min, max=old.max, nominal=abs(old.guess) or None)
            if old.held
            else new
            for new, old in zip(built.problem.free, problem.free, strict=True)
        )
        built = replace(built, problem=replace(built.problem, free=free))
        located = (
            np.array([n.guess for n in free]),
            [layout.placed(found.solution.w).borders for layout in layouts],
        )
        program = transcribed_again(found.program, built.problem, located=located)
        again = self.attempt(RESIZED, built, program, warm_start(list(found.phases.values()), program))
        return replace(again, left=found.left + again.left) if again.success else found

    def lowest_from(self, built: Built, program: Program, solver: Solver, first: np.ndarray) -> Optimum:
        """Where the solver ends from a first guess of the unknowns of a program, maxima and saddles left."""
        return self.lowest(self._ended(built, program, solver, beside_obstacles(program, first)), solver)

    def lowest(self, found: Optimum, solver: Solver) -> Optimum:
        """A solution, or that to which it leads where the objective falls to a side."""
        for _ in range(MOST_LEFT):
            beside = list(places_aside(found.program, found.solution)) if found.success else []
            better = next(self._better(found, solver, beside), None) if beside else None
            if better is None:
                if beside:
                    found = replace(found, solution=replace(found.solution, status=NO_MINIMUM))
                break
            found = replace(better, left=found.left + 1)
        self.reached.keep(found)
        return found

    def _better(self, found: Optimum, solver: Solver, points: Iterable[np.ndarray]) -> Iterator[Optimum]:
        """Where the solver ends from these unknowns, if the objective is less there."""
        margin = VANISHED * objective_size(found.program)
        for first in points:
            if self.left:
                better = self._ended(found.built, found.program, solver, first)
                if better.success and better.objective < found.objective - margin:
                    yield better

    def _ended(self, built: Built, program: Program, solver: Solver, first: np.ndarray) -> Optimum:
        """Where the solver ends; what was reached knows it as well."""
        return attempted(built, program, solver, first, self.reached, self.build_time)
