"""What estimation refuses, and in which words: data that tell nothing, names, shapes and times that do not fit."""

import numpy as np
import pytest

from gantrytau import Model, ModelError, Parameter, Real, SolveError, der, exp
from gantrytau_optimica import Free, Samples
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.experiments import Experiment
from tests.optimica.estimation.estimation_data import Decay, Enzyme, QuadrupleTank, Trend, toggling

TIMES = np.linspace(0.0, 3.0, 13)
FADING = 2.0 * np.exp(-0.7 * TIMES) + np.random.default_rng(0).normal(0.0, 0.02, 13)
DATA = Experiment({"y": (TIMES, FADING)})
HOLE = {"a1": Free(3e-6)}


class Fading(Model):
    """A decay whose rate is made of two numbers; a third has no influence."""

    k = Parameter(1.0)
    V = Parameter(2.0)
    idle = Parameter(3.0)
    y = Real(start=2.0, fixed=True)

    def rate(self):
        return self.k / self.V

    def equations(self):
        yield der(self.y) == -self.rate() * self.y


class Product(Fading):
    def rate(self):
        return self.k * self.V


class Power(Fading):
    def rate(self):
        return self.k * self.V**2


class Sum(Fading):
    def rate(self):
        return self.k + self.V


class Difference(Fading):
    def rate(self):
        return self.k - self.V


class Mixed(Fading):
    def rate(self):
        return self.k * exp(self.V)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (Fading, "only k / V is determined"),
        (Product, r"only k \* V is determined"),
        (Power, r"only k \* V\^2 is determined"),
        (Sum, r"only k \+ V is determined"),
        (Difference, "only k - V is determined"),
        (Mixed, r"only k \+ [\d.]+ V \(to first order\) is determined"),
    ],
)
def test_parameters_that_only_occur_together(model, words):
    with pytest.raises(SolveError, match=f"k and V cannot be told apart by these data: {words}") as caught:
        estimate(model, {"k": Free(1.0), "V": Free(1.0)}, DATA)
    assert caught.value.optimum.success
    assert "Take one of each as known" in str(caught.value)


def test_a_parameter_without_influence():
    with pytest.raises(SolveError, match=r"nothing that was measured depends on idle\. Leave it out"):
        estimate(Fading, {"k": Free(1.0), "idle": Free(1.0)}, DATA)


def test_a_parameter_at_its_limit_is_named_and_left_out():
    experiment = Experiment({"y": (TIMES, FADING)}, start={"y": Free(1.0)})
    fit = estimate(Fading, {"k": Free(1.0, max=1.2)}, experiment)
    assert fit.at_bounds == {"k": 1.2}
    assert tuple(fit.deviations) == ("start(y)",)
    assert "k stands at its limit 1.2" in fit.warnings[0]
    with pytest.raises(ModelError, match=r"k stands at its limit 1\.2 and has no deviation"):
        fit.covariance(["k"])
    with pytest.raises(ModelError, match="z was not estimated"):
        fit.covariance(["z"])
    with pytest.raises(ModelError, match=r"write \['k'\]"):
        fit.covariance("k")
    with pytest.raises(ModelError, match="confidence=95, expected a number above 0 and below 1"):
        fit.intervals(95)  # pyright: ignore[reportArgumentType]


def test_strong_correlation_is_told():
    times = np.linspace(10.0, 11.0, 9)  # far from the start, slope and start act alike
    y = 1.0 + times + np.random.default_rng(2).normal(0.0, 0.01, 9)
    fit = estimate(Trend, {"slope": Free(0.0)}, Experiment({"y": (times, y)}, start={"y": Free(0.0)}))
    assert "start(y) and slope are strongly correlated (-0.99" in " ".join(fit.warnings)


def test_deviations_that_are_too_small_are_told():
    fit = estimate(Decay, {"k": 1.0}, Experiment({"y": Samples(TIMES, FADING, deviation=1e-3)}))
    assert "times the noise that was told" in fit.warnings[-1]


