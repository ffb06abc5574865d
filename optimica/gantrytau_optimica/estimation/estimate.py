"""`estimate`: parameters of models from measured data of one or several experiments.

    minimise   sum over all samples of ((model(t_k, p) - value_k) / deviation_k)^2
    over       parameters and initial values p, within their limits, and the motion of every experiment

All experiments form one nonlinear program, so that the motion is found together with the parameters: it need not be
computed for bad guesses of them (Bock, 1983, Recent advances in parameter identification techniques for ODE).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Unpack

import numpy as np

from gantrytau import Model, ModelError, SolveError
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, Phase
from gantrytau_optimica.estimation.collinear_parameters import (
    LocalSlopes,
    indistinguishable,
    without_influence,
)
from gantrytau_optimica.estimation.estimation import Estimate
from gantrytau_optimica.estimation.estimation_problem import Plan, plan, sample_times
from gantrytau_optimica.estimation.experiments import Experiment, named
from gantrytau_optimica.estimation.mesh_shift import mesh_shift
from gantrytau_optimica.estimation.residuals import Residuals, check_determined, residuals
from gantrytau_optimica.estimation.robust_weights import huber_weights, median_deviation
from gantrytau_optimica.policy import MeshKeywords, Policy, policy_of
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.solving.ipopt import Solver, SolverSettings
from gantrytau_optimica.transcription.mesh import Mesh, mesh_of, with_jumps
from gantrytau_optimica.transcription.scheme import Collocation, collocation
from gantrytau_optimica.transcription.transcribe import transcribe

EXPECTED_NOISE = (
    0.01  # of the spread of the data, where no deviations were given: for the solver's scaling only
)
AT_BOUND = 1e-6  # of its size, closer than this a parameter stands at a limit
ROUNDS, SETTLED = 30, 1e-6  # of reweighing, and the relative change of the weights at which it ends


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
    default to those that the model declares. loss: "robust" bounds the influence of stray values (Huber's). elements,
    points and scheme ("radau" or "gauss"), of every experiment, tolerance, max_iterations, max_time and progress: as for
    `optimize`. Raises ModelError for what is written wrongly and for data that are fewer than the parameters, SolveError
    with `.optimum` where no solution is found, or where the data cannot tell parameters apart; its message names them.
    """
    begin = time.perf_counter()
    asked = policy_of("estimate", MeshKeywords, policy)
    _check(parameters, loss, asked)
    trials = named(experiments)
    known = next(iter(trials[0].measured.values())).weighted
    read = plan(model, parameters, trials, 1.0 if known else _factor(trials))
    _check_amount(read, known)
    built = _built(read)
    grid = collocation("radau", 1) if read.static else asked.collocation
    meshes = [_mesh(read, k, phase, asked.mesh) for k, phase in enumerate(built.problem.phases)]
    program = transcribe(built.problem, meshes, grid)
    found = residuals(program)
    check_determined(found, _without_start(read))
    optimum = Prepared(built, program, Solver(program, asked.solver), {}, time.perf_counter() - begin).solve()
    weights = np.ones(sum(found.sizes))
    if loss == "robust":
        optimum, weights = _robust(optimum, found, asked.solver, grid, meshes, known)
    return _answer(read, found, optimum, weights, known, loss)


def _check(parameters: Any, loss: Any, policy: Policy) -> None:
    if policy.shooting:
        raise ModelError("estimate: found scheme='shooting', expected 'radau' or 'gauss'", argument="scheme")
    if not isinstance(parameters, Mapping):
        raise ModelError(f"estimate: found parameters={parameters!r}, expected {{name: Free(guess)}}")
    if loss not in ("squares", "robust"):
        raise ModelError(f"estimate: found loss={loss!r}, expected 'squares' or 'robust'")


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


def _factor(experiments: Sequence[Experiment]) -> float:
    """Of the sum of squares, so that it is of the order of the number of samples at the answer."""
    values = [s.values - s.values.mean(axis=0) for e in experiments for s in e.measured.values()]
    spread = np.sqrt(np.mean(np.concatenate([v.ravel() for v in values]) ** 2))
    return float((EXPECTED_NOISE * (spread or 1.0)) ** -2)


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


def _mesh(read: Plan, number: int, phase: Phase, mesh: Mesh) -> Mesh:
    """Elements of one experiment: borders where inputs jump, and for static models one at every sample."""
    if read.static:
        steps = np.diff(sample_times(read.experiments[number]))
        return mesh_of([steps[0] if steps.size else 1.0, *steps])
    return with_jumps(mesh, phase)


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


