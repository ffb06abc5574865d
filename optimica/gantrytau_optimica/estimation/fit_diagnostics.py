"""What is left of the outputs of an estimation, in deviations, as series that any fit is looked at by.

cov p = (J'J)^-1 J' cov(e) J (J'J)^-1        cov(e) of each output and experiment by the spectrum of e, where e is no noise
"""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.estimation.experiments import Experiment
from gantrytau_optimica.fitting.coloured_noise import averaged_spectrum, independent_share, product_covariance
from gantrytau_optimica.fitting.diagnostics import ResidualSeries

FEW = 3  # samples, of which rates are known


def output_series(
    experiments: Sequence[Experiment],
    errors: np.ndarray,
    jacobian: np.ndarray,
    scales: np.ndarray,
    known: bool,
) -> list[ResidualSeries]:
    """Series of the columns of all outputs, from model less measured (N,) in deviations `scales`, with slopes (N, k)."""
    found, begin = [], 0
    for experiment in experiments:
        for name, samples in experiment.measured.items():
            n, columns = samples.values.shape
            for k in range(columns):
                rows = slice(begin, begin + n)
                left, size, begin = -errors[rows], scales[rows], begin + n
                model = samples.values[:, k] / size - left
                signals = {"1": 1 / size, "gain": model}
                if not experiment.static and n >= FEW and np.all(np.diff(samples.times) > 0):
                    signals |= {
                        "time": samples.times / size,
                        "rate": np.gradient(model * size, samples.times) / size,
                    }
                found.append(
                    ResidualSeries(
                        name if columns == 1 else f"{name} (column {k})",
                        left,
                        measured=samples.values[:, k] / size,
                        noise=1.0 if known else None,
                        jacobian=jacobian[rows],
                        signals=signals,
                        groups={"experiment": np.full(n, experiment.name)},
                        run=experiment.name,
                    )
                )
    return found


def coloured_product(series: Sequence[ResidualSeries]) -> np.ndarray:
    """J' cov(e) J, (k, k), each series with its own spectrum; parameters have taken their share of what was there."""
    spectra = [averaged_spectrum(one.left) for one in series]
    pairs = [(one.jacobian, spectrum) for one, spectrum in zip(series, spectra, strict=True)]
    independent = sum(
        independent_share(spectrum) * len(one.left) for one, spectrum in zip(series, spectra, strict=True)
    )
    total = sum(product_covariance(J, spectrum) for J, spectrum in pairs if J is not None)
    k = np.shape(total)[0]
    return np.asarray(total) * independent / max(independent - k, 1.0)
