"""`Estimate`: the answer of an estimation, and how it is made from a fit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import SolveError
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.estimation.estimation_problem import Plan
from gantrytau_optimica.estimation.fit_on_mesh import AT_BOUND, MeshFit
from gantrytau_optimica.estimation.parameter_fit import ParameterFit
from gantrytau_optimica.estimation.refined_fit import RefinedFit
from gantrytau_optimica.estimation.report import draw_fit, report_fit
from gantrytau_optimica.estimation.weights import Weighing
from gantrytau_optimica.fitting.rank import LocalJacobian, local_messages, not_told_apart, without_influence


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(ParameterFit):
    """What `estimate` found. `fit.parameters["k"]` is a float in the model's unit; `.deviations`, `.covariance(names)` and
    `.intervals(0.95)` say how sure it is, `.residuals` and `.probability` how well model and data agree.
    """

    def report(self) -> str:
        """Parameters with deviations and intervals, correlations, fit and warnings."""
        return report_fit(self)

    def plot(self, file: Any = None):
        """Measured values and the model over time; returns the figure, and saves it to `file`."""
        return draw_fit(self, file)


def estimated(read: Plan, refined: RefinedFit, weighing: Weighing, optimum: Optimum) -> Estimate:
    """The record of a fit. Raises SolveError where the data do not determine the parameters."""
    fit, error = refined.fit, refined.error
    order = [n.name for n in fit.residuals.program.problem.free]
    parameters = dict(zip(order, fit.numbers.tolist(), strict=True))
    at_bounds = {
        n.name: bound
        for n in read.numbers
        for bound in (n.min, n.max)
        if abs(parameters[n.name] - bound) <= AT_BOUND * n.size
    }
    inner = [k for k, name in enumerate(order) if name not in at_bounds]
    _refuse_lost(read, refined, optimum, inner)
    chosen = [k for n in read.numbers for k in inner if order[k] == n.name]
    names = tuple(order[k] for k in chosen)
    given = np.concatenate([s.deviations for s in fit.residuals.program.problem.sums])
    # of one output without deviations residuals stay in its unit, of several they are divided by the noise of each
    own = 1.0 / given if not weighing.known and weighing.count == 1 else fit.weights.noise
    lost = np.full(len(order), 0.0 if read.static else np.nan)
    shift, finer = (lost, lost) if error is None else (error.shift, error.deviations)
    return Estimate(
        name=read.read.name,
        experiments=read.experiments,
        parameters={n.name: parameters[n.name] for n in read.numbers},
        at_bounds=at_bounds,
        names=names,
        jacobian=fit.jacobian[:, chosen] / own[:, None],
        errors=fit.errors / own,
        scales=given * own,
        weights=fit.weights.huber,
        mesh_shift=dict(zip(names, shift[chosen].tolist(), strict=True)),
        finer_deviations=dict(zip(names, finer[chosen].tolist(), strict=True)),
        known=weighing.known,
        loss=weighing.loss,
        optimum=optimum,
        limited=fit.limited,
        ended=refined.ended,
    )


def _refuse_lost(read: Plan, refined: RefinedFit, optimum: Optimum, inner: list[int]) -> None:
    """SolveError that names the parameters which the data cannot determine or tell apart."""
    if not inner:
        return
    fit, error = refined.fit, refined.error
    program, roots = fit.residuals.program, _even(read, fit)
    names = [program.problem.free[k].name for k in inner]
    point = LocalJacobian((fit.jacobian * roots)[:, inner], fit.numbers[inner])
    finer = None if error is None else LocalJacobian((error.jacobian * roots)[:, inner], point.values)
    sizes = fit.sizes[inner]
    seen = [point] if finer is None else [point, finer]
    silent = sorted(set.intersection(*(set(without_influence(one, sizes)) for one in seen)))
    kept = [k for k in range(len(inner)) if k not in silent]
    words = [not_told_apart([names[k] for k in silent], ())] if silent else []
    if kept:
        words += local_messages(
            [names[k] for k in kept],
            point.of(kept),
            sizes[kept],
            None if finer is None else finer.of(kept),
            lambda: _elsewhere(fit, inner, kept, roots),
        )
    if words:
        remedy = "Leave it out" if len(words) == len(silent) == 1 else "Take one of each as known"
        raise SolveError(
            f"{read.read.name}: {'; '.join(words)}. {remedy}, or add measured variables or experiments in which they "
            "show.",
            optimum=optimum,
        )


def _even(read: Plan, fit: MeshFit) -> np.ndarray:
    """Factors (N, 1) of residuals, by which all outputs count alike: what data tell does not hang on their noise."""
    sums = fit.residuals.program.problem.sums
    measured = np.concatenate([s.values / s.deviations for s in sums])
    sizes = [np.linalg.norm(measured[read.outputs == g]) for g in range(int(np.max(read.outputs)) + 1)]
    whole = max(sizes) or 1.0
    return 1.0 / np.array([size or whole for size in sizes])[read.outputs][:, None]


def _elsewhere(fit: MeshFit, inner: list[int], kept: list[int], roots: np.ndarray) -> LocalJacobian | None:
    """Slopes with respect to the kept of the inner numbers at another point, a tenth away."""
    numbers = fit.numbers.copy()
    numbers[inner] += fit.sizes[inner] * 0.1 * (1 + np.arange(len(inner)) / len(inner))
    moved = fit.residuals.on_manifold(fit.w, numbers)
    if moved is None:
        return None
    values = moved[fit.residuals.program.places.free][inner][kept]
    return LocalJacobian((fit.residuals.jacobian(moved) * roots)[:, inner][:, kept], values)
