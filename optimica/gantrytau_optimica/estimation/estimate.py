"""`estimate`: parameters of models from measured data of one or several experiments.

    minimise   sum over all samples of ((model(t_k, p) - value_k) / deviation_k)^2
    over       parameters and initial values p, within their limits, and the motion of every experiment

All experiments form one nonlinear program. From the first guesses steps of Gauss and Newton along the motion are tried
first; where they do not lead to the data, Ipopt finds the motion together with the parameters: it need not be computed
for bad guesses of them (Bock, 1983, Recent advances in parameter identification techniques for ODE).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Unpack

import numpy as np

from gantrytau import Model, ModelError, SolveError
from gantrytau.border.checks import check_words, instance
from gantrytau.border.refusal import Given
from gantrytau.language.symbols import split_derivative
from gantrytau.progress import shows_progress
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.estimation.corners import with_corners
from gantrytau_optimica.estimation.estimation import Estimate, estimated
from gantrytau_optimica.estimation.estimation_problem import Plan, plan, sample_times
from gantrytau_optimica.estimation.experiments import Experiment, expected_noise, named
from gantrytau_optimica.estimation.fit_on_mesh import MeshFit, descended, fit_on_mesh, solution_at
from gantrytau_optimica.estimation.refined_fit import (
    RefinedFit,
    TimeOver,
    fit_on,
    refined_fit,
    weighted,
)
from gantrytau_optimica.estimation.residuals import Residuals, check_determined, residuals
from gantrytau_optimica.estimation.weights import Weighing, Weights
from gantrytau_optimica.policy import MeshKeywords, Policy, policy_of
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.refinement.attempts import LEAST_TIME
from gantrytau_optimica.refinement.incumbent import INTERRUPTED, LATE, BestSoFar
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.ipopt import WORDS, Solver, SolverSettings
from gantrytau_optimica.transcription.mesh import Mesh, mesh_of, with_jumps
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.scheme import radau
from gantrytau_optimica.transcription.transcribe import transcribe, transcribed_again

SOLVED = WORDS["Solve_Succeeded"]
MOST_STEPS, SHARE = 30, 0.8  # steps from the first guesses, and the part of the time that they leave
EXPLAINED = 0.3  # of the spread of each measured course: what a fit from the first guesses may leave
MOST_CORNERS = 2000  # where a mesh that misses some does not lead to the data
AT_FIRST = 50  # elements or a few more, on which a first answer is looked for from far away


@shows_progress
def estimate(
    model: Model | type[Model],
    parameters: Mapping[str, Any],
    experiments: Experiment | Sequence[Experiment],
    *,
    loss: Literal["squares", "robust"] = "squares",
    **policy: Unpack[MeshKeywords],
) -> Estimate:
    """Estimate parameters of a model, and initial values, from experiments.

    parameters: name in the model -> Free(guess, min=..., max=...) or a guess, the same in all experiments; limits
    default to those that the model declares. loss: "robust" bounds the influence of stray values (Huber's). elements of
    every experiment: those given, and what they cost is told; by default they are cut where they matter until the
    estimate stands. points, scheme (any but "shooting"), tolerance, max_iterations, max_time and progress: as for
    `optimize`. Without deviations of the data every measured name has a noise of its own, which the fit leaves. Raises
    ModelError for what is written wrongly and for data that are fewer than the parameters, SolveError with `.optimum`
    where no solution is found, where Ctrl-C is pressed, or where the data cannot tell parameters apart; its message
    names them.
    """
    begin = time.perf_counter()
    check_words(estimate, locals())
    asked = policy_of("estimate", MeshKeywords, policy)
    if not asked.transcription.refinable:
        found = Given("scheme", asked.scheme)
        raise ModelError("expected 'radau', 'gauss' or 'lobatto'", place="estimate", found=found)
    instance("estimate", "parameters", parameters, Mapping, "{name: Free(guess)}")
    trials = named(experiments)
    known = next(iter(trials[0].measured.values())).weighted
    read = plan(model, parameters, trials, {} if known else expected_noise(trials))
    _check_amount(read, known)
    reached = BestSoFar(Clock(asked.max_time - (time.perf_counter() - begin), asked.progress), read.read.name)
    built = _built(read)
    spent = time.perf_counter() - begin
    work = _Work(read, built, known, loss, asked, "elements" in policy, reached, spent)
    with reached.kept():
        optimum = work.first()
        reached.keep(optimum)
        try:
            return work.finished(optimum)
        except (KeyboardInterrupt, TimeOver) as end:
            reached.keep(work.optimum(optimum))
            if isinstance(end, KeyboardInterrupt):
                raise
            raise reached.stopped(LATE) from None


def _check_amount(read: Plan, known: bool) -> None:
    """ModelError for nothing to estimate, or for less data than it takes."""
    count, size = len(read.numbers), sum(e.size for e in read.experiments)
    if not count:
        raise ModelError(
            f"{read.read.name}: nothing to estimate, expected {{name: Free(guess)}} in parameters or in start"
        )
    if size < count or (size == count and not known):
        names = ", ".join(n.name for n in read.numbers)
        remedy = "measure more" if size < count else "measure more, or give Samples(..., deviation=...)"
        raise ModelError(
            f"{read.read.name}: {size} measured values for {count} numbers ({names}), expected "
            f"{'at least as many' if size < count else 'more, to tell the noise'}; {remedy}, or estimate less"
        )


def _built(read: Plan) -> Built:
    """The control problem, with sizes of the numbers and the measured courses as first guesses."""
    built = build(read.read, _guesses(read))
    sizes = {n.name: n.size for n in read.numbers}
    free = tuple(replace(n, nominal=sizes.get(n.name)) for n in built.problem.free)
    return replace(built, problem=replace(built.problem, free=free))


def _guesses(read: Plan) -> dict[str, Any]:
    """Measured variables along their samples, and their derivatives; what the caller says goes first."""
    found: dict[str, Any] = {}
    for experiment in read.experiments:
        path = f"{experiment.name}.model."
        for name, samples in experiment.measured.items():
            base, order = split_derivative(name)
            whole = f"{'der(' * order}{path}{base}{')' * order}"
            found[whole] = _course(samples.times, samples.values)
            if not read.static and samples.times.size > 2:
                found[f"der({whole})"] = _course(
                    samples.times, np.gradient(samples.values, samples.times, axis=0)
                )
        found |= {f"{path}{n}": value for n, value in experiment.guess.items()}
    return found


def _course(times: np.ndarray, values: np.ndarray):
    """Straight lines between samples, as a function of one time."""
    return lambda t: np.array([np.interp(t, times, column) for column in values.T])


def _without_start(read: Plan) -> dict[str, list[str]]:
    """States whose initial value the model does not fix, by experiment."""
    dae = read.read.dae
    fixed = {e for v in dae.flat.variables if v.fixed for e in v.elements}
    found: dict[str, list[str]] = {e.name: [] for e in read.experiments}
    for state in dae.states:
        experiment, name = split_derivative(state)[0].split(".model.", 1)
        if split_derivative(state)[0] not in fixed:
            found[experiment].append(name)
    return found


@dataclass(frozen=True, eq=False)
class _Work:
    """One call of `estimate`: what was read, how it is to be solved, and what was solved last."""

    read: Plan
    built: Built
    known: bool
    loss: Literal["squares", "robust"]
    asked: Policy
    chosen: bool  # whether the caller chose the elements
    reached: BestSoFar
    build_time: float  # s
    solved: list[MeshFit] = field(default_factory=list)

    @property
    def settings(self) -> SolverSettings:
        """Those of Ipopt, with the time that is left."""
        return replace(self.asked.solver, max_time=max(self.reached.clock.left, LEAST_TIME))

    def first(self) -> Optimum:
        """The answer on the mesh to begin with, from the first guesses. Raises SolveError, ModelError."""
        program = self._program(self._meshes())
        check_determined(residuals(program), _without_start(self.read))
        from_guess = self._from_the_guess(program)
        if from_guess is not None and self._explains(from_guess):
            return from_guess
        try:
            solver = Solver(program, self.settings)
            prepared = Prepared(self.built, program, solver, {}, self.build_time, reached=self.reached)
            found = [prepared.search()]
        except SolveError:
            if from_guess is None or not self.reached.clock.left:
                raise
            found = []
        found += [from_guess] if from_guess is not None else []
        if not self.read.static and not any(self._explains(one) for one in found):
            # a mesh that misses most corners of the inputs may lead far from the best fit
            whole = self._with_borders(self.asked.mesh, MOST_CORNERS)
            if sum(m.elements for m in whole) > program.places.layouts[0].mesh.elements:
                again = self._from_the_guess(self._program(whole))
                found += [again] if again is not None else []
        return min(found, key=lambda one: one.objective)

    def _program(self, meshes: Sequence[Mesh]) -> Program:
        scheme = radau(1) if self.read.static else self.asked.transcription
        return transcribe(self.built.problem, meshes, scheme)

    def _from_the_guess(self, program: Program) -> Optimum | None:
        """The best fit by steps from the motion with the first guesses; None if they lead nowhere.

        Much quicker than Ipopt from afar, but its motion must exist for all numbers on the way.
        """
        found, steps = residuals(program), iter(range(min(MOST_STEPS, self.asked.max_iterations)))
        end = SHARE * self.reached.clock.left

        def step(cost: float) -> None:
            if next(steps, None) is None or self.reached.clock.left < end:
                raise TimeOver
            self._step(cost)

        try:
            w = descended(found, first_guess(program), Weights.even(found.total), step)
        except TimeOver:
            return None
        except KeyboardInterrupt:
            self.reached.keep(self._optimum(program, first_guess(program), INTERRUPTED))
            raise
        return None if w is None else self._optimum(program, w, SOLVED)

    def _explains(self, optimum: Optimum) -> bool:
        """Whether a fit leaves little of how the values spread, so that it is not a minimum far from the best one."""
        found, sums = residuals(optimum.program), optimum.program.problem.sums
        left = np.split(found.values(optimum.solution.w), np.cumsum([s.times.size for s in sums])[:-1])
        sizes = [
            (s.values - s.values.mean()) / s.deviations if np.ptp(s.values) else s.values / s.deviations
            for s in sums
        ]
        return all(
            np.linalg.norm(a) <= EXPLAINED * np.linalg.norm(b) for a, b in zip(left, sizes, strict=True)
        )

    def _optimum(self, program: Program, w: np.ndarray, status: str) -> Optimum:
        """Unknowns that Ipopt has not seen; solved ones with their multipliers."""
        solution = Solver(program, self.settings).unsolved(program, w)
        if status == SOLVED:
            solution = replace(solution_at(program, w, solution), success=True)
        solution = replace(solution, status=status)
        return Optimum(self.read.read.name, self.built, program, solution, self.build_time)

    def _step(self, cost: float) -> None:
        clock = self.reached.clock
        if not clock.left:
            raise TimeOver
        clock.tell(clock.last[0] + 1, cost)

    def _meshes(self) -> list[Mesh]:
        """Elements: borders where inputs jump or bend, and for static models one at every sample."""
        if self.read.static:
            steps = [np.diff(sample_times(e)) for e in self.read.experiments]
            return [mesh_of([one[0] if one.size else 1.0, *one]) for one in steps]
        begun = self.asked.mesh
        thinned = np.arange(0, begun.elements, max(1, begun.elements // AT_FIRST))
        begun = Mesh(np.append(begun.borders[thinned], 1.0))
        return self._with_borders(begun)

    def _with_borders(self, mesh: Mesh, most: int | None = None) -> list[Mesh]:
        """The mesh of every phase with borders where inputs jump, and at their corners if these are few."""
        problem, most = self.built.problem, mesh.elements if most is None else most
        return [with_corners(with_jumps(mesh, phase), problem, phase, most) for phase in problem.phases]

    def solve(self, found: Residuals, w: np.ndarray, weights: Weights) -> np.ndarray | None:
        """Unknowns by Ipopt from unknowns near them; None where it finds none. Raises TimeOver."""
        program = _weighted(found.program, weights)
        solver = Solver(program, replace(self.settings, barrier="near"))
        solution = solver.solve(program, w, self.reached.clock)
        if not self.reached.clock.left:
            raise TimeOver
        return solution.w if solution.success else None

    def finished(self, optimum: Optimum) -> Estimate:
        """The estimate, from the answer on the first mesh. Raises SolveError where data do not tell parameters apart."""
        found = residuals(optimum.program)
        weighing = Weighing(self.read.outputs, self.known, self.loss)
        fit = fit_on_mesh(found, optimum.solution.w, weighing, weighing.first(), self.solve, self._step)
        if fit is None:
            raise SolveError(f"{optimum.report()}\nThe fit did not settle.", optimum=optimum)
        self.solved.append(fit)
        if self.read.static:
            return estimated(self.read, RefinedFit(fit, None, ""), weighing, self.optimum(optimum))
        whole = self._with_borders(self.asked.mesh)
        if len(whole[0].borders) > len(fit.residuals.program.places.layouts[0].mesh.borders):
            fit = fit_on(whole, fit, None, weighing, self.solve, self._step) or fit
            self.solved.append(fit)
        refined = refined_fit(fit, weighing, self.solve, self._step, not self.chosen, self.solved.append)
        return estimated(self.read, refined, weighing, self.optimum(optimum))

    def optimum(self, first: Optimum) -> Optimum:
        """What was solved last as an optimum; first: the answer on the first mesh."""
        if not self.solved:
            return first
        fit = self.solved[-1]
        program = fit.residuals.program
        if np.any(fit.weights.roots != 1.0):
            program = _weighted(program, fit.weights)
        return replace(first, program=program, solution=solution_at(program, fit.w, first.solution))


def _weighted(program: Program, weights: Weights) -> Program:
    return transcribed_again(program, weighted(program.problem, weights.roots))
