"""Outputs of any size, number and noise: their weights, what is given twice, and how often intervals hold the truth."""

import numpy as np
import pytest
from scipy import stats

from gantrytau import Input, Model, Parameter, Real, der
from gantrytau_optimica import Free, Samples
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.experiments import Experiment
from tests.families import NIGHTLY
from tests.optimica.estimation.estimation_data import Decay

ROWS = np.linspace(1.0, 2.0, 20)
TIMES = np.linspace(0.0, 3.0, 13)
SEEDS = 25 if NIGHTLY else 12


class Gauges(Model):
    """Two readings of one input, of sizes 1 and 1e-6."""

    c = Parameter(1.0)
    g = Parameter(1.0)
    u = Input()
    a = Real()
    b = Real()

    def equations(self):
        yield self.a == self.c * self.u
        yield self.b == self.g * self.u


class Shared(Gauges):
    """Both tell the same number."""

    def equations(self):
        yield self.a == self.c * self.u
        yield self.b == 1e-6 * self.c * self.u


def noise(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 1.0, count)


@pytest.mark.parametrize("guess", [1e-5, 1.0])
def test_outputs_of_sizes_one_and_a_millionth(guess):
    """Each as if it were alone: least squares through the origin."""
    a, b = 0.7 * ROWS + 1e-2 * noise(20, 1), 2e-6 * ROWS + 1e-8 * noise(20, 2)
    experiment = Experiment({"a": list(a), "b": list(b)}, inputs={"u": list(ROWS)})
    fit = estimate(Gauges, {"c": 1.0, "g": guess}, experiment)
    for name, values in (("c", a), ("g", b)):
        best = ROWS @ values / (ROWS @ ROWS)
        spread = np.linalg.norm(values - best * ROWS) / np.sqrt(19 * (ROWS @ ROWS))
        assert fit.parameters[name] == pytest.approx(best, rel=1e-8)
        # degrees of freedom are shared out: 38 or 2 * 19
        assert fit.deviations[name] == pytest.approx(spread, rel=0.02)
    assert fit.variance == pytest.approx(1.0, rel=1e-3)


def test_the_quieter_output_counts_more():
    a, b = 2.0 * ROWS + 0.1 * noise(20, 1), 2e-6 * ROWS + 1e-8 * noise(20, 2)
    fit = estimate(Shared, {"c": 1.0}, Experiment({"a": list(a), "b": list(b)}, inputs={"u": list(ROWS)}))
    alone = ROWS @ b / (ROWS @ ROWS) * 1e6
    # a tenth of the noise of the other: its weight is a hundredth
    assert abs(fit.parameters["c"] - alone) < 0.5 * fit.deviations["c"]
    assert fit.deviations["c"] == pytest.approx(0.01 / np.linalg.norm(ROWS), rel=0.4)  # of 20 values: 16 %


def test_an_output_that_is_exact_beside_one_that_is_not():
    """Weights of 1e10 and more do not hide what the other output tells alone."""
    a, b = 0.7 * ROWS + 1e-2 * noise(20, 1), 2e-6 * ROWS
    fit = estimate(
        Gauges, {"c": 1.0, "g": 1.0}, Experiment({"a": list(a), "b": list(b)}, inputs={"u": list(ROWS)})
    )
    assert fit.parameters["c"] == pytest.approx(ROWS @ a / (ROWS @ ROWS), rel=1e-8)
    assert "the residuals of b are" in fit.warnings[-1]


def fading(seed: int, size: float = 0.02) -> np.ndarray:
    return 2.0 * np.exp(-0.7 * TIMES) + size * noise(13, seed)


def test_an_experiment_given_twice_is_told():
    y = fading(1)
    same = [Experiment({"y": (TIMES, y)}), Experiment({"y": (TIMES, y)}, name="again")]
    assert "y of experiment_1 and y of again hold the same values" in repr(estimate(Decay, {"k": 1.0}, same))
    part = [same[0], Experiment({"y": (TIMES[:7], y[:7])})]
    assert "hold the same values" in repr(estimate(Decay, {"k": 1.0}, part))
    other = [same[0], Experiment({"y": (TIMES, fading(2))})]
    assert estimate(Decay, {"k": 1.0}, other).warnings == ()


@pytest.mark.parametrize("known", [True, False])
def test_intervals_hold_the_truth_as_often_as_they_say(known):
    """Two outputs of a decay with a drive, over seeds: normalised errors are normal, or Student's."""

    class Driven(Model):
        k = Parameter(1.0)
        b = Parameter(1.0)
        y = Real(start=0.0, fixed=True)
        z = Real()

        def equations(self):
            yield der(self.y) == self.b - self.k * self.y
            yield self.z == 1e-6 * self.b * self.y

    k, b, fits = 0.7, 2.0, []
    y = b / k * (1 - np.exp(-k * TIMES))
    sizes = {"y": 0.02, "z": 1e-8}
    for seed in range(SEEDS):
        measured = {
            name: Samples(
                TIMES,
                course + sizes[name] * noise(13, 2 * seed + one),
                deviation=sizes[name] if known else None,
            )
            for one, (name, course) in enumerate((("y", y), ("z", 1e-6 * b * y)))
        }
        fits.append(estimate(Driven, {"k": Free(1.0, min=0.0), "b": 1.0}, Experiment(measured), elements=10))
    apart = np.array(
        [[(f.parameters[n] - x) / f.deviations[n] for f in fits] for n, x in (("k", k), ("b", b))]
    )
    low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], SEEDS) / SEEDS
    wider = 1.0 if known else 24 / 22  # Student's, of 24 degrees of freedom
    for one in apart:
        assert low < np.mean(one**2) / wider < high
    inside = [
        f.intervals(0.95)[n][0] < x < f.intervals(0.95)[n][1] for f in fits for n, x in (("k", k), ("b", b))
    ]
    assert np.mean(inside) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / (2 * SEEDS))
