"""`starts=`: several first guesses around the default one, and the branches of solutions they lead to.

The default guess is solved as without a search, so that the answer is never worse. The others are solved on a coarse mesh
to a loose tolerance, which takes a fraction of the time and leads to the same branches. The best of these are then solved
on the whole mesh, each from its own solution, played back, and ranked by what holds.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from gantrytau.ensembles.parallel_map import each
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.control.first_guesses.guesses import with_algebraics
from gantrytau_optimica.control.input_rates import with_ramped_rates
from gantrytau_optimica.refinement.attempts import Attempts
from gantrytau_optimica.refinement.branches import SAME, Search, SolutionBranch, joined, ranked
from gantrytau_optimica.refinement.guess_family import bends
from gantrytau_optimica.refinement.incumbent import LATE, BestSoFar
from gantrytau_optimica.refinement.refinement import without_ramps
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.transcribe import transcribed_again

COARSE = 12  # elements, at least, of the mesh on which first guesses are tried
LOOSE = 1e-4  # tolerance there
MOST_TRIED = 150  # iterations there: GT-A takes 44 to 139
MOST_ON_WHOLE = 300  # the same where the mesh of the caller is that of the search
MOST_BRANCHES = 3  # the best ones, which are solved on the whole mesh


class Searching:
    """One search: what it has found so far."""

    def __init__(self, whole: Attempts, ramps_added: bool, starts: int):
        """whole: solves the program of the caller from a solution nearby; ramps_added: whether its inputs are ramps because
        it is to be refined.
        """
        self.whole, self.starts = whole, starts
        self.built, self.program, self.reached = whole.built, whole.program, whole.reached
        settings = whole.settings[-1]
        coarse = coarse_program(self.program, self.built, ramps_added)
        if coarse is None:
            most = min(settings.max_iterations, MOST_ON_WHOLE)
            tried = replace(settings, max_iterations=most)
            self.attempts = Attempts(self.built, self.program, [tried], self.reached, whole.build_time)
        else:
            most = min(settings.max_iterations, MOST_TRIED)
            loose = max(settings.tolerance, LOOSE)
            tried = replace(settings, max_iterations=most, tolerance=loose)
            built = replace(self.built, problem=coarse.problem)
            self.attempts = Attempts(built, coarse, [tried], self.reached, whole.build_time)
        self.coarse = coarse is not None
        self.branches: list[SolutionBranch] = []
        self.tried = self.failures = 0

    def note(self, optimum: Optimum, whole: bool) -> None:
        """Take note of where a first guess led to."""
        self.tried += 1
        if optimum.success:
            self.branches = [*self.branches, SolutionBranch(optimum.objective, 1, optimum, whole)]
        else:
            self.failures += 1

    def guesses(self) -> Iterator[np.ndarray]:
        """First unknowns of all guesses but the default one, for as long as there is time."""
        for problem in bends(self.built.problem, self.starts - 1):
            if not self.reached.clock.left:
                return
            bent = with_algebraics(self.built, problem)
            yield first_guess(self.attempts.program.with_numbers(bent))

    def from_guesses(self) -> None:
        """Solve from all other guesses."""
        clock, ended = self.reached.clock, dict[int, Optimum]()
        clock.enter(f"first guess 2 of {self.starts}")
        # made now: what guesses take by themselves says whether processes are worth it
        self.attempts.solver(0)
        try:
            for k, found in each(self.attempts, self.guesses(), self.starts - 1):
                ended[k] = self.attempts.optimum(found)
                if not clock.left:
                    break
                if len(ended) < self.starts - 1:
                    clock.enter(f"first guess {len(ended) + 2} of {self.starts}")
        finally:  # by Ctrl-C and the end of time as well
            for k in sorted(ended):
                self.note(ended[k], not self.coarse)

    def on_whole_mesh(self) -> None:
        """Solve the best branches that are known on the coarse mesh only on the whole one."""
        self.branches = joined(self.branches)
        waiting = [b for b in self.branches if not b.whole][:MOST_BRANCHES]
        clock = self.reached.clock
        if not waiting or not clock.left:
            return
        clock.enter(f"branch 1 of {len(waiting)}, on the whole mesh")
        firsts = [warm_start(list(b.optimum.phases.values()), self.program) for b in waiting]
        done = 0
        for k, found in each(self.whole, firsts, len(firsts)):
            optimum, done = self.whole.optimum(found), done + 1
            if optimum.success:
                place = next(i for i, b in enumerate(self.branches) if b is waiting[k])
                self.branches[place] = SolutionBranch(optimum.objective, waiting[k].count, optimum)
            if not clock.left:
                break
            if done < len(waiting):
                clock.enter(f"branch {done + 1} of {len(waiting)}, on the whole mesh")
        self.branches = joined(self.branches)


def searched(
    default: Callable[[], Optimum], whole: Attempts, starts: int, ramps_added: bool
) -> tuple[Optimum, Search | None]:
    """The best optimum from `starts` first guesses, and all branches; if there is none, where the default guess ended.

    default: solves from the default guess on the whole mesh. The guesses are always the same; where a solve takes its time
    they are solved on all processors, with the same answers.
    """
    reached = whole.reached
    reached.clock.enter(f"first guess 1 of {starts}")
    alone = default()
    search = Searching(whole, ramps_added, starts)
    search.note(alone, whole=True)
    try:
        if reached.clock.left:
            search.from_guesses()
        _keep(reached, search, "")
        search.on_whole_mesh()
    except KeyboardInterrupt:
        _keep(reached, search, reached.reason)
        raise
    stopped = "" if search.tried == starts and reached.clock.left else LATE
    if not search.branches:
        return alone, None
    found = Search(search.tried, ranked(search.branches), search.failures, stopped)
    best = found.branches[0]
    if not best.whole:
        _keep(reached, search, stopped)
        return alone, found
    return best.optimum, found


def best_refined(optimum: Optimum, refine: Callable[[Optimum], Optimum], reached: BestSoFar) -> Optimum:
    """The best branch refined; where another one promises more than it then has, or it does not hold, that one as well."""
    best = refine(optimum)
    branches = optimum.search.branches if optimum.search is not None else ()
    for branch in branches[1:MOST_BRANCHES]:
        held = best.refinement is not None and best.refinement.reached
        better = branch.objective < best.objective - SAME * abs(best.objective)
        if not reached.clock.left or not (branch.whole and branch.holds) or (held and not better):
            break
        try:
            other = refine(branch.optimum.with_notes(search=optimum.search))
        except KeyboardInterrupt:
            reached.best = best
            raise
        reached_it = other.refinement is not None and other.refinement.reached
        if (not reached_it, other.objective) < (not held, best.objective):
            best = other
    reached.best = best
    return best


def _keep(reached: BestSoFar, search: Searching, stopped: str) -> None:
    """What was reached knows of the branches found until now, which are not played back yet."""
    if reached.best is not None and search.branches:
        ordered = sorted(joined(search.branches), key=lambda b: b.objective)
        notes = Search(search.tried, tuple(ordered), search.failures, stopped)
        reached.best = reached.best.with_notes(search=notes)


def coarse_program(program: Program, built: Built, ramps_added: bool) -> Program | None:
    """The program on fewer elements, with inputs that are free in them, which find their branch more often than ramps; None
    where the caller chose the pieces of inputs, or the mesh is coarse already.
    """
    layouts = program.places.layouts
    problem: ControlProblem = (
        with_ramped_rates(without_ramps(built.problem)) if ramps_added else built.problem
    )
    pieces = {u.pieces.kind for phase in problem.phases for u in phase.inputs}
    own = any(layout.mesh.moving for layout in layouts) or pieces & {"constant", "linear"}
    if own or not program.scheme.refinable:
        return None
    steps = [max(layout.mesh.elements // COARSE, 1) for layout in layouts]
    if max(steps) == 1 and not ramps_added:
        return None
    meshes = [
        Mesh(np.unique(np.append(layout.mesh.borders[::step], 1.0)))
        for layout, step in zip(layouts, steps, strict=True)
    ]
    return transcribed_again(program, problem, meshes)
