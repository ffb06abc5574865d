"""The complementary filter against motions in closed form, the textbook's way, and what accelerometers do wrong."""

import numpy as np
import pytest
from scipy import signal

from gantrytau import ModelError
from gantrytau_optimica import Complementary
from tests.optimica.learning.estimators.analytic_runs import PERIOD, swung_ramp

HZ = 4.5


def combined(z, a, hz=HZ, period=PERIOD, order=2):
    """Of one axis."""
    return Complementary((hz,), order).combine({"z": z[:, None], "a": a[:, None]}, period)[:, 0]


@pytest.mark.parametrize("rows", [1200, 1201])
@pytest.mark.parametrize("stop", [3.0, np.inf])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_what_both_sensors_see_is_exact(rows, stop, order):
    """Also where the record ends in motion: a ramp with a sine upon it."""
    z, a = swung_ramp(PERIOD * np.arange(rows), stop=stop)
    # what is left are jumps of the jerk at 1 s and at the end, between samples
    assert np.abs(combined(z, a, order=order) - z).max() < 5e-7


def test_errors_fall_with_the_period_as_its_square():
    errors = []
    for period in (0.004, 0.002, 0.001):
        z, a = swung_ramp(period * np.arange(round(4.8 / period)), stop=3.0)
        errors.append(np.abs(combined(z, a, period=period) - z).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.2)


def test_kinematics_rule_slow_motion_and_the_accelerometer_quick_one():
    t = PERIOD * np.arange(2501)
    inside = (t > 3.0) & (t < 7.0)
    for f in (0.5, 2.0, HZ, 10.0, 40.0):
        z = np.cos(2 * np.pi * f * t)
        a = -((2 * np.pi * f) ** 2) * z
        # bilinear Butterworth, twice
        gain = 1 / (1 + (np.tan(np.pi * f * PERIOD) / np.tan(np.pi * HZ * PERIOD)) ** 4)
        for found, expected in ((combined(z, 0 * a), gain), (combined(0 * z, a), 1 - gain)):
            np.testing.assert_allclose(found[inside], expected * z[inside], atol=2e-4)
    still = np.full(1200, 0.3)
    np.testing.assert_allclose(combined(still, 0 * still), still, rtol=1e-12)  # gain 1 at 0 Hz


def integrated(x):
    """By trapezoids."""
    return np.concatenate([[0.0], PERIOD * np.cumsum((x[1:] + x[:-1]) / 2)])


def test_it_is_filtering_forwards_and_backwards_with_double_integration():
    """Where motion begins and ends at rest, double integration does not drift, and the textbook's way is defined."""
    t = PERIOD * np.arange(2001)
    z, _ = swung_ramp(t, stop=4.0)
    shake = 1e-3 * np.exp(-(((t - 3.0) / 0.3) ** 2)) * np.sin(2 * np.pi * 9.0 * t)  # arms bend
    fine = np.gradient(np.gradient(z + shake, PERIOD), PERIOD)
    sections = signal.butter(2, HZ, fs=1 / PERIOD, output="sos")
    twice = integrated(integrated(fine))
    textbook = signal.sosfiltfilt(sections, z) + twice - signal.sosfiltfilt(sections, twice)
    found = combined(z, fine)
    # trapezoids integrate 9 Hz twice as (w T / 2 / tan(w T / 2))^2, 0.9 % too little
    assert np.abs(found - textbook).max() < 0.01 * np.abs(shake).max()
    assert np.abs(found - z).max() > 0.8 * np.abs(shake).max()


def test_bias_and_drift_are_not_integrated_up():
    """An offset b leaves b / wc^2 at the end at most and nothing before, a drift d b/dt d / wc^3 where it begins."""
    t = PERIOD * np.arange(1200)
    z, a = swung_ramp(t, stop=3.0)
    wc = 2 * np.pi * HZ
    before = t < t[-1] - 3 / HZ
    for wrong, left in ((0.05 + 0 * t, 1e-8), (0.02 * t, 0.02 / wc**3)):
        error = np.abs(combined(z, a + wrong) - combined(z, a))
        assert error.max() < np.abs(wrong).max() / wc**2
        assert error[before].max() < left
    # an accelerometer that is off by 2 degrees shows the other axis in this one, and no more than that
    tilt = np.radians(2.0)
    tilted = combined(0 * z, np.sin(tilt) * a)
    assert np.abs(tilted).max() < np.sin(tilt) * np.ptp(z)


def test_superposition_and_many_responses():
    random = np.random.default_rng(7)
    z, a = random.standard_normal((2, 60, 3, 2, 4))
    estimator = Complementary((4.5, 2.63))
    many = estimator.combine({"z": z, "a": a}, PERIOD)
    for i in range(2):
        for j in range(4):
            one = estimator.combine({"z": z[..., i, j], "a": a[..., i, j]}, PERIOD)
            np.testing.assert_allclose(many[..., i, j], one, atol=1e-12)
    np.testing.assert_array_equal(Complementary(4.5).combine({"z": z, "a": a}, PERIOD)[:, 0], many[:, 0])
    weighted = estimator.combine(
        {"z": 2 * z[..., 0] - 3 * z[..., 1], "a": 2 * a[..., 0] - 3 * a[..., 1]}, PERIOD
    )
    np.testing.assert_allclose(weighted, 2 * many[..., 0] - 3 * many[..., 1], atol=1e-10)


def test_two_rows_are_a_record():
    z = np.array([0.1, 0.3])
    np.testing.assert_allclose(combined(z, np.zeros(2))[-1], 0.3)
    assert np.all(np.isfinite(combined(z, np.ones(2))))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Complementary(()), r"found hz=\(\), expected frequencies above zero"),
        (lambda: Complementary((1.0, 2.0, 3.0, 4.0)), "or one for each of x, y and z"),
        (lambda: Complementary(-1.0), "expected frequencies above zero"),
        (lambda: combined(np.zeros(9), np.zeros(9), hz=200.0), "200 Hz beside samples every 0.004 s"),
    ],
)  # fmt: skip
def test_what_is_no_frequency_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()
