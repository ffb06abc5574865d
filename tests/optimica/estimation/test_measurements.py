"""Measured signals: sums over samples, integrals of errors, and inputs that are known."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Start
from gantrytau_optimica import (
    Free,
    Optimization,
    Samples,
    final,
    integral_of_squares,
    link,
    optimize,
    sum_of_squares,
)
from gantrytau_optimica.estimation import Experiment
from tests.optimica.problems import Mass


class Thrown(Optimization):
    """A mass without force, its speed to be found from measured positions."""

    mass: Any = Mass(x=Fixed(0.0), v=Start(Free(1.0)), u=0.0)
    final_time = 2.0
    samples: Any = Samples([0.3, 0.9, 1.7], [0.2, 1.1, 1.6])

    def objective(self):
        return sum_of_squares(self.mass.x, self.samples)


def problem(base: type[Optimization] = Thrown, **members):
    """The problem with other members."""
    return type("Problem", (base,), members)


T, Y = np.array([0.3, 0.9, 1.7]), np.array([0.2, 1.1, 1.6])
SPEED = float(T @ Y / (T @ T))  # least squares through the origin
LEAST = float(Y @ Y - SPEED * (T @ Y))


@pytest.mark.parametrize("scheme", ["radau", "gauss", "shooting"])
def test_a_line_through_samples_off_the_mesh(scheme):
    optimum = optimize(Thrown, elements=4, scheme=scheme)
    assert optimum["mass.v"][0] == pytest.approx(SPEED, abs=1e-7)
    assert optimum.objective == pytest.approx(LEAST, abs=1e-9)
    assert optimum.playback.objective == pytest.approx(LEAST, abs=1e-8)


def test_samples_on_borders_and_at_both_ends():
    t = np.array([0.0, 0.5, 1.0, 2.0])
    y = np.array([0.1, 0.4, 1.2, 1.9])
    optimum = optimize(problem(samples=Samples(t, y)), elements=4)
    assert optimum["mass.v"][0] == pytest.approx(float(t @ y / (t @ t)), abs=1e-7)


@pytest.mark.parametrize("deviation", [0.5, np.array([[0.1], [0.3], [0.2]])])
def test_deviations_weigh_samples(deviation):
    optimum = optimize(problem(samples=Samples(T, Y, deviation=deviation)), elements=3)
    weight = np.broadcast_to(1 / np.asarray(deviation) ** 2, (3, 1))[:, 0]
    speed = (weight * T) @ Y / ((weight * T) @ T)
    assert optimum["mass.v"][0] == pytest.approx(speed, abs=1e-7)
    assert optimum.objective == pytest.approx(weight @ (speed * T - Y) ** 2, rel=1e-7)


def test_samples_of_several_columns_with_their_deviations():
    class Both(Thrown):
        def objective(self):
            rows = np.column_stack([Y, [1.0, 1.2, 1.1]])
            return sum_of_squares(
                ca.vertcat(self.mass.x, self.mass.v), Samples(T, rows, deviation=[0.1, 0.2])
            )

    a = np.concatenate([T / 0.1, np.full(3, 1 / 0.2)])
    b = np.concatenate([Y / 0.1, np.array([1.0, 1.2, 1.1]) / 0.2])
    optimum = optimize(Both, elements=3)
    assert optimum["mass.v"][0] == pytest.approx(a @ b / (a @ a), abs=1e-7)
    assert optimum.playback.objective == pytest.approx(optimum.objective, rel=1e-7)


def test_a_weight_in_front_of_a_sum():
    class Weighed(Thrown):
        def objective(self):
            return 3 * sum_of_squares(self.mass.x, self.samples) + (final(self.mass.v) - 2) ** 2

    # 3 T (T v - Y) + v - 2 = 0
    speed = (3 * T @ Y + 2) / (3 * T @ T + 1)
    assert optimize(Weighed, elements=3)["mass.v"][0] == pytest.approx(speed, abs=1e-7)


class TwoSensors(Thrown):
    """The same signal measured twice, at other times and with another precision."""

    def objective(self):
        return sum_of_squares(self.mass.x, Samples(T, Y)) + sum_of_squares(
            self.mass.x, Samples([0.5, 1.5], [0.4, 1.9], deviation=0.5)
        )


def two_sensors() -> float:
    a = np.concatenate([T, np.array([0.5, 1.5]) / 0.5])
    b = np.concatenate([Y, np.array([0.4, 1.9]) / 0.5])
    return float(a @ b / (a @ a))


def test_two_sensors_of_one_signal():
    assert optimize(TwoSensors, elements=3)["mass.v"][0] == pytest.approx(two_sensors(), abs=1e-7)


def test_two_sensors_of_one_signal_are_played_back():
    optimum = optimize(TwoSensors, elements=3)
    assert optimum.playback.objective == pytest.approx(optimum.objective, rel=1e-7)


def test_samples_of_phases():
    class Second(Thrown):
        mass = Mass(u=0.0)
        start_time = 2.0
        final_time = 4.0
        samples = Samples([2.5, 3.5], [2.0, 4.0])

    class Both(Optimization):
        first = Thrown()
        second = Second()

        def constraints(self):
            yield link(self.first, self.second)

    t, y = np.append(T, [2.5, 3.5]), np.append(Y, [2.0, 4.0])
    optimum = optimize(Both, elements=3)
    assert optimum["second.mass.v"][0] == pytest.approx(t @ y / (t @ t), abs=1e-7)
    assert optimum.playback.objective == pytest.approx(optimum.objective, rel=1e-7)


def test_free_lengths_and_samples_are_refused():
    class Forced(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
        final_time = 2.2

        def objective(self):
            return sum_of_squares(self.mass.x, Samples([0.55, 1.65], [0.1, 0.9])) - final(self.mass.v)

    with pytest.raises(ModelError, match="lengths='free', expected 'given' beside sums over samples"):
        optimize(Forced, elements=5, lengths="free")


def integrated(kind, times, values):
    class Course(Thrown):
        def objective(self):
            return integral_of_squares(self.mass.v, Samples(times, values, kind=kind))

    return Course


def test_the_integral_of_an_error():
    # speed next to straight lines 0, 2, 1: their mean is (1 + 1.5) / 2
    optimum = optimize(integrated("linear", [0.0, 1.0, 2.0], [0.0, 2.0, 1.0]), elements=4)
    assert optimum["mass.v"][0] == pytest.approx(1.25, abs=1e-7)
    # integral of (v - course)^2: of the squares 4/3 + 7/3, less 2 * 1.25^2
    assert optimum.objective == pytest.approx(4 / 3 + 7 / 3 - 2 * 1.25**2, abs=1e-7)


def test_the_integral_of_an_error_of_steps_off_the_mesh():
    # 1 until 0.7, then 3: mean (0.7 + 3 * 1.3) / 2
    optimum = optimize(integrated("constant", [0.0, 0.7], [1.0, 3.0]), elements=3)
    mean = (0.7 + 3.9) / 2
    assert optimum["mass.v"][0] == pytest.approx(mean, abs=1e-7)
    assert optimum.objective == pytest.approx(0.7 + 9 * 1.3 - 2 * mean**2, abs=1e-7)
    assert optimum.playback.objective == pytest.approx(optimum.objective, abs=1e-7)
    assert np.any(np.abs(optimum.breaks - 0.7) < 1e-9)


def test_the_integral_of_an_error_may_be_weighed_and_joined_to_a_sum():
    class Joined(Thrown):
        def objective(self):
            course = Samples([0.0, 2.0], [1.0, 1.0], deviation=0.5)
            return 3 * integral_of_squares(self.mass.v, course) + sum_of_squares(self.mass.x, self.samples)

    # 3 * 2 * 4 (v - 1) + T (T v - Y) = 0
    speed = (24 + T @ Y) / (24 + T @ T)
    optimum = optimize(Joined, elements=3)
    assert optimum["mass.v"][0] == pytest.approx(speed, abs=1e-7)
    assert optimum.playback.objective == pytest.approx(optimum.objective, abs=1e-7)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (dict(times=[0, 1], values=[1, np.nan]), "Samples: row 1 is not finite, expected numbers"),
        (dict(times=[0, np.inf, 2], values=[1, 2, 3]), "Samples: row 1 is not finite"),
        (dict(times=[0, 1, 1], values=[1, 2, 3]), "Samples: rows 1 and 2 have the same time 1 s"),
        (dict(times=[0, 2, 1], values=[1, 2, 3]), "Samples: the time falls from 2 s in row 1 to 1 s"),
        (dict(times=[0, 1, 2], values=[1, 2]), "found times of shape (3,) and values of shape (2,)"),
        (dict(times=[], values=[]), "found times of shape (0,) and values of shape (0,)"),
        (dict(times=[[0, 1]], values=[1, 2]), "found times of shape (1, 2)"),
        (dict(times=["now"], values=[1]), "Samples: found times=['now'], expected numbers"),
        (dict(times=[0], values=[None, "x"]), "Samples: found values=[None, 'x'], expected numbers"),
        (dict(times=[0, 1], values=[1, 2], kind="cubic"), "found kind='cubic', expected 'linear' or"),
        (dict(times=[0, 1], values=[1, 2], deviation=0), "found deviation"),
        (dict(times=[0, 1], values=[1, 2], deviation=[1, 2, 3]), "found deviation of shape (3,), expected"),
    ],
)
def test_samples_that_cannot_be(arguments: dict[str, Any], words):
    with pytest.raises(ModelError) as caught:
        Samples(**arguments)
    assert words in str(caught.value)


def message(wrong, **policy) -> str:
    with pytest.raises(ModelError) as caught:
        optimize(wrong, **policy)
    return str(caught.value)


def objective(function):
    return problem(objective=function)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (problem(samples=Samples([1.0, 2.5, 3.0], [1, 2, 3])), "sum_of_squares(mass.x): 2 samples lie"),
        (problem(samples=[1, 2]), "sum_of_squares: found samples=[1, 2], expected Samples"),
        (problem(samples=Samples([1.0], [[1, 2]])), "found 1 expressions and samples of 2 columns"),
        (problem(final_time=Free(2.0, unit="s")), "needs fixed times, found a free start or final time"),
        (objective(lambda p: sum_of_squares(p.mass.x, p.samples) ** 2), "sum_of_squares(mass.x) does not"),
        (objective(lambda p: 0 * sum_of_squares(p.mass.x, p.samples)), "does not enter it as a sum times a"),
        (objective(lambda p: sum_of_squares(final(p.mass.x), p.samples)), "which has its time already"),
        (problem(constraints=lambda p: [sum_of_squares(p.mass.x, p.samples) <= 1]), "Problem, constraint"),
        (objective(lambda p: integral_of_squares(p.mass.x, p.samples)), "integral_of_squares(mass.x):"),
        (
            objective(lambda p: integral_of_squares(p.mass.x, Samples([0, 0.1, 0.2, 0.3, 2], range(5)))),
            "integral_of_squares(mass.x): a gap from 0.3 to 2 s, longer than 1 s",
        ),
    ],
)
def test_targets_that_cannot_be(wrong, words):
    assert words in message(wrong, elements=3)


def test_a_gap_may_be_allowed():
    def allowed(p):
        samples = Samples([0, 0.1, 0.2, 0.3, 2], np.ones(5), largest_gap=2.0)
        return integral_of_squares(p.mass.v, samples)

    assert optimize(objective(allowed), elements=3)["mass.v"][0] == pytest.approx(1.0, abs=1e-7)


def test_sums_outside_of_a_problem():
    with pytest.raises(ModelError, match="sum_of_squares was used outside of an optimisation problem"):
        sum_of_squares(3.0, Samples([0.0], [1.0]))


def test_the_times_of_an_experiment_may_bring_their_unit():
    found = Experiment({"x": ([0.0, 1.0], [0.0, 1.0])}, begin="100 ms", stop="0.5 s")  # type: ignore[arg-type]
    assert (found.begin, found.stop) == (0.1, 0.5)