def _robust(
    optimum: Optimum,
    found: Residuals,
    settings: SolverSettings,
    grid: Collocation,
    meshes: Sequence[Mesh],
    known: bool,
) -> tuple[Optimum, np.ndarray]:
    """Least squares again with stray values weighted down, until the weights settle."""
    weights = np.ones(sum(found.sizes))
    for _ in range(ROUNDS):
        errors = found.values(optimum.solution.w)
        size = 1.0 if known else float(median_deviation(errors)) or 1.0
        before, weights = weights, huber_weights(errors, size)
        if np.max(np.abs(weights - before)) < SETTLED:
            break
        problem = _weighted(found.program.problem, weights)
        program = transcribe(problem, meshes, grid)
        solution = Solver(program, settings).solve(program, optimum.solution.w)
        optimum = replace(optimum, program=program, solution=solution)
        if not solution.success:
            raise SolveError(f"{optimum.report()}\nThe robust fit did not settle.", optimum=optimum)
    return optimum, weights


def _weighted(problem: ControlProblem, weights: np.ndarray) -> ControlProblem:
    """The problem with the deviations of its samples widened by 1 / sqrt(weight)."""
    phases, begin = [], 0
    for phase in problem.phases:
        sums = []
        for one in phase.sums:
            mine = weights[begin : begin + one.times.size]
            sums.append(replace(one, deviations=one.deviations / np.sqrt(mine)))
            begin += one.times.size
        phases.append(replace(phase, sums=tuple(sums)))
    return replace(problem, phases=tuple(phases))


def _answer(
    read: Plan, found: Residuals, optimum: Optimum, weights: np.ndarray, known: bool, loss: str
) -> Estimate:
    """The record, once it is clear that the data determine the parameters."""
    w = optimum.solution.w
    parameters = optimum.numbers
    order = list(parameters)
    at_bounds = {}
    for number in read.numbers:
        for bound in (number.min, number.max):
            if abs(parameters[number.name] - bound) <= AT_BOUND * number.size:
                at_bounds[number.name] = bound
    inner = [k for k, name in enumerate(order) if name not in at_bounds]
    slopes = found.jacobian(w)[:, inner]
    scales = np.concatenate([s.deviations for s in found.program.problem.sums])
    measured = np.concatenate([s.values for s in found.program.problem.sums])
    _refuse_lost(read, found, optimum, inner, slopes, float(np.linalg.norm(measured / scales)))
    shown = {n.name: parameters[n.name] for n in read.numbers}
    chosen = [k for n in read.numbers for k in inner if order[k] == n.name]
    names, slopes = tuple(order[k] for k in chosen), slopes[:, [inner.index(k) for k in chosen]]
    errors = found.values(w)
    shift = np.zeros(len(names))
    if inner and not read.static:
        shift = mesh_shift(optimum, found.program.problem, slopes, errors)
    return Estimate(
        read.read.name, read.experiments, shown, at_bounds, names, slopes, errors, scales, weights,
        dict(zip(names, shift.tolist(), strict=True)), known, loss, optimum,
    )  # fmt: skip


def _refuse_lost(
    read: Plan, found: Residuals, optimum: Optimum, inner: list[int], slopes: np.ndarray, measured: float
) -> None:
    """SolveError that names the parameters which the data cannot determine or tell apart."""
    w, free = optimum.solution.w, found.program.places.free
    size = {n.name: n.size for n in read.numbers}
    names = [found.program.problem.free[k].name for k in inner]
    values = w[free][inner]
    sizes = np.array([max(abs(v), 1e-3 * size[n]) for n, v in zip(names, values, strict=True)])
    point = LocalSlopes(slopes, values)
    if not inner:
        return
    silent = without_influence(point, sizes, measured)
    kept = [k for k in range(len(inner)) if k not in silent]

    def elsewhere() -> LocalSlopes | None:
        numbers = w[free].copy()
        numbers[inner] += sizes * 0.1 * (1 + np.arange(len(inner)) / len(inner))
        moved = found.on_manifold(w, numbers)
        if moved is None:
            return None
        return LocalSlopes(found.jacobian(moved)[:, inner][:, kept], moved[free][inner][kept])

    words = [f"{names[k]} has no influence on what was measured" for k in silent]
    if kept:
        words += indistinguishable(
            [names[k] for k in kept], LocalSlopes(slopes[:, kept], values[kept]), sizes[kept], elsewhere
        )
    if words:
        remedy = "Leave it out" if len(words) == len(silent) == 1 else "Take one of each as known"
        raise SolveError(
            f"{read.read.name}: {'; '.join(words)}. {remedy}, or add measured variables or experiments in which they "
            "show.",
            optimum=optimum,
        )
