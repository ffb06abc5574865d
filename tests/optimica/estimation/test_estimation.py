"""Estimation of parameters: published fits, analytic covariances, independent sensitivities, repeated experiments."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from gantrytau import Fixed, Input, Model, Parameter, Real, der, prbs, simulate, study, translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Free, Samples
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.experiments import Experiment
from tests.families import NIGHTLY
from tests.optimica.estimation.estimation_data import (
    HOLES,
    NOISE,
    OXYGEN,
    PUROMYCIN,
    Decay,
    Enzyme,
    Oxygen,
    QuadrupleTank,
    Trend,
    tank_experiment,
    tank_levels,
)
from tests.optimica.known_answers.test_estimation import PINENE, PINENE_TIMES, Pinene, pinene_by_exponentials

BOTH = {name: Free(0.03e-4, min=0.0, max=1e-5) for name in HOLES}
TIMES = np.linspace(0.0, 3.0, 13)


def noisy(truth: np.ndarray, deviation: float, seed: int = 0) -> np.ndarray:
    return truth + np.random.default_rng(seed).normal(0.0, deviation, truth.shape)


@pytest.fixture(scope="module")
def tanks():
    return estimate(QuadrupleTank, BOTH, tank_experiment(1))


class Stepped(Model):
    """A decay on which an input is added: the output jumps with it."""

    k = Parameter(0.5, unit="1/s", description="rate")
    x = Real(start=1.0, fixed=True, description="what decays")
    u = Input(description="what is added")
    y = Real(description="output")

    def equations(self):
        yield der(self.x) == -self.k * self.x
        yield self.y == self.x + self.u


class Driven(Model):
    """A decay that is driven."""

    k = Parameter(0.5, unit="1/s", description="rate")
    u = Input(unit="1/s", description="drive")
    x = Real(unit="1", description="state", start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.u - self.k * self.x


def test_what_holds_after_a_step_counts_at_its_instant():
    t = np.linspace(0.0, 2.0, 9)
    u = (t >= 1.0) * 1.0
    inputs = {"u": Samples(t, u, kind="constant")}
    fit = estimate(
        Stepped, {"k": Free(0.5)}, Experiment({"y": (t, np.exp(-0.7 * t) + u)}, inputs), elements=8
    )
    assert fit.parameters["k"] == pytest.approx(0.7, abs=1e-6)  # the collocation on 8 elements
    np.testing.assert_allclose(fit.residuals["experiment_1", "y"], 0.0, atol=1e-9)
    assert abs(fit.optimum.playback.objective_error) < 1e-4  # of 4e5 for an error of 1


def test_a_binary_sequence_as_input_is_that_of_the_simulation():
    inputs = {"u": prbs(5, 0.1, 2.0, seed=3)}
    measured = simulate(Driven(k=0.7), stop=2.0, inputs=inputs, points=81, tolerance=1e-10)
    t = np.linspace(0.0, 2.0, 81)
    fit = estimate(Driven, {"k": Free(0.5)}, Experiment({"x": (t, measured.at(t, "x"))}, inputs))
    assert fit.parameters["k"] == pytest.approx(0.7, abs=1e-6)


def test_holes_of_the_quadruple_tank(tanks):
    for name, value in HOLES.items():
        assert abs(tanks.parameters[name] - value) < 3 * tanks.deviations[name]
    assert tanks.known
    assert 0.01 < tanks.probability < 0.99


def test_covariance_of_the_tanks_by_finite_differences_of_an_integrator(tanks):
    def errors(holes):
        levels = tank_levels(dict(zip(tanks.names, holes, strict=True)))
        measured = tanks.experiments[0].measured
        return np.concatenate([(levels[:, j] - measured[f"x[{j}]"].values[:, 0]) / NOISE for j in (0, 1)])

    best, step = np.array([tanks.parameters[n] for n in tanks.names]), 1e-9
    slopes = np.array([(errors(best + h) - errors(best - h)) / (2 * step) for h in np.eye(2) * step]).T
    expected = np.linalg.inv(slopes.T @ slopes)
    size = np.sqrt(np.diag(expected))
    # differences of second order in 3e-4 of the value, and the integrator's 1e-9
    np.testing.assert_allclose(
        tanks.covariance() / np.outer(size, size), expected / np.outer(size, size), atol=1e-6
    )
    # a thousandth of the noise: the collocation's own error on 50 elements
    np.testing.assert_allclose(tanks.errors, errors(best), atol=1e-3)


SEEDS = 30 if NIGHTLY else 12


def misses(seed: int) -> dict[str, float]:
    """How far an estimate from noisy data is from the truth, in its own deviations."""
    fit = estimate(QuadrupleTank, BOTH, tank_experiment(seed), elements=20)
    return {name: (fit.parameters[name] - value) / fit.deviations[name] for name, value in HOLES.items()}


def test_deviations_are_those_of_repeated_experiments():
    found = study(misses, seeds=SEEDS)
    assert not found.failures
    assert found.result(seed=7) == misses(7)  # in another process, bit by bit
    for name in HOLES:
        apart = found.to_xarray()[name].values
        # 99.9 % bands of the mean and of the standard deviation of SEEDS normal numbers
        assert abs(apart.mean()) < 3.3 / np.sqrt(SEEDS)
        low, high = np.sqrt(stats.chi2.ppf([5e-4, 1 - 5e-4], SEEDS - 1) / (SEEDS - 1))
        assert low < apart.std(ddof=1) < high


def test_a_straight_line_has_its_textbook_covariance():
    y = noisy(1.0 + 0.5 * TIMES, 0.1)
    fit = estimate(
        Trend,
        {"slope": Free(0.0)},
        Experiment({"y": Samples(TIMES, y, deviation=0.1)}, start={"y": Free(0.0)}),
    )
    matrix = np.column_stack([TIMES, np.ones(TIMES.size)])
    expected = 0.01 * np.linalg.inv(matrix.T @ matrix)
    np.testing.assert_allclose(fit.covariance(["slope", "start(y)"]), expected, rtol=1e-8)
    best = np.linalg.lstsq(matrix, y, rcond=None)[0]
    # the solver's tolerance
    np.testing.assert_allclose([fit.parameters["slope"], fit.parameters["start(y)"]], best, atol=1e-8)
    np.testing.assert_allclose(fit.residuals["experiment_1", "y"], y - matrix @ best, atol=1e-8)
    low, high = fit.intervals(0.95)["slope"]
    assert (high - low) / 2 == pytest.approx(stats.norm.ppf(0.975) * np.sqrt(expected[0, 0]), rel=1e-8)


def test_without_deviations_the_noise_is_estimated_and_intervals_are_those_of_student():
    y = noisy(1.0 + 0.5 * TIMES, 0.1)
    fit = estimate(Trend, {"slope": Free(0.0)}, Experiment({"y": Samples(TIMES, y)}, start={"y": Free(0.0)}))
    line: Any = stats.linregress(TIMES, y)
    assert not fit.known
    assert np.isnan(fit.probability)
    assert fit.deviations["slope"] == pytest.approx(line.stderr, rel=1e-7)
    low, high = fit.intervals(0.9)["slope"]
    assert (high - low) / 2 == pytest.approx(stats.t.ppf(0.95, 11) * line.stderr, rel=1e-7)


def test_exponential_decay_by_its_closed_form():
    y = noisy(2.0 * np.exp(-0.7 * TIMES), 0.02)
    fit = estimate(Decay, {"k": 2.0}, Experiment({"y": Samples(TIMES, y, deviation=0.02)}))
    k = fit.parameters["k"]
    slope = -2.0 * TIMES * np.exp(-k * TIMES) / 0.02
    # normal equation and covariance at the answer; the collocation on 50 elements is exact to about 1e-9
    assert fit.errors @ slope / np.linalg.norm(slope) == pytest.approx(0.0, abs=1e-4)
    assert fit.covariance()[0, 0] == pytest.approx(1 / (slope @ slope), rel=1e-6)


def test_puromycin_as_published():
    """Bates and Watts (1988), section 2.3: 212.7, 0.06412, residual deviation 10.93 for 10 degrees of freedom."""
    fit = estimate(
        Enzyme,
        {"top": Free(200.0), "half": Free(0.1)},
        Experiment({"rate": PUROMYCIN[1]}, inputs={"concentration": PUROMYCIN[0]}),
    )
    assert fit.parameters["top"] == pytest.approx(212.68, abs=0.01)
    assert fit.parameters["half"] == pytest.approx(0.06412, abs=1e-5)
    assert fit.noise == pytest.approx(10.93, abs=0.005)
    assert fit.deviations["top"] == pytest.approx(6.947, abs=0.001)
    assert fit.deviations["half"] == pytest.approx(8.281e-3, abs=1e-6)
    assert fit.freedom == 10


def test_oxygen_demand_as_published():
    """Bates and Watts (1988), section 2.4: 19.143 and 0.5311, sum of squares 25.99."""
    fit = estimate(Oxygen, {"top": 20.0, "rate": 0.3}, Experiment({"demand": OXYGEN}))
    assert fit.parameters["top"] == pytest.approx(19.143, abs=5e-4)
    assert fit.parameters["rate"] == pytest.approx(0.5311, abs=5e-5)
    assert fit.chi_square == pytest.approx(25.99, abs=5e-3)
    assert fit.correlation[0, 1] == pytest.approx(-0.85, abs=0.005)


def test_alpha_pinene_as_published():
    value, rates = pinene_by_exponentials()
    samples = Samples(np.array(PINENE_TIMES) / 1e4, np.array(PINENE))
    experiment = Experiment({"y": samples}, start={"y": [100.0, 0, 0, 0, 0]})
    fit = estimate(Pinene, {"k": Free(0.5, min=0.0)}, experiment, elements=120, points=5)
    assert fit.chi_square == pytest.approx(19.8721, abs=1e-4)  # COPS 3, its last digit cut off
    assert fit.chi_square == pytest.approx(value, abs=1e-6)
    np.testing.assert_allclose([fit.parameters[f"k[{j}]"] for j in range(5)], rates, rtol=1e-4)
    assert fit.residuals["experiment_1", "y"].shape == (8, 5)


def test_two_experiments_together_tell_more_than_each_alone():
    first, second = tank_experiment(3), tank_experiment(4, u=(7.0, 9.0), stop=60.0)
    alone = [estimate(QuadrupleTank, BOTH, e) for e in (first, second)]
    both = estimate(QuadrupleTank, BOTH, [first, second])
    # information of independent experiments adds up; slopes differ with the point, by some 1e-3 here
    expected = np.linalg.inv(sum(np.linalg.inv(fit.covariance()) for fit in alone))
    np.testing.assert_allclose(np.diag(both.covariance()), np.diag(expected), rtol=5e-3)
    for name in HOLES:
        assert both.deviations[name] < min(fit.deviations[name] for fit in alone)


def test_experiments_of_different_length_start_and_parameters():
    slow, fast = np.linspace(0.1, 3.7, 9), np.linspace(1.05, 1.4, 5)
    fit = estimate(
        Decay,
        {"k": Free(1.0, min=0.0)},
        [
            Experiment({"y": (slow, 3.0 * np.exp(-0.7 * slow))}, start={"y": Free(1.0)}, name="slow"),
            Experiment({"y": (fast, 0.5 * np.exp(-0.7 * (fast - 1.0)))}, start={"y": 0.5}, begin=1.0),
        ],
        elements=20,
    )
    assert fit.parameters["k"] == pytest.approx(0.7, abs=1e-6)  # the collocation on 20 elements
    assert fit.parameters["slow.start(y)"] == pytest.approx(3.0, abs=1e-6)


def test_an_experiment_with_a_parameter_of_its_own():
    y = np.exp(-0.7 * TIMES)
    fit = estimate(
        Decay,
        {"k": Free(1.0)},
        [
            Experiment({"y": (TIMES, 2 * y)}),
            Experiment({"y": (TIMES, 2 * y**2)}, parameters={"k": Free(1.0)}, name="other"),
        ],
    )
    assert fit.parameters == pytest.approx({"k": 0.7, "other.k": 1.4}, abs=1e-6)


def test_a_stray_value_hardly_moves_a_robust_fit():
    y = noisy(2.0 * np.exp(-0.7 * TIMES), 0.02)
    clean = estimate(Decay, {"k": 2.0}, Experiment({"y": (TIMES, y)}))
    y = y.copy()
    y[4] += 5.0
    experiment = Experiment({"y": (TIMES, y)})
    plain = estimate(Decay, {"k": 2.0}, experiment)
    robust = estimate(Decay, {"k": 2.0}, experiment, loss="robust")
    size = clean.deviations["k"]
    assert abs(plain.parameters["k"] - clean.parameters["k"]) > 10 * size
    assert abs(robust.parameters["k"] - clean.parameters["k"]) < 2 * size
    assert robust.weights[4] < 0.02
    assert "values count less" in robust.report()


def swinging(times: np.ndarray) -> list[np.ndarray]:
    """Position, velocity and acceleration of the tool on a curve on which all carts turn around, each (n, 3)."""
    middle, size = np.array([0.4, 2.8, -0.8]), np.array([0.3, 0.25, 0.2])
    speed, phase = 2 * np.pi * np.array([0.5, 0.75, 1.0]), np.array([0.0, 0.5, 1.0])
    angle = np.outer(times, speed) + phase
    return [middle + size * np.sin(angle), size * speed * np.cos(angle), -size * speed**2 * np.sin(angle)]


def test_friction_of_the_gantry_from_a_motion():
    """Coulomb and viscous friction of three carts from their positions at 100 Hz, with 0.1 mm of noise."""
    robot, times = GantryTau(prototypes.GT_A), np.linspace(0.0, 2.0, 201)
    truth = {
        f"carts[{i}].law.{name}": getattr(prototypes.GT_A, field)[i]
        for i in range(3)
        for name, field in (("f_c", "coulomb"), ("f_v", "viscous"))
    }
    drives = [f"carts[{i}].f" for i in range(3)]
    forces = translate(robot).function(["tool.r", "tool.v", "der(tool.v)"], drives)
    r, v, a = swinging(times)
    pushed = {
        name: (times, np.array([float(forces(*row)[i]) for row in zip(r, v, a, strict=True)]))
        for i, name in enumerate(drives)
    }
    begun = GantryTau(prototypes.GT_A, tool=dict(r=Fixed(list(r[0])), v=Fixed(list(v[0]))))
    motion = simulate(begun, stop=2.0, points=201, inputs=pushed)
    experiment = Experiment(
        {
            f"carts[{i}].s": Samples(times, noisy(motion[f"carts[{i}].s"], 1e-4, seed=i), deviation=1e-4)
            for i in range(3)
        },
        inputs=pushed,
        start={"tool.r": list(r[0]), "tool.v": list(v[0])},
        guess={
            name: lambda t, k=k: swinging(np.array([t]))[k][0] for k, name in enumerate(("tool.r", "tool.v"))
        },
    )
    # as many elements as samples: inputs that are joined by straight lines have no corner inside of one
    fit = estimate(robot, {n: Free(200.0, min=0.0, max=2000.0) for n in truth}, experiment, elements=200)
    for name, value in truth.items():
        assert abs(fit.parameters[name] - value) < 3 * fit.deviations[name]
        assert fit.deviations[name] < 1e-3 * value


def test_a_coarse_mesh_is_told_with_what_it_costs():
    y = noisy(2.0 * np.exp(-7.0 * TIMES), 1e-5)
    experiment = Experiment({"y": Samples(TIMES, y, deviation=1e-5)})
    coarse, fine = (estimate(Decay, {"k": 5.0}, experiment, elements=n) for n in (10, 100))
    moved = fine.parameters["k"] - coarse.parameters["k"]
    assert abs(moved) > 10 * fine.deviations["k"]
    assert coarse.mesh_shift["k"] == pytest.approx(moved, rel=0.2)  # most of it, by the first halving
    assert "on twice the elements k moves by" in coarse.warnings[0]
    assert fine.warnings == ()


def test_report_repr_and_figure(tanks, tmp_path):
    words = tanks.report()
    assert "a1" in words
    assert "chi-square" in words
    assert "correlations: a1, a2" in words
    assert repr(tanks).startswith("<Estimate QuadrupleTank: a1 = 2.65")
    tanks.plot(file=tmp_path / "fit.png")
    assert (tmp_path / "fit.png").stat().st_size > 10_000
