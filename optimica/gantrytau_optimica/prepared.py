"""A problem ready to be solved, again and again, with other parameters and guesses."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import ModelError, SolveError
from gantrytau.border.units import given
from gantrytau.describing.record import Record
from gantrytau.flattening.shapes import elements_of
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build, with_guesses
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import FreeNumber
from gantrytau_optimica.control.first_guesses.guesses import guess_of, number_guess
from gantrytau_optimica.control.root_margins import with_margins
from gantrytau_optimica.failures.end_closure import open_ends
from gantrytau_optimica.failures.end_equilibrium import held_ends
from gantrytau_optimica.failures.following_ends import contradicted, following_ends, without_following
from gantrytau_optimica.failures.reach import out_of_reach, reach_text
from gantrytau_optimica.failures.relaxation import worth_relaxing
from gantrytau_optimica.guesses_and_parameters import parameter_names, read_guesses, solution_given
from gantrytau_optimica.policy import Guesses as GivenGuesses
from gantrytau_optimica.refinement.attempts import Attempts, attempted, timed_solver
from gantrytau_optimica.refinement.incumbent import LATE, BestSoFar
from gantrytau_optimica.refinement.motions import as_motion, stopped_told
from gantrytau_optimica.refinement.multistart import best_refined, searched
from gantrytau_optimica.refinement.refinement import refined, solved_by_arcs, without_ramps
from gantrytau_optimica.refinement.root_regularisation import off_margins
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.ipopt import NOT_BEGUN, Solver, SolverSettings, objective_size
from gantrytau_optimica.solving.saddle_escape import aside, beside_obstacles, places_aside
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.transcribe import transcribe

STRAYED = 1e-2  # relative: by how much an objective is worse on the next mesh if its branch was lost
MOST_FROM_COARSE = (
    200  # iterations from a branch on a coarse mesh: GT-A takes 31 to 98; more leads to one known
)
MOST_FIRM = 300  # iterations of attempts before the last
MOST_RAMPS = 150  # of one with inputs as ramps: GT-A takes 86 to 118
MOST_HOT = 60  # iterations of one that looks closer at the structure of a solution: most take less than half
MOST_HELD = 30  # with inputs held at limits on arcs: those that have a solution take 1 to 20
MOST_NEAR = 150  # of one on the next mesh, before the barrier begins high: three links take 30 to 40, on many elements 90
MOST_AGAIN = 400  # iterations of a solve that starts from a solution on another mesh

FAR = 1e2  # times larger or smaller than its guess is a free number whose size the guess did not tell
VANISHED = 1e-7  # of its size: what a solve leaves of a number that is zero
MOST_CLOSER = 100  # iterations closer to zeros of square roots, where many more lead nowhere
BENT = (0.1, -0.1)  # of their sizes: how far signals of a guess are bent aside where ends follow from others
MOST_LEFT = 3  # places that are no minimum, which a solve leaves

NO_MINIMUM = "stationary but no minimum, as the objective falls to a side; try another guess= or starts="
REMEDIES = {
    "no solution: the limits contradict each other": "Widen or correct a limit named here, or try another guess=.",
    "iteration limit reached": "Allow more with max_iterations=, or try another guess=.",
    "time limit reached": "Allow more with max_time=, or try another guess=.",
    "diverging: the problem may be unbounded": "Limit what runs away, or try another guess= or starts=.",
}


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
        read, reached = self.built.read, self._reached
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
        optimum = self._best(built, program, first, self.near if guess is None else solution_given(guess))
        if self.refine is None:
            return optimum
        best = best_refined(optimum, lambda branch: self._refined(branch, self.refine or 0.0), reached)
        return stopped_told(best)

    def _refined(self, optimum: Optimum, accuracy: float) -> Optimum:
        """The optimum on better and better meshes until it holds."""
        settings, reached = self.solver.settings, self._reached
        again = replace(settings, max_iterations=min(settings.max_iterations, MOST_AGAIN))

        def solve(program: Program, first: np.ndarray, hot: bool = False) -> Optimum:
            """On the next mesh; with a high barrier where the low one leads to a worse branch, or none; `hot` never so."""
            moves = any(layout.knots.size for layout in program.places.layouts)
            few = (MOST_HELD if moves else MOST_HOT) if hot else MOST_NEAR
            barrier = "hot" if hot else "near"
            close = replace(again, barrier=barrier, max_iterations=min(again.max_iterations, few))
            found = self.solved(optimum.built, program, self._solver(program, close), first)
            worse = found.objective - optimum.objective > STRAYED * optimum.playback.objective_size
            if hot or (found.success and not worse) or not reached.clock.left:
                return found
            high = self.solved(optimum.built, program, self._solver(program, again), first)
            higher = high.success and not (found.success and found.objective < high.objective)
            return high if higher else found

        def told(program: Program, first: np.ndarray, hot: bool = False) -> Optimum:
            found = solve(program, first, hot)
            return replace(found, left=optimum.left + found.left)

        return refined(optimum, accuracy, told, reached)

    @property
    def _reached(self) -> BestSoFar:
        assert self.reached is not None
        return self.reached

    def _solver(self, program: Program, settings: SolverSettings) -> Solver:
        """A solver that ends with the call."""
        return timed_solver(program, settings, self._reached.clock)

    def _best(self, built: Built, program: Program, first: np.ndarray, near: bool) -> Optimum:
        """The optimum from the guess, or the best from several. Raises SolveError if none is found."""
        if self.starts == 1:
            found = self._off_margins(self._alone(built, program, first, near), first)
            return solved_or_raise(self._as_motion(found))
        reached, settings = self._reached, self.solver.settings
        most = min(settings.max_iterations, MOST_FROM_COARSE)
        few = replace(settings, max_iterations=most)
        close = [replace(few, barrier="near"), few]
        whole = Attempts(built, program, close, reached, self.build_time)
        best, search = searched(
            lambda: self._alone(built, program, first, near), whole, self.starts, self.refine is not None
        )
        if search is not None and best.program.assembled is self.program.assembled:  # else it was looked at
            best = self._lowest(best, self.solver)
        best = self._off_margins(best, first)
        best = replace(best, search=search) if search is None else best.with_notes(search=search)
        if not best.success and search is not None and not reached.clock.left:
            raise reached.stopped(LATE)
        return solved_or_raise(self._as_motion(best))

    def _as_motion(self, found: Optimum) -> Optimum:
        """An answer that is a motion when played back, on twice the elements where it is none on these."""

        def solve(program: Program, first: np.ndarray) -> Optimum:
            return self._in_turn(replace(found.built, problem=program.problem), program, first)

        return as_motion(found, solve, lambda: self._reached.clock.left)

    def _alone(self, built: Built, program: Program, first: np.ndarray, near: bool) -> Optimum:
        """From one first guess, on its branch if it is a solution; with ramps, over the answer without if need be."""
        if near:
            settings = self.solver.settings
            most = min(settings.max_iterations, MOST_AGAIN)
            nearby = self._solver(program, replace(settings, barrier="near", max_iterations=most))
            optimum = self.solved(built, program, nearby, first)
            if optimum.success:
                return optimum
        optimum = self._in_turn(built, program, first)
        return self._resized(optimum) if optimum.success else optimum

    def _over_free(self, built: Built, program: Program) -> Optimum | None:
        """With inputs as ramps, from the answer with inputs that are free at every point: by its arcs if they tell all,
        else on its mesh; that answer itself where ramps have none, None where it is not found.
        """
        settings, layouts = self.solver.settings, program.places.layouts
        plain = transcribe(
            without_ramps(built.problem), [layout.mesh for layout in layouts], layouts[0].scheme
        )
        free = replace(self, refine=None)._in_turn(
            replace(built, problem=plain.problem), plain, first_guess(plain)
        )
        if not free.success:
            return None
        settings = replace(settings, max_iterations=min(settings.max_iterations, MOST_FIRM))

        def solve(program: Program, first: np.ndarray, hot: bool) -> Optimum:
            few = replace(
                settings,
                barrier="hot" if hot else "adaptive",
                max_iterations=min(settings.max_iterations, MOST_HELD),
            )
            return self.solved(built, program, self._solver(program, few), first)

        by_arcs = solved_by_arcs(free, self.refine or 0.0, True, solve) if self._reached.clock.left else None
        if by_arcs is not None:
            return by_arcs
        first = warm_start(list(free.phases.values()), program)
        for way in (replace(settings, barrier="near"), settings):
            if self._reached.clock.left:
                again = self.solved(built, program, self._solver(program, way), first)
                if again.success:
                    return again
        return free

    def _off_margins(self, found: Optimum, first: np.ndarray) -> Optimum:
        """An optimum that rests on no margins of square roots, if there is one nearby and time to look for it."""
        settings = self.solver.settings
        few = replace(settings, barrier="near", max_iterations=min(settings.max_iterations, MOST_CLOSER))

        def solve(built: Built, program: Program, near: bool) -> Optimum:
            solver = self._solver(program, few) if near else self.solver
            return self.solved(built, program, solver, found.solution.w if near else first)

        return off_margins(found, solve) if self._reached.clock.left else found

    def _in_turn(self, built: Built, program: Program, first: np.ndarray) -> Optimum:
        """From one first guess: with limits that count as much as the objective, then with a barrier that falls no faster
        than step by step, at last with the objective as it is; each one only where those before leave to be desired.
        Inputs as ramps, where loops keep them from coming quickly or the first of these ways fails, over the answer without.
        """
        lighter = self._without_following(built, program)
        if lighter is not None and lighter.success:
            return lighter
        settings = self.solver.settings
        over_free = settings.firm and self.refine is not None
        if over_free and built.system.loops:
            over_free, over = False, self._over_free(built, program)
            if over is not None:
                return over
        most = MOST_FIRM if self.refine is None else MOST_RAMPS
        few = replace(settings, max_iterations=min(settings.max_iterations, most))
        ways = [few, replace(few, barrier="patient"), replace(settings, firm=False)]
        best: Optimum | None = None
        for way in ways if settings.firm else [settings]:
            found = self.solved(built, program, self._solver(program, way), first)
            better = found.success and not (best and best.success and best.objective <= found.objective)
            best = found if best is None or better or not best.success else best
            free = best.success and not best.solution.held
            if free or best.solution.status == NOT_BEGUN or not self._reached.clock.left:
                break
            if over_free and not best.success:
                over_free, over = False, self._over_free(built, program)
                if over is not None:
                    return over
        assert best is not None
        return best if lighter is None or best.success else lighter

    def _without_following(self, built: Built, program: Program) -> Optimum | None:
        """Without conditions at the end that follow from others there, on which a solve gets stuck, from both sides of the
        guess, which may be a place of symmetry; None where none do, or the motion that is found ends elsewhere.
        """
        layouts, ends = program.places.layouts, following_ends(built)
        if not ends or layouts[0].scheme.scheme == "shooting":
            return None
        problem = without_following(built, ends)
        lighter = transcribe(problem, [layout.mesh for layout in layouts], layouts[0].scheme)
        built, first = replace(built, problem=problem), first_guess(lighter)
        most = min(self.solver.settings.max_iterations, MOST_FIRM)
        solver = self._solver(lighter, replace(self.solver.settings, max_iterations=most))
        found = [self.solved(built, lighter, solver, aside(lighter, first, far)) for far in BENT]
        there = [one for one in found if one.success and not contradicted(one.phases.values(), ends)]
        if there:
            return min(there, key=lambda one: one.objective)
        told = next((one for one in found if one.success), None)
        if told is None:
            return None
        status = f"no solution: {contradicted(told.phases.values(), ends)}"
        return replace(told, solution=replace(told.solution, success=False, status=status))

    def _resized(self, found: Optimum) -> Optimum:
        """The optimum once more with sizes as it has them, where a free number ended far from the size of its guess."""
        problem, layouts = found.program.problem, found.program.places.layouts
        sizes = {n.name: n.size for n in problem.free}
        far = [
            n
            for n, x in found.free.items()
            if VANISHED < abs(x) / sizes[n] < 1 / FAR or abs(x) > FAR * sizes[n]
        ]
        if not far or layouts[0].scheme.scheme == "shooting" or not self._reached.clock.left:
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
        meshes = [layout.mesh for layout in layouts]
        located = (
            np.array([n.guess for n in free]),
            [layout.placed(found.solution.w).borders for layout in layouts],
        )
        program = transcribe(built.problem, meshes, layouts[0].scheme, located)
        solver = self._solver(program, replace(self.solver.settings, barrier="near"))
        again = self.solved(built, program, solver, warm_start(list(found.phases.values()), program))
        return replace(again, left=found.left + again.left) if again.success else found

    def solved(self, built: Built, program: Program, solver: Solver, first: np.ndarray) -> Optimum:
        """Where the solver ends from a first guess of the unknowns of a program, maxima and saddles left."""
        return self._lowest(self._ended(built, program, solver, beside_obstacles(program, first)), solver)

    def _lowest(self, found: Optimum, solver: Solver) -> Optimum:
        """A solution, or that to which it leads where the objective falls to a side."""
        for _ in range(MOST_LEFT):
            beside = list(places_aside(found.program, found.solution)) if found.success else []
            better = next(self._better(found, solver, beside), None)
            if better is None:
                if beside:
                    found = replace(found, solution=replace(found.solution, status=NO_MINIMUM))
                break
            found = replace(better, left=found.left + 1)
        self._reached.keep(found)
        return found

    def _better(self, found: Optimum, solver: Solver, places: Iterable[np.ndarray]) -> Iterator[Optimum]:
        """Where the solver ends from these unknowns, if the objective is less there."""
        margin = VANISHED * objective_size(found.program)
        for first in places:
            if self._reached.clock.left:
                better = self._ended(found.built, found.program, solver, first)
                if better.success and better.objective < found.objective - margin:
                    yield better

    def _ended(self, built: Built, program: Program, solver: Solver, first: np.ndarray) -> Optimum:
        """Where the solver ends; what was reached knows it as well."""
        return attempted(built, program, solver, first, self._reached, self.build_time)

    def _values(self, parameters: Mapping[str, Any]) -> dict[str, float]:
        found: dict[str, float] = {}
        held = [n.name for n in self.built.problem.free if n.held]
        for name, value in parameters.items():
            elements = parameter_names(self.built.read, name)
            if any(element not in held for element in elements):
                raise ModelError(
                    f"{name}: was not named in prepare(parameters=[...]), expected one of {held}"
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
    remedy = REMEDIES.get(solution.status, "Try another guess=, more elements=, or look at .optimum.")
    ways = f"\n{optimum.relaxed}" if worth_relaxing(program, solution) else ""
    ends = "".join(f"\n{said}" for said in held_ends(optimum.built))
    raise SolveError(f"{optimum.report()}{ways}{ends}\n{remedy}", optimum=optimum)
