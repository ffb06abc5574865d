"""Frequency responses of measured motion, beside those of the systems that moved."""

import numpy as np
import pytest

from gantrytau import ModelError, StateSpace
from gantrytau_optimica.identification import measured_response

PERIOD = 0.004
SYSTEM = StateSpace(
    [[0, 0, 1, 0], [0, 0, 0, 1], [-1e4, 2e3, -20, 0], [2e3, -8e3, 0, -15]],
    [[0, 0], [0, 0], [1, 0], [0, 1]],
    [[1, 0, 0, 0], [0, 1, 0, 0]],
).discrete(PERIOD)  # resonances of 13 and 16 Hz


def motion(seed, noise=0.0, count=40_000):
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(count, 2))
    y = SYSTEM.simulate(u)
    return u, y + noise * np.std(y) * rng.normal(size=y.shape)


def test_the_response_is_that_of_the_system():
    found = measured_response(*motion(1), period=PERIOD, blocks=10)
    exact = SYSTEM.response(found.hertz)
    off = np.linalg.norm(found.response - exact) / np.linalg.norm(exact)
    assert off < 0.01  # blocks of 16 s beside resonances that ring for 0.2 s: leakage
    assert np.all(found.coherence.T[found.hertz < 30] > 0.99)
    assert np.isclose(found.hertz[0], 1 / 16)
    assert np.isclose(found.hertz[-1], 125.0)


def test_deviations_are_those_of_noise():
    found = [measured_response(*motion(seed, noise=0.5), period=PERIOD, blocks=40) for seed in range(8)]
    exact = SYSTEM.response(found[0].hertz)
    ratios = [np.abs(one.response - exact) ** 2 / one.deviation**2 for one in found]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    explained = np.mean([one.coherence[:, one.hertz > 60] for one in found])
    assert explained < 0.1  # beyond resonances only noise is left; of 2 inputs and 80 blocks 0.03 are chance


def test_one_of_each_and_an_input_without_power():
    t = PERIOD * np.arange(4000)
    u = np.sin(2 * np.pi * 5 * t)  # 20 periods in each block
    found = measured_response(u, 3 * u, period=PERIOD, blocks=4)
    heard = np.isfinite(found.response[0, 0])
    assert np.allclose(found.response[0, 0][heard], 3)
    assert np.allclose(found.hertz[heard], 5, atol=0.3)  # and its neighbours under the window
    assert "1 outputs to 1 inputs" in repr(found)


def test_it_stands_beside_the_system():
    found = measured_response(*motion(2, count=8000), period=PERIOD)
    gain = SYSTEM.plot_bode(beside={"measured": found}).axes[0]
    (x, line), (hertz, points) = (np.asarray(one.get_data(), dtype=float) for one in gain.lines[:2])
    low = hertz < 10
    assert np.allclose(points[low], np.interp(hertz, x, line)[low], rtol=0.3)


X = np.random.default_rng(0).normal(size=(400, 2))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: measured_response(X, X[:300], period=0.1), "400 samples of u and 300 of y, expected as"),
        (lambda: measured_response(X[:99], X[:99], period=0.1), "99 samples of u and 99 of y"),
        (lambda: measured_response(X, X, period=0.1, blocks=3), "blocks=3 for 2 inputs, expected 4 at least"),
        (lambda: measured_response(0 * X, X, period=0.1), r"found that u\[0\] never changes"),
    ],
)
def test_what_is_no_pair_of_samples(wrong, words):
    with pytest.raises(ModelError, match=words):
        wrong()
