"""Fitted parameters: their covariance, and the residuals of the data.

cov p = (J'J)^-1 J' cov(e) J (J'J)^-1        cov(e) of each output and experiment by the spectrum of e, if e is coloured
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import number
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.estimation.experiments import Experiment, courses
from gantrytau_optimica.estimation.mesh_error import COARSE
from gantrytau_optimica.failures.failure_report import binding
from gantrytau_optimica.fitting.covariance import averaged_spectrum, independent_share, product_covariance
from gantrytau_optimica.fitting.diagnostics import COMPUTED, Diagnostics, ResidualSeries, diagnose, repeated
from gantrytau_optimica.fitting.linear import inverse_root
from gantrytau_optimica.fitting.robust import robust_deviation

FEW = 3  # samples, of which rates are known
STRONG = 0.99  # correlation from which on two parameters are hardly told apart
COLOURED = ("not white", "trend", "drift", "delay")  # facts of residuals that are no noise
ROBUST = ("outliers", "group", "noise larger", "noise smaller")  # what a robust fit expects
STRAYS = "look at them, leave them out, or take loss='robust'"
ENDS = {
    "time": "raise max_time=",
    "lost": "raise elements=, or give guess= of the motion",
    "chosen": "raise elements=, or leave it out",
    "elements": "raise points=, or split the experiment",
}


@dataclass(frozen=True, eq=False)
class ParameterFit(Record):
    """`fit.parameters["k"]` is a float in the model's unit.

    parameters: estimated values by name; at_bounds: parameters with an active limit, without a standard deviation;
    names: of the other parameters; errors: residuals (N,), model less measured, over `scales`; jacobian: (N, k) of the
    errors by `names`; scales: standard deviations (N,), 1 for one output without, for several by the residuals of each;
    known: whether standard deviations were given; weights: (N,) of a robust fit, else ones; mesh_shift: change of each
    parameter on half as long elements, about; finer_deviations: standard deviations there (NaN: not found); limited:
    whether limits of the model's variables are active; ended: why refinement of the mesh stopped too early ("": it did
    not); optimum: the solved problem, its objective a multiple of the sum of squares.
    """

    name: str
    experiments: tuple[Experiment, ...]
    parameters: dict[str, float]
    at_bounds: dict[str, float]
    names: tuple[str, ...]
    jacobian: np.ndarray
    errors: np.ndarray
    scales: np.ndarray
    weights: np.ndarray
    mesh_shift: dict[str, float]
    finer_deviations: dict[str, float]
    known: bool
    loss: str
    optimum: Optimum
    limited: bool = False
    ended: str = ""

    @property
    def freedom(self) -> int:
        """Measured values less determined parameters."""
        return self.errors.size - len(self.names)

    @property
    def chi_square(self) -> float:
        """Sum of the squares of all residuals, divided by their deviations where these were given."""
        return float(self.errors @ self.errors)

    @property
    def variance(self) -> float:
        """chi_square by degrees of freedom: that of the noise, or about 1 where true deviations were given; else NaN."""
        return self.chi_square / self.freedom if self.freedom > 0 else np.nan

    @property
    def noise(self) -> float:
        """Standard deviation of the residuals by `scales`, of a robust fit by the median of their amounts."""
        if self.loss == "robust":
            return robust_deviation(self.errors)
        return float(np.sqrt(self.variance))

    @property
    def probability(self) -> float:
        """Probability of as large a chi_square by noise of the given standard deviations; NaN without them."""
        from scipy import stats

        return (
            float(stats.chi2.sf(self.chi_square, self.freedom)) if self.known and self.freedom > 0 else np.nan
        )

    @cached_property
    def _covariance(self) -> np.ndarray:
        """Covariance (k, k) of `names`; the discretisation error counts as one more error."""
        root = inverse_root(self.jacobian)
        shift = np.nan_to_num([self.mesh_shift[n] for n in self.names])
        inverse = root @ root.T
        coloured = self.loss == "squares" and any(f.kind in COLOURED for f in self.diagnostics.facts)
        told = inverse @ coloured_product(self._series) @ inverse if coloured else inverse * self._factor
        return told + np.outer(shift, shift)

    @cached_property
    def _series(self) -> list[ResidualSeries]:
        return output_series(self.experiments, self.errors, self.jacobian, self.scales, self.known)

    @cached_property
    def diagnostics(self) -> Diagnostics:
        """Residuals of each output: explained share, size over given standard deviations, whiteness, strays, trends."""
        squares = self.loss == "squares"
        found = diagnose(
            self._series, known=repeated(courses(self.experiments)), remedies={"outliers": STRAYS}
        )
        return replace(found, facts=tuple(f for f in found.facts if squares or f.kind not in ROBUST))

    @property
    def _factor(self) -> float:
        """Factor of (J'J)^-1: variance of the noise, for a robust fit by Huber (1981), section 7.6."""
        if self.loss == "squares":
            return 1.0 if self.known else self.variance
        inside = self.weights == 1.0
        share = float(np.mean(inside))
        correction = 1 + len(self.names) / self.errors.size * (1 - share) / share
        clipped = float(np.sum((self.weights * self.errors) ** 2)) / self.freedom
        return correction**2 * clipped / share**2

    def covariance(self, names: Sequence[str] | None = None) -> np.ndarray:
        """Covariance of parameters (k, k) in their order, default that of `names`. Raises ModelError."""
        if isinstance(names, str):
            raise ModelError(f"covariance: found '{names}', expected a list of names; write ['{names}']")
        rows = [self._place(n) for n in (self.names if names is None else names)]
        return self._covariance[np.ix_(rows, rows)]

    def _place(self, name: str) -> int:
        if name in self.names:
            return self.names.index(name)
        if name in self.at_bounds:
            raise ModelError(
                f"{self.name}: {name} stands at its limit {self.at_bounds[name]:g} and has no deviation; widen the "
                "limit or leave the parameter out"
            )
        raise ModelError(f"{self.name}: {name} was not estimated{did_you_mean(name, self.names)}")

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by name."""
        return dict(zip(self.names, np.sqrt(np.diag(self._covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> np.ndarray:
        """Correlations of `names`, (k, k)."""
        size = np.sqrt(np.diag(self._covariance))
        size = np.where(size > 0, size, 1.0)
        return self._covariance / np.outer(size, size)

    def intervals(self, confidence: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals by name, of Student's t, or the normal distribution where deviations were given.

        They are those of the model linearised at the answer. Raises ModelError.
        """
        from scipy import stats

        confidence = number("intervals", "confidence", confidence, above=0.0, below=1.0)
        wide = stats.norm if self.known and self.loss == "squares" else stats.t(self.freedom)
        half = float(wide.ppf((1 + confidence) / 2))
        return {
            n: (self.parameters[n] - half * d, self.parameters[n] + half * d)
            for n, d in self.deviations.items()
        }

    @cached_property
    def residuals(self) -> dict[tuple[str, str], np.ndarray]:
        """Measured less model by experiment and name, (n,) or (n, k), in the unit of the measured."""
        found, begin = {}, 0
        for experiment in self.experiments:
            for name, samples in experiment.measured.items():
                n, k = samples.values.shape
                mine = -(self.errors * self.scales)[begin : begin + n * k].reshape(k, n).T
                found[experiment.name, name] = mine[:, 0] if k == 1 else mine
                begin += n * k
        return found

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages to read before the parameters are used."""
        found = [
            f"{name} stands at its limit {bound:.6g}: it has no deviation, and those of the others hold it there"
            for name, bound in self.at_bounds.items()
        ]
        correlation = self.correlation
        found += [
            f"{a} and {b} are strongly correlated ({correlation[i, j]:+.4f}): their deviations are large, although a "
            "combination of them is well determined"
            for i, a in enumerate(self.names)
            for j, b in enumerate(self.names[:i])
            if abs(correlation[i, j]) > STRONG
        ]
        found += self._mesh_words()
        found += self._limit_words() if self.limited else []
        return (*found, *(f.message for f in self.diagnostics.findings), *self._computed())

    def _limit_words(self) -> list[str]:
        """Message on the declared limits that bind, from when to when, and how far measured values lie beyond these."""
        found = self.optimum
        words = [
            one for phase in found.phases.values() for one in binding(found.program, found.solution, phase)
        ]
        for experiment, phase in zip(self.experiments, found.phases.values(), strict=True):
            limits = signal_limits(phase.phase, self.name)
            for name, samples in experiment.measured.items():
                for k, values in enumerate(samples.values.T):
                    element = name if samples.values.shape[1] == 1 else f"{name}[{k}]"
                    low, high = limits.get(f"{experiment.name}.model.{element}", (-np.inf, np.inf))
                    beyond = np.maximum(low - values, values - high)
                    worst = int(np.argmax(beyond))
                    if beyond[worst] > 0:
                        words.append(
                            f"measured {element} of {experiment.name} lies beyond by up to {beyond[worst]:.3g}, at t = "
                            f"{samples.times[worst]:.5g} s"
                        )
        return [
            "limits that the model declares for its variables bind and pull the fit; the deviations do not know of them: "
            + "; ".join(words)
        ]

    def _computed(self) -> list[str]:
        """Message for outputs with residuals as small as those of computed data, without standard deviations."""
        explained = {} if self.known or self.freedom <= 0 else self.diagnostics.explained
        names = [n for n, share in explained.items() if 1 - share <= COMPUTED**2]
        words = f"the residuals of {', '.join(names)} are below {COMPUTED:g} of the values, as those of computed data"
        return [f"{words}: the deviations are those of rounding, not of measuring"] if names else []

    def _mesh_words(self) -> list[str]:
        """Message on the discretisation error, if it matters, with the reason for which the mesh was not refined."""
        if not self.names or self.ended == "":
            return []
        ways = ENDS[self.ended]
        moved = {n: abs(self.mesh_shift[n]) / self.finer_deviations[n] for n in self.names}
        if not np.all(np.isfinite(list(moved.values()))):
            return [f"what the mesh costs is not known, as the motion on a finer one was not found; {ways}"]
        worst = max(moved, key=lambda n: moved[n])
        if moved[worst] <= COARSE:
            return [f"the mesh is coarse: it adds to the residuals, although hardly to the numbers; {ways}"]
        return [
            f"the mesh is coarse: on twice the elements {worst} moves by {self.mesh_shift[worst]:.2g}, "
            f"{moved[worst]:.2g} of its deviations there; {ways}"
        ]

    def __repr__(self) -> str:
        deviations: Mapping[str, float] = self.deviations
        words = ", ".join(
            f"{n} = {v:.5g}" + (f" ± {deviations[n]:.2g}" if n in deviations else " (limit)")
            for n, v in self.parameters.items()
        )
        return "\n".join(
            [f"<{type(self).__name__} {self.name}: {words}>", *(f"Note: {one}" for one in self.warnings)]
        )


def output_series(
    experiments: Sequence[Experiment],
    errors: np.ndarray,
    jacobian: np.ndarray,
    scales: np.ndarray,
    known: bool,
) -> list[ResidualSeries]:
    """Series of the columns of all outputs, from model less measured (N,) over `scales`, with Jacobian (N, k)."""
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
    """J' cov(e) J, (k, k), each series with its own spectrum, corrected for fitted degrees of freedom."""
    spectra = [averaged_spectrum(one.left) for one in series]
    pairs = [(one.jacobian, spectrum) for one, spectrum in zip(series, spectra, strict=True)]
    independent = sum(
        independent_share(spectrum) * len(one.left) for one, spectrum in zip(series, spectra, strict=True)
    )
    total = sum(product_covariance(J, spectrum) for J, spectrum in pairs if J is not None)
    k = np.shape(total)[0]
    return np.asarray(total) * independent / max(independent - k, 1.0)
