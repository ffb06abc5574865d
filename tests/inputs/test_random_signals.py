"""White noise and binary sequences: their statistics, and that they are the same numbers for a seed."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from gantrytau import InputSignal, ModelError, Samples, prbs, white_noise
from gantrytau.inputs.random_signals import LAGS

PERIOD = 0.01


def test_white_noise_has_the_moments_of_a_normal_distribution():
    n = 100_000
    noise = white_noise(2.0, PERIOD, seed=1).samples(0.0, (n - 1) * PERIOD).values[:, 0]
    assert noise.size == n
    assert abs(noise.mean()) < 4 * 2.0 / np.sqrt(n)  # four standard errors
    assert abs(noise.std() / 2.0 - 1) < 4 / np.sqrt(2 * n)
    assert stats.kstest(noise / 2.0, "norm").pvalue > 1e-3


def test_white_noise_is_not_correlated_with_itself_later():
    n = 100_000
    noise = white_noise(1.0, PERIOD, seed=2).samples(0.0, (n - 1) * PERIOD).values[:, 0]
    correlation = [noise[k:] @ noise[: n - k] / n for k in range(1, 40)]
    assert np.abs(correlation).max() < 4.5 / np.sqrt(n)


def test_the_density_of_held_noise_is_that_of_the_docstring():
    from scipy.signal import welch

    std, parts = 3.0, 8  # times within each hold
    t = (np.arange(parts * 200_000) + 0.5) * PERIOD / parts
    course = white_noise(std, PERIOD, seed=3).values(t)
    hertz, density = welch(course, fs=parts / PERIOD, nperseg=parts * 256, window="hann")
    expected = 2 * std**2 * PERIOD * np.sinc(hertz * PERIOD) ** 2
    low = (hertz > 1) & (hertz < 60)
    # 200,000 values in segments of 256 with halves in common: about 1000 averages, 3 % each; eight points alias a little
    assert np.abs(density[low] / expected[low] - 1).max() < 0.2
    assert abs(np.mean(density[low] / expected[low]) - 1) < 0.02


@pytest.mark.parametrize("signal", [white_noise([1.0, 2.0], PERIOD, seed=4), prbs(9, PERIOD, 2.0, seed=4)])
def test_the_first_numbers_do_not_depend_on_the_length(signal):
    short, long = signal.samples(0.0, 0.5), signal.samples(0.0, 30.0)
    np.testing.assert_array_equal(short.values, long.values[: short.times.size])
    later = signal.samples(0.105, 0.5)
    np.testing.assert_array_equal(later.values, short.values[10:])
    assert later.times[0] == 10 * PERIOD


def test_seeds_and_elements_have_streams_of_their_own():
    first, second = (white_noise(1.0, PERIOD, seed=k).samples(0.0, 100.0).values[:, 0] for k in (1, 2))
    both = white_noise([1.0, 1.0], PERIOD, seed=1).samples(0.0, 100.0).values
    for a, b in ((first, second), both.T):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4 / np.sqrt(a.size)
    np.testing.assert_array_equal(first, white_noise(1.0, PERIOD, seed=1).samples(0.0, 100.0).values[:, 0])


def test_a_std_for_each_element_of_a_matrix():
    std = np.array([[1.0, 2.0], [0.0, 4.0], [5.0, 1e9]])
    samples = white_noise(std, PERIOD, seed=1).samples(0.0, 200.0)
    assert samples.shape == (3, 2)
    found = samples.values.std(axis=0).reshape(3, 2, order="F")
    np.testing.assert_allclose(found, std, rtol=4 / np.sqrt(2 * samples.times.size))
    at = white_noise(std, PERIOD, seed=1).values([0.0, 0.015])
    np.testing.assert_array_equal(at[1], samples.values[1].reshape(3, 2, order="F"))


@pytest.mark.parametrize("bits", [2, 3, 7, 8, 12, 16])
def test_a_binary_sequence_is_of_maximal_length(bits):
    n, amplitude = 2**bits - 1, 3.0
    signal = prbs(bits, PERIOD, amplitude, seed=5)
    values = signal.samples(0.0, (2 * n - 1) * PERIOD).values[:, 0]
    assert signal.length == n
    assert values.size == 2 * n
    assert set(values) == {-amplitude, amplitude}
    np.testing.assert_array_equal(values[:n], values[n:])
    one = values[:n]
    assert one.sum() == amplitude
    # autocorrelation of a maximal-length sequence: n at no shift, -1 at all others; sums of whole numbers, by Fourier's
    spectrum = np.fft.rfft(one / amplitude)
    found = np.round(np.fft.irfft(np.abs(spectrum) ** 2, n), 6)
    assert found[0] == n
    assert set(found[1:]) == {-1.0}


def test_seeds_shift_one_sequence():
    n = 2**6 - 1
    first, second = (prbs(6, PERIOD, seed=k).samples(0.0, (n - 1) * PERIOD).values[:, 0] for k in (1, 2))
    shifts = [np.array_equal(np.roll(first, k), second) for k in range(n)]
    assert sum(shifts) == 1
    assert not shifts[0]


def order_is_maximal(bits: int, lags: tuple[int, ...]) -> bool:
    """Whether x has the order 2^bits - 1 modulo the polynomial of these lags over two numbers."""
    polynomial = sum(1 << (bits - lag) for lag in lags) | 1 << bits

    def product(a: int, b: int) -> int:
        found = 0
        while b:
            if b & 1:
                found ^= a
            a, b = a << 1, b >> 1
            if a >> bits & 1:
                a ^= polynomial
        return found

    def power(n: int) -> int:
        found, base = 1, 2
        while n:
            found, base, n = product(found, base) if n & 1 else found, product(base, base), n >> 1
        return found

    n = left = 2**bits - 1
    factors, k = set(), 2
    while k * k <= left:
        while left % k == 0:
            factors.add(k)
            left //= k
        k += 1
    factors |= {left} - {1, n}
    return power(n) == 1 and all(power(n // factor) != 1 for factor in factors)


@pytest.mark.parametrize("bits", LAGS)
def test_all_registers_run_through_all_states(bits):
    assert order_is_maximal(bits, LAGS[bits])
    assert not order_is_maximal(8, (8, 4))  # the test can fail


def test_a_register_of_31_bits_gives_its_first_values_at_once():
    values = prbs(31, 1e-3, seed=1).samples(0.0, 100.0).values[:, 0] > 0
    lags = LAGS[31]
    np.testing.assert_array_equal(
        values[40:], values[40 - lags[0] : -lags[0]] ^ values[40 - lags[1] : -lags[1]]
    )
    assert abs(values.mean() - 0.5) < 4 / (2 * np.sqrt(values.size))


@pytest.mark.parametrize("period", [0.1, 1e-6, 1 / 3, 7e9])
def test_values_are_held_from_their_instants_on(period):
    signal = white_noise(1.0, period, seed=1)
    k = np.arange(50)
    held = signal.samples(0.0, 49 * period).values[:, 0]
    assert held.size == 50
    np.testing.assert_array_equal(signal.values(k * period), held)
    np.testing.assert_array_equal(signal.values((k + 0.999) * period), held)
    np.testing.assert_array_equal(signal.values(np.cumsum(np.full(49, period))), held[1:])  # sums of rounding


def test_records_tell_themselves_and_compare():
    signal: Any = white_noise(0.1, 0.001, seed=3)
    assert repr(signal) == "white_noise(std=0.1, period=0.001, seed=3)"
    assert repr(prbs(5, 0.1, 2.0, 1)) == "prbs(bits=5, hold=0.1, amplitude=2, seed=1)"
    assert signal == white_noise(0.1, 0.001, seed=3) != white_noise(0.1, 0.001, seed=4)
    assert len({signal, white_noise(0.1, 0.001, seed=3), white_noise([0.1, 0.2], 0.001)}) == 2
    with pytest.raises(AttributeError):
        signal.std = 3.0
    assert isinstance(signal, InputSignal)
    assert isinstance(signal.samples(0.0, 1.0), Samples)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: white_noise(-1.0, 0.1), "found std = -1.0"),
        (lambda: white_noise(1.0, 0.0), "found period=0.0"),
        (lambda: white_noise(1.0, 0.1, seed=-1), "found seed=-1"),
        (lambda: white_noise(1.0, 0.1).samples(0.0, 1.0), "seed=None) has no seed; give it one, as seed=1"),
        (lambda: white_noise(1.0, 0.1, 1).samples(-1.0, 1.0), "begins at t = 0, found a span from -1 s on"),
        (lambda: white_noise(1.0, 0.1, 1).samples(1.0, 1.0), "expected start < stop"),
        (lambda: white_noise(1.0, 0.1, 1).values([0.0, -0.1]), "found t[1] = -0.1"),
        (lambda: white_noise(1.0, 1e-9, 1).samples(0.0, 1.0), "1e+09 of its values, expected at most 1e+07"),
        (lambda: prbs(32, 0.1), "prbs: found bits=32"),
        (lambda: prbs(5, 0.1, 0.0), "found amplitude=0.0"),
        (lambda: prbs(5, 0.1).values(0.0), "has no seed"),
    ],
)
def test_what_is_no_random_signal(make, words):
    with pytest.raises(ModelError) as caught:
        make()
    assert words in str(caught.value)
