"""Frequencies of rings whose frequencies are known."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import resonances

PERIOD = 0.004
T = PERIOD * np.arange(600)


def ring(hertz, damping, size=1.0, phase=0.0):
    w = 2 * np.pi * hertz
    return size * np.exp(-damping * w * T) * np.sin(w * np.sqrt(1 - damping**2) * T + phase)


@pytest.mark.parametrize("hertz", [3.0, 7.4, 11.5, 60.0, 90.0])
@pytest.mark.parametrize("damping", [0.01, 0.04])
@pytest.mark.parametrize("phase", [0.0, 0.7, np.pi / 2])
def test_one_ring(hertz, damping, phase):
    found = resonances(ring(hertz, damping, 1e-6, phase) + 3.0, PERIOD, share=0.5)
    # the peak is beside the pole by its damping
    assert found == pytest.approx([hertz], rel=3 * damping**2 + 0.006)


def test_the_strongest_comes_first_and_later_samples_show_what_lasts():
    both = ring(11.4, 0.05, 3.0) + ring(7.4, 0.01, 1.0)
    lasting = resonances(both[150:], PERIOD, share=0.3)
    assert lasting[0] == pytest.approx(7.4, abs=0.1)
    early = resonances(both[:150], PERIOD, band=(9.0, 20.0))
    assert early[0] == pytest.approx(11.4, abs=0.4)
    columns = np.column_stack([ring(11.4, 0.01, 3.0), ring(7.4, 0.01, 1.0)])
    assert resonances(columns, PERIOD, share=0.2) == pytest.approx([11.4, 7.4], abs=0.05)


def test_what_stands_rings_at_no_frequency():
    assert resonances(np.full(100, 0.3), PERIOD).size == 0


def test_white_noise_rings_at_no_frequency_and_a_ring_in_it_does():
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(size=(600, 1 + seed % 2))
        assert resonances(noise, PERIOD).size == 0
        found = resonances(noise[:, 0] + ring(11.5, 0.01, 3.0), PERIOD)
        assert found[0] == pytest.approx(11.5, abs=0.3)
        assert np.abs(found - 11.5).max() < 2  # beside it what noise makes of its flanks


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: resonances(T[:5], PERIOD), r"shape \(5,\), expected 16 samples at least"),
        (lambda: resonances(np.full(100, np.nan), PERIOD), "all of them finite"),
        (lambda: resonances(T, PERIOD, band=(9.0, 3.0)), r"band=\(9.0, 3.0\)"),
        (lambda: resonances(T, PERIOD, band=(200.0, 300.0)), "one that begins below 125 Hz"),
    ],
)
def test_what_is_no_motion_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()
