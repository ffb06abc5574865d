"""Steps, sweeps and sums of sines against scipy and their definitions."""

import casadi as ca
import numpy as np
import pytest
from scipy.signal import chirp as sweep

from gantrytau import ModelError, chirp, multisine, steps


def test_steps_are_zero_before_the_first_and_hold_the_last():
    signal = steps([0.2, 0.5], [1.0, -3.0])
    t = np.array([0.0, 0.1999, 0.2, 0.4999, 0.5, 7.0])
    np.testing.assert_array_equal(signal.values(t), [0, 0, 1, 1, -3, -3])
    later = signal.samples(0.3, 1.0)
    np.testing.assert_array_equal(later.times, [0.2, 0.5])
    np.testing.assert_array_equal(later.values[:, 0], [1.0, -3.0])
    assert repr(signal) == "steps([1.0] from 0.2 s, [-3.0] from 0.5 s)"


def test_steps_of_matrices_keep_rows_and_columns():
    matrices = np.arange(12.0).reshape(2, 2, 3)
    found = steps([0.5, 1.0], matrices).values([0.0, 0.7, 1.0])
    np.testing.assert_array_equal(found, [np.zeros((2, 3)), *matrices])


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
@pytest.mark.parametrize(("low", "high"), [(1.0, 20.0), (30.0, 2.0), (5.0, 5.0)])
def test_a_sweep_is_that_of_scipy(kind, low, high):
    t = np.linspace(0.0, 4.0, 1001)
    expected = 0.7 * sweep(t, low, 4.0, high, method=kind, phi=-90)
    np.testing.assert_allclose(chirp(low, high, 4.0, 0.7, kind).values(t), expected, atol=1e-11)


@pytest.mark.parametrize("kind", ["linear", "logarithmic"])
def test_behind_its_end_a_sweep_goes_on_with_the_last_frequency(kind):
    signal = chirp(1.0, 9.0, 2.0, kind=kind)
    t = ca.SX.sym("t")
    rate = ca.Function("rate", [t], [ca.jacobian(signal(t), t)])
    small = 1e-9
    # amplitude (2 pi 9)^2 and more of it
    assert abs(float(rate(2.0 - small)) - float(rate(2.0 + small))) < 1e4 * small
    np.testing.assert_allclose(
        signal.values([2.0 + 0.03, 2.5 + 0.03]), signal.values([3.0 + 0.03, 4.5 + 0.03]), atol=1e-12
    )


def test_a_multisine_has_the_lines_that_it_was_given():
    hertz, sizes = np.array([1.0, 2.0, 5.0]), np.array([0.5, 1.0, 0.2])
    signal = multisine(hertz, sizes)
    t = np.arange(64) / 64
    spectrum = np.fft.rfft(signal.values(t)) / 32
    expected = np.zeros(33)
    expected[[1, 2, 5]] = sizes
    np.testing.assert_allclose(np.abs(spectrum), expected, atol=1e-14)
    np.testing.assert_allclose(
        np.exp(1j * np.angle(spectrum[[1, 2, 5]])), np.exp(1j * signal.angles), atol=1e-12
    )


@pytest.mark.parametrize("count", [8, 15, 64])
def test_schroeder_phases_keep_the_peak_low(count):
    hertz = np.arange(1.0, count + 1)
    t = np.linspace(0.0, 1.0, 64 * count, endpoint=False)

    def crest(phases) -> float:
        course = multisine(hertz, 1.0, phases=phases).values(t)
        return float(np.abs(course).max() / np.sqrt(np.mean(course**2)))

    assert crest("schroeder") < 1.85  # about 1.7 for flat spectra, Schroeder (1970)
    assert crest(np.zeros(count)) == pytest.approx(np.sqrt(2 * count), rel=1e-12)  # all peaks meet
    flat = multisine(hertz).angles
    k = np.arange(1, count + 1)
    np.testing.assert_allclose(flat, -np.pi * k * (k - 1) / count, atol=1e-9)


def test_random_phases_are_those_of_the_seed():
    first, second, again = (multisine([1.0, 2.0, 3.0], phases="random", seed=k) for k in (1, 2, 1))
    assert first == again
    np.testing.assert_array_equal(first.angles, again.angles)
    assert not np.any(first.angles == second.angles)


@pytest.mark.parametrize("signal", [chirp(1.0, 20.0, 2.0, 0.7), multisine([3.0, 17.0], [0.2, 0.5])])
def test_samples_of_smooth_signals_are_near_them(signal):
    samples = signal.samples(0.5, 2.0)
    assert (samples.times[0], samples.times[-1], samples.kind) == (0.5, 2.0, "linear")
    t = np.linspace(0.5, 2.0, 40_001)
    # straight lines: (2 pi / 256)^2 / 8 of the amplitude
    assert np.abs(samples.at(t, 0) - signal.values(t)).max() < 0.7e-4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: chirp(0.0, 1.0, 1.0), "found low=0.0"),
        (lambda: multisine([1.0, 1.0]), "expected different frequencies"),
        (lambda: multisine([1.0, -1.0]), "found frequencies[1] = -1.0"),
        (lambda: multisine([1.0, 2.0, 3.0], [1.0, 2.0]), "found 2 amplitudes, expected one, or 3"),
        (lambda: multisine([1.0], phases="flat"), "found phases='flat', expected 'schroeder' or 'random'"),
        (lambda: multisine([1.0], phases=[1.0, 2.0]), "found phases of 2"),
        (lambda: multisine([1.0], phases="random").values(0.0), "has no seed; give it one"),
        (lambda: steps([1.0, 0.5], [1.0, 2.0]), "the time falls from 1 s in row 0 to 0.5 s"),
        (lambda: chirp(1e6, 1e6, 1.0).samples(0.0, 1.0), "2.56e+08 of its values, expected at most 1e+07"),
    ],
)
def test_what_is_no_signal(make, words):
    with pytest.raises(ModelError) as caught:
        make()
    assert words in str(caught.value)
