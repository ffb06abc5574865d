"""Samples and signals as inputs of a simulation: exact at every jump, however short what follows it."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Samples,
    chirp,
    der,
    if_else,
    multisine,
    prbs,
    sampled,
    simulate,
    steps,
    translate,
    white_noise,
)
from tests.simulation.test_simulation import Integrator

TOLERANCE = 1e-9


class Lag(Model):
    """A lag of first order, with an output that its input reaches at once."""

    T = Parameter(0.1, unit="s", description="time constant")
    u = Input(unit="1", description="input")
    x = Real(unit="1", description="state", start=0.0, fixed=True)
    y = Real(unit="1", description="sum of both")

    def equations(self):
        yield self.T * der(self.x) == self.u - self.x
        yield self.y == self.x + self.u


class Sides(Lag):
    """A lag that tells on which side of a level its output is."""

    above = Real(unit="1", description="whether it is above a half")

    def equations(self):
        yield from super().equations()
        yield self.above == if_else(self.y > 0.5, 1.0, 0.0)


class Three(Model):
    """Three integrators."""

    u = Input(3, unit="1", description="rates")
    x = Real(3, unit="s", description="integrals", start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.u


def step_response(t, begin, end):
    """Of the lag to a one between two times, from the left at both."""
    rising = 1 - np.exp(-(np.minimum(t, end) - begin) / 0.1)
    return np.where(t <= begin, 0.0, rising * np.exp(-np.maximum(t - end, 0.0) / 0.1))


@pytest.mark.parametrize("points", [2, 7, 501])
@pytest.mark.parametrize("model", [Lag, Sides])
def test_both_sides_of_jumps_are_in_the_result(model, points):
    found = simulate(
        model(), stop=1.0, inputs={"u": steps([0.2, 0.53], [1.0, 0.0])}, points=points, tolerance=TOLERANCE
    )
    t = found.time
    for instant, before, behind in ((0.2, 0.0, 1.0), (0.53, 1.0, 0.0)):
        (places,) = np.nonzero(t == instant)
        assert places.size == 2
        np.testing.assert_array_equal(found["u"][places], [before, behind])
        assert np.ptp(found["x"][places]) == 0.0
        np.testing.assert_allclose(np.diff(found["y"][places]), behind - before, atol=1e-15)
    np.testing.assert_allclose(found["x"], step_response(t, 0.2, 0.53), atol=10 * TOLERANCE)
    if model is Sides:
        np.testing.assert_array_equal(found["above"], found["y"] > 0.5)


@pytest.mark.parametrize("width", [1e-6, 1e-9, 1e-12])
def test_a_pulse_is_not_stepped_over_however_short(width):
    held = Samples([0.0, 0.3, 0.3 + width], [0.0, 1.0 / width, 0.0], kind="constant")
    line = Samples([0.0, 0.3, 0.3 + width, 0.3 + 2 * width, 1.0], [0.0, 0.0, 1.0 / width, 0.0, 0.0])
    for samples in (held, line):
        found = simulate(Integrator(), stop=1.0, inputs={"u": samples}, points=2)
        # the tolerance, and what rounding of its times does to the area
        assert found.final("x") == pytest.approx(1.0, rel=1e-8 + 2e-16 / width)


def test_a_jump_at_an_output_point_that_differs_by_rounding_is_there():
    instants = np.cumsum(np.full(9, 0.1))  # 0.1 + 0.1 + 0.1 is not 0.3
    found = simulate(
        Integrator(),
        stop=1.0,
        inputs={"u": steps(instants, np.arange(1.0, 10.0))},
        points=11,
        tolerance=TOLERANCE,
    )
    assert np.unique(found.time).size == 11
    np.testing.assert_allclose(found.final("x"), 0.1 * 45, atol=1e-12)


def test_jumps_at_both_ends():
    samples = Samples([0.0, 0.5, 1.0], [2.0, 4.0, 8.0], kind="constant")
    found = simulate(Integrator(), stop=1.0, inputs={"u": samples}, points=3)
    np.testing.assert_array_equal(found.time, [0.0, 0.5, 0.5, 1.0, 1.0])
    np.testing.assert_array_equal(found["u"], [2.0, 2.0, 4.0, 4.0, 8.0])
    np.testing.assert_allclose(found["x"], [0.0, 1.0, 1.0, 3.0, 3.0], atol=1e-12)


def test_an_integral_of_noise_is_its_sum():
    noise = white_noise(3.0, 0.01, seed=4)
    found = simulate(Integrator(), stop=20.0, inputs={"u": noise}, points=201)
    assert found.time.size == 201  # of 2000 jumps results show the output points only
    samples = noise.samples(0.0, 20.0)
    sums = np.concatenate([[0.0], 0.01 * np.cumsum(samples.values[:, 0])])
    np.testing.assert_allclose(found["x"], sums[10 * np.arange(201)], atol=1e-10)
    np.testing.assert_array_equal(found["u"], samples.values[10 * np.arange(201), 0])


def test_a_lag_driven_by_noise_is_the_discrete_one():
    noise = white_noise(1.0, 0.02, seed=5)
    found = simulate(Lag(), stop=4.0, inputs={"u": noise}, points=201, tolerance=TOLERANCE)
    pole = np.exp(-0.02 / 0.1)
    exact: Any = lfilter([0.0, 1 - pole], [1.0, -pole], noise.values(0.02 * np.arange(201)))
    at = np.searchsorted(found.time, np.linspace(0.0, 4.0, 201))
    np.testing.assert_allclose(found["x"][at], exact, atol=100 * TOLERANCE)  # errors of 200 starts add up


def test_a_controller_sees_the_new_value_at_an_instant_they_share():
    class Sampler(Model):
        u = Input(unit="1", description="measured")
        y = Real(unit="1", description="sample", start=0.0)

        def equations(self):
            yield sampled(self.y, self.u, period=0.1)

    noise = white_noise(1.0, 0.1, seed=6)
    found = simulate(Sampler(), stop=2.0, inputs={"u": noise}, points=21)
    t = np.append(np.diff(found.time) > 0, True)  # behind the jumps
    np.testing.assert_array_equal(found["y"][t], noise.values(0.1 * np.arange(21)))


def test_a_signal_from_a_later_start_is_the_same_course():
    noise = prbs(7, 0.05, 2.0, seed=3)
    found = simulate(Integrator(), start=0.52, stop=1.0, inputs={"u": noise}, points=25)
    inside = found.time[1:-1][np.diff(found.time)[1:] > 0]
    np.testing.assert_array_equal(np.interp(inside, found.time, found["u"]), noise.values(inside))


@pytest.mark.parametrize("signal", [chirp(0.5, 4.0, 2.0, 3.0), multisine([1.0, 2.5], [2.0, 1.0])])
def test_smooth_signals_are_functions_of_time_that_can_be_differentiated(signal):
    class Differentiator(Model):
        u = Input(unit="m", description="position")
        v = Real(unit="m/s", description="its rate")
        a = Real(unit="m/s2", description="the rate of that")

        def equations(self):
            yield self.v == der(self.u)
            yield self.a == der(self.v)

    found = simulate(Differentiator(), stop=2.0, inputs={"u": signal}, points=4001)
    np.testing.assert_allclose(found["u"], signal.values(found.time), atol=1e-12)
    h = found.time[1]
    rate = (signal.values(found.time[1:-1] + h / 2) - signal.values(found.time[1:-1] - h / 2)) / h
    np.testing.assert_allclose(found["v"][1:-1], rate, atol=(2 * np.pi * 4 * h) ** 2 * 3 * 30)
    with pytest.raises(ModelError, match="input u is differentiated 2 times by the model"):
        simulate(Differentiator(), stop=2.0, inputs={"u": prbs(5, 0.1, seed=1)})


def test_signals_without_seed_take_that_of_the_run():
    noise = white_noise(1.0, 0.1)
    names = [f"u[{k}]" for k in range(3)]

    def courses(seed, **given):
        found = simulate(
            Three(), stop=50.0, inputs=dict.fromkeys(names, noise) | given, seed=seed, points=501
        )
        return np.array([found[name] for name in names])

    first = courses(1)
    np.testing.assert_array_equal(first, courses(1))
    assert not np.any(np.all(np.isclose(first, courses(2)), axis=1))
    correlation: Any = np.corrcoef(first)
    assert np.abs(correlation[~np.eye(3, dtype=bool)]).max() < 4 / np.sqrt(500)
    own = white_noise(1.0, 0.1, seed=9)
    kept = courses(1, **{"u[1]": own})
    np.testing.assert_array_equal(kept[[0, 2]], first[[0, 2]])  # one stream does not depend on the others
    assert kept[1, -1] == own.values(50.0)


def test_noise_of_one_std_for_all_elements():
    found = simulate(Three(), stop=10.0, inputs={"u": white_noise(2.0, 0.1)}, seed=1, points=101)
    assert np.linalg.matrix_rank(found["u"]) == 3
    np.testing.assert_array_equal(
        found["u"][0], simulate(Three(), stop=1.0, inputs={"u": white_noise(2.0, 0.1)}, seed=1)["u"][0]
    )


@pytest.mark.parametrize(
    ("inputs", "seed", "words"),
    [
        ({"u": white_noise(1.0, 0.1)}, None, "input u: white_noise has no seed; give it one, as seed=1"),
        ({"u": multisine([1.0], phases="random")}, None, "input u: multisine has no seed"),
        ({"u": white_noise(1.0, 0.1)}, 1.5, "found seed=1.5, expected a whole number"),
        ({"u": white_noise([1.0, 2.0], 0.1, 1)}, None, "input u: found 2 columns, expected 1"),
        ({"u": white_noise(1.0, 1e-9, 1)}, None, "input u: white_noise(std=1.0, period=1e-09"),
        ({"u": Samples([0.0], [1.0])}, None, "samples cover 0 to 0 s, expected 0 to 1 s; add samples"),
        ({"u": Samples([0.5, 2.0], [1.0, 2.0], kind="constant")}, None, "samples cover 0.5 to 2 s"),
    ],
)
def test_wrong_signals(inputs, seed, words):
    with pytest.raises(ModelError) as caught:
        simulate(Lag(), stop=1.0, inputs=inputs, seed=seed)
    assert words in str(caught.value)
    with pytest.raises(ModelError, match="input u: found 1 values, expected 3"):
        simulate(Three(), stop=1.0, inputs={"u": chirp(1.0, 2.0, 1.0)})


def test_one_held_sample_is_a_constant():
    found = simulate(Integrator(), stop=1.0, inputs={"u": Samples([0.0], [3.0], kind="constant")})
    np.testing.assert_allclose(found["x"], 3 * found.time, atol=1e-9)


def test_arrays_of_samples_cannot_be_changed_behind_their_back():
    times, values = np.array([0.0, 1.0]), np.array([0.0, 1.0])
    samples = Samples(times, values)
    values[1] = 100.0
    assert simulate(translate(Integrator()), stop=1.0, inputs={"u": samples}).final("x") == pytest.approx(0.5)
    with pytest.raises(ValueError, match="read-only"):
        samples.values[0] = 1.0


def test_a_logged_switch_is_0_and_1():
    assert Samples([0, 1], np.array([False, True])).values.ravel().tolist() == [0.0, 1.0]
