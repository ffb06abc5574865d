"""An estimate as text and as a figure."""

from typing import Any

import numpy as np

from gantrytau.results.figures import finished
from gantrytau_optimica.estimation.parameter_fit import ParameterFit


def report_fit(fit: ParameterFit) -> str:
    """Parameters with deviations and 95 % intervals, correlations, residuals and warnings."""
    deviations = fit.deviations
    intervals = fit.intervals(0.95)
    width = max(len(n) for n in (*fit.parameters, "parameter"))
    count = len(fit.experiments)
    lines = [
        f"{fit.name}: {len(fit.parameters)} numbers from {fit.errors.size} values of {count} "
        f"experiment{'s' if count > 1 else ''}, {'robust' if fit.loss == 'robust' else 'least squares'}",
        f"{'parameter':{width}s} {'value':>13s} {'deviation':>11s}  95 % interval",
    ]
    for name, value in fit.parameters.items():
        if name in deviations:
            low, high = intervals[name]
            lines.append(f"{name:{width}s} {value:13.7g} {deviations[name]:11.3g}  {low:.6g} to {high:.6g}")
        else:
            lines.append(f"{name:{width}s} {value:13.7g} {'':>11s}  at its limit")
    lines.append(_fit_words(fit))
    for (experiment, name), left in fit.residuals.items():
        root = np.sqrt(np.mean(np.square(left), axis=0))
        lines.append(
            f"  {experiment}, {name}: rms residual {', '.join(f'{r:.4g}' for r in np.atleast_1d(root))}"
        )
    lines += _correlations(fit)
    lines += [f"Note: {words}" for words in fit.warnings]
    return "\n".join(lines)


def _fit_words(fit: ParameterFit) -> str:
    if fit.loss == "robust":
        return (
            f"{int(np.sum(fit.weights < 1))} values count less than others, the least {np.min(fit.weights):.2g}; deviation "
            f"of the noise by the median: {fit.noise:.4g}"
        )
    if fit.known:
        return (
            f"chi-square {fit.chi_square:.6g} for {fit.freedom} degrees of freedom (probability {fit.probability:.3g}); "
            "deviations of the data as given"
        )
    return (
        f"sum of squares {fit.chi_square:.6g}; deviation of the noise, estimated from {fit.freedom} degrees of freedom: "
        f"{fit.noise:.4g}"
    )


def _correlations(fit: ParameterFit) -> list[str]:
    """The largest correlations, by amount."""
    matrix = fit.correlation
    pairs = [(matrix[i, j], fit.names[j], fit.names[i]) for i in range(len(fit.names)) for j in range(i)]
    pairs.sort(key=lambda pair: -abs(pair[0]))
    if not pairs:
        return []
    return ["correlations: " + ", ".join(f"{a}, {b} {c:+.3f}" for c, a, b in pairs[:8])]


def draw_fit(fit: ParameterFit, file: Any):
    """One axis for every measured name (rows) and experiment (columns): dots measured, lines the model."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(name for e in fit.experiments for name in e.measured))
    size = (4.5 * len(fit.experiments) + 1.5, 2.2 * len(names) + 0.8)
    figure, axes = plt.subplots(
        len(names), len(fit.experiments), squeeze=False, figsize=size, layout="constrained"
    )
    for column, experiment in enumerate(fit.experiments):
        axes[0, column].set_title(experiment.name)
        axes[-1, column].set_xlabel("row" if experiment.static else "time [s]")
        for row, name in enumerate(names):
            axes[row, 0].set_ylabel(_label(fit, name))
            if name in experiment.measured:
                _one(fit, axes[row, column], column, name)
    figure.suptitle(f"{fit.name}: measured (dots) and model")
    return finished(figure, file)


def _label(fit: ParameterFit, name: str) -> str:
    full = f"{fit.experiments[0].name}.model.{name}"
    quantity = next((v for v in fit.optimum.dae.flat.variables if full in (v.name, *v.elements)), None)
    return f"{name} [{quantity.unit}]" if quantity is not None and quantity.unit else name


def _one(fit: ParameterFit, axis: Any, number: int, name: str) -> None:
    """The samples of one name and the course of the model."""
    experiment = fit.experiments[number]
    samples = experiment.measured[name]
    phase = list(fit.optimum.phases.values())[number]
    left = fit.residuals[experiment.name, name].reshape(samples.values.shape)
    course = samples.times, samples.values - left
    if not experiment.static and phase.layout.tracks:
        times = np.linspace(*experiment.horizon, 400)
        value = np.asarray(fit.optimum.signal(f"{experiment.name}.model.{name}")(times))
        course = times, value.reshape(times.size, -1)
    for k in range(samples.values.shape[1]):
        axis.plot(samples.times, samples.values[:, k], ".", color=f"C{k}", markersize=4)
        axis.plot(course[0], course[1][:, k], "-", color=f"C{k}", linewidth=1)
    axis.grid(alpha=0.3)