@pytest.mark.parametrize(
    ("experiment", "parameters", "words"),
    [
        (Experiment({"y": ([1.0], [1.0])}, start={"y": Free(1.0)}), {"k": 1.0}, "1 measured values for 2"),
        (Experiment({"y": ([1.0], [1.0])}), {"k": 1.0}, "expected more, to tell the noise"),
        (DATA, {}, "nothing to estimate"),
        (DATA, {"q": 1.0}, "Decay has no 'q'"),
        (DATA, {"y": 1.0}, "y is a variable, expected a parameter"),
        (DATA, {"k": Free(1.0, min=2.0)}, "the guess 1 lies outside of its limits 2 and inf"),
        (DATA, {"k": Free(1.0, min=2.0, max=1.0)}, "limits 2 and 1, expected the first to be the smaller"),
        (DATA, {"k": [1.0, 2.0]}, r"k: found \[1.0, 2.0\], expected 1 numbers"),
        (DATA, {"k": np.nan}, "k: found nan, expected finite numbers"),
        (DATA, ["k"], r"expected \{name: Free\(guess\)\}"),
        (Experiment({"z": (TIMES, FADING)}), {"k": 1.0}, "measured z: Decay has no 'z'"),
        (Experiment({"y[3]": (TIMES, FADING)}), {"k": 1.0}, r"no element \[3\] of y"),
        (Experiment({"y": (TIMES, np.c_[FADING, FADING])}), {"k": 1.0}, "samples of 2 columns, expected 1"),
        (Experiment({"y": (TIMES, FADING)}, stop=2.0), {"k": 1.0}, "4 samples lie outside of the horizon"),
        (Experiment({"y": (TIMES, FADING)}, start={"k": 1.0}), {"k": 1.0}, "k is a parameter, expected it"),
        (Experiment({"y": (TIMES, FADING)}, inputs={"u": 1.0}), {"k": 1.0}, "inputs: Decay has no 'u'"),
        (Experiment({"y": FADING}), {"k": 1.0}, "without times, expected Samples"),
        (Experiment({"y": (TIMES, FADING)}, parameters={"k": 1.0}), {"k": 1.0}, "has its own k"),
        ([], {"k": 1.0}, "expected one Experiment or a list"),
        ([Experiment({"y": (TIMES, FADING)}, name="a b")], {"k": 1.0}, "expected a word of letters"),
        ([Experiment({"y": (TIMES, FADING)}, name="a")] * 2, {"k": 1.0}, "two experiments are called a"),
        ([DATA, Experiment({"y": Samples(TIMES, FADING, deviation=0.1)})], {"k": 1.0}, "has none, expected"),
    ],
)
def test_what_does_not_fit(experiment, parameters, words):
    with pytest.raises(ModelError, match=words):
        estimate(Decay, parameters, experiment)


def test_starts_and_inputs_that_are_missing():
    with pytest.raises(ModelError, match=r"1 initial values are neither given nor estimated"):
        estimate(Trend, {"slope": 1.0}, DATA)
    levels = (TIMES, 0.06 + 0.001 * FADING)
    with pytest.raises(ModelError, match="the input u2 of experiment_1 is not known"):
        estimate(QuadrupleTank, HOLE, Experiment({"x[0]": levels}, inputs={"u1": 5.0}))
    short = {"u1": 5.0, "u2": ([0.0, 1.0], [5.0, 5.0])}
    with pytest.raises(ModelError, match="input u2: samples cover 0 to 1 s, expected 0 to"):
        estimate(QuadrupleTank, HOLE, Experiment({"x[0]": levels}, inputs=short))
    wide = {"u1": Samples([0.0, 60.0], [[5.0, 6.0]] * 2, largest_gap=99.0), "u2": toggling(9.0)}
    with pytest.raises(ModelError, match="found 2 columns, expected 1"):
        estimate(QuadrupleTank, HOLE, Experiment({"x[0]": levels}, inputs=wide))


def test_times_that_are_no_times():
    for times, words in (
        ([0.0, 2.0, 1.0], "the time falls"),
        ([0.0, 1.0, 1.0], "have the same time"),
        ([0.0, np.nan, 1.0], "row 1 is not finite"),
    ):
        with pytest.raises(ModelError, match=words):
            Experiment({"y": (times, [1.0, 2.0, 3.0])})
    with pytest.raises(ModelError, match="expected the first to be the smaller"):
        Experiment({"y": (TIMES, FADING)}, begin=5.0)
    with pytest.raises(ModelError, match="found nothing measured"):
        Experiment({})
    with pytest.raises(ModelError, match=r"measured y: found 3\.0"):
        Experiment({"y": 3.0})
    with pytest.raises(ModelError, match="found inputs=3"):
        Experiment({"y": (TIMES, FADING)}, inputs=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match="input concentration has 2 rows, the measured ones 3"):
        Experiment({"rate": [1.0, 2.0, 3.0]}, inputs={"concentration": [1.0, 2.0]})


def test_calls_that_make_no_sense():
    with pytest.raises(ModelError, match="expected a Model"):
        estimate("Decay", {"k": 1.0}, DATA)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match="input concentration of experiment_1 is not known"):
        estimate(Enzyme, {"top": 200.0}, Experiment({"rate": [1.0, 2.0]}))
