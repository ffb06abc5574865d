"""Linear models from inputs and outputs: exact without noise, good with it, and refused where nothing is told."""

import warnings

import numpy as np
import pytest
from scipy.linalg import block_diag

from gantrytau import ModelError, StateSpace, prbs
from gantrytau_optimica import identify_system
from gantrytau_optimica.identification import IdentificationError

PERIOD = 0.004
HERTZ, DAMPING = [7.4, 10.5, 11.5, 45.0], [0.03, 0.05, 0.05, 0.05]
T = PERIOD * np.arange(6000)
INPUTS = np.column_stack([prbs(10, 0.02, 1e-3, seed=k + 5).values(T).ravel() for k in range(3)])


def plant(hertz=HERTZ, damping=DAMPING):
    """Modes that three inputs drive and two outputs see."""
    random, order = np.random.default_rng(1), 2 * len(hertz)
    w = 2 * np.pi * np.array(hertz)
    A = block_diag(*[[[0, 1], [-(x**2), -2 * d * x]] for x, d in zip(w, damping, strict=True)])
    B = random.standard_normal((order, 3)) * np.tile([0, 1], len(w))[:, None]
    C = random.standard_normal((2, order)) * np.tile([1, 0], len(w)) * np.repeat(w, 2)
    return StateSpace(A, B, C, 0).discrete(PERIOD)


PLANT = plant()
OUTPUTS = PLANT.simulate(INPUTS)


def noisy(share, seed=2):
    return OUTPUTS + share * OUTPUTS.std(axis=0) * np.random.default_rng(seed).standard_normal(OUTPUTS.shape)


@pytest.mark.parametrize("scales", [(1.0, 1.0), (1e9, 1e-9), (1e-9, 1e9)])
def test_without_noise_it_is_exact(scales):
    """Poles, and the whole response, whatever the units and the constants are."""
    u, y = scales[0] * (INPUTS + 3.0), scales[1] * (OUTPUTS + np.array([5.0, -7.0]))
    found = identify_system(u, y, order=8, period=PERIOD)
    assert found.eigenfrequencies == pytest.approx(PLANT.eigenfrequencies, rel=1e-8)
    assert found.damping == pytest.approx(PLANT.damping, rel=1e-6)
    hertz = np.array([1.0, 7.4, 30.0])
    exact = scales[1] / scales[0] * PLANT.response(hertz)
    np.testing.assert_allclose(found.response(hertz), exact, atol=1e-7 * np.abs(exact).max())
    assert np.all(found.fit(u, y) > 100 - 1e-6)
    assert len(found.singular_values) == 8  # no direction more
    assert not found.findings


def test_a_direct_term_and_one_signal():
    system = StateSpace([[0.9]], [1.0], [0.5], [[2.0]], period=PERIOD)
    y = system.simulate(INPUTS[:, 0])
    found = identify_system(INPUTS[:, 0], y[:, 0], order=1, period=PERIOD, block_rows=5)
    assert found.poles == pytest.approx([0.9], abs=1e-9)
    assert found.D[0, 0] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_noise_leaves_modes_and_validation(share):
    half = len(T) // 2
    y = noisy(share)
    found = identify_system(INPUTS[:half], y[:half], order=8, period=PERIOD)
    assert np.unique(found.eigenfrequencies.round(6)) == pytest.approx(HERTZ, abs=0.3)
    assert np.all(found.fit(INPUTS[half:], OUTPUTS[half:]) > 100 - 60 * share - 1)  # of outputs without noise
    assert found.singular_values[7] > 1.5 * found.singular_values[8]  # the order shows
    assert found.singular_values[8] < found.noise < found.singular_values[7]
    figure = found.plot_singular_values()
    assert len(figure.axes[0].lines) == 3


def test_an_order_beyond_the_data_is_told():
    found = identify_system(INPUTS, noisy(0.1), order=12, period=PERIOD)
    assert [finding.kind for finding in found.findings] == ["order"]
    assert "share 8 directions more than noise would, of 12" in found.findings[0].message


def test_beside_nfoursid():
    """The same poles as another implementation by other weights, and as good a model."""
    import pandas

    nfoursid = pytest.importorskip("nfoursid.nfoursid")
    count, half = 1500, 750
    y = noisy(0.05)
    own = identify_system(INPUTS[:half], y[:half], order=8, period=PERIOD, block_rows=12)
    names = [f"u{k}" for k in range(3)], ["y0", "y1"]
    frame = pandas.DataFrame(np.hstack([INPUTS, y])[:half], columns=[*names[0], *names[1]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other = nfoursid.NFourSID(frame, output_columns=names[1], input_columns=names[0], num_block_rows=12)
        other.subspace_identification()
        found, _ = other.system_identification(rank=8)
    theirs = StateSpace(found.a, found.b, found.c, found.d, period=PERIOD)
    for hertz in HERTZ[:1]:  # the one that stands alone
        nearest = [np.abs(s.eigenfrequencies - hertz).min() for s in (own, theirs)]
        assert max(nearest) < 0.3
        assert nearest[0] < nearest[1] + 0.05
    rest = slice(half, count)
    exact = OUTPUTS[rest]
    left = exact - theirs.simulate(INPUTS[rest] - INPUTS[:half].mean(axis=0)) - OUTPUTS[:half].mean(axis=0)
    fit = 100 * (1 - np.linalg.norm(left, axis=0) / np.linalg.norm(exact - exact.mean(axis=0), axis=0))
    assert np.all(own.fit(INPUTS[rest], exact) > fit)


@pytest.mark.parametrize(
    ("u", "y", "keywords", "words"),
    [
        (INPUTS, OUTPUTS[:100], {}, "found 6000 samples of u and 100 of y"),
        (INPUTS[:200], OUTPUTS[:200], {}, "found 200 samples of 3 inputs and 2 outputs, expected 299 at least"),
        (INPUTS, OUTPUTS, dict(order=60), "order=60 with 2 outputs and block_rows=25, expected 48 at most; take .*=31"),
        (INPUTS, OUTPUTS, dict(order=9), "found data of order 8 without noise, expected 9 at least"),
        (INPUTS, np.where(np.arange(6000)[:, None] == 7, np.nan, OUTPUTS), {}, r"found y\[7, 0\] = nan"),
        (INPUTS[:, [0, 1, 1]], OUTPUTS, {}, "excite 100 of 150 directions.* an input repeats another"),
        (np.sin(50 * T), OUTPUTS, {}, "excite 2 of 50 directions.* few frequencies"),
        (INPUTS * [1, 1, 0], OUTPUTS, {}, r"found that u\[2\] never changes"),
    ],
)  # fmt: skip
def test_what_tells_no_system_is_refused(u, y, keywords, words):
    with pytest.raises((ModelError, IdentificationError), match=words):
        identify_system(u, y, **(dict(order=8, period=PERIOD) | keywords))


def test_a_system_that_runs_away_is_refused_and_one_that_drifts_is_told():
    u = INPUTS[:2000, 0]
    grown = StateSpace([[1.02]], [1.0], [1.0], period=PERIOD).simulate(u)
    with pytest.raises(IdentificationError, match=r"pole with \|z\| = 1.02, whose motion would grow"):
        identify_system(u, grown, order=1, period=PERIOD, block_rows=5)
    drifting = StateSpace([[1.0005]], [1.0], [1.0], period=PERIOD).simulate(u)
    found = identify_system(u, drifting, order=1, period=PERIOD, block_rows=5)
    assert [finding.kind for finding in found.findings] == ["unstable"]
    assert found.poles == pytest.approx([1.0005], abs=1e-8)


def test_other_data_are_refused_by_name():
    found = identify_system(INPUTS, OUTPUTS, order=8, period=PERIOD)
    with pytest.raises(ModelError, match=r"found u of shape \(6000, 2\), expected \(N, 3\), as it was"):
        found.fit(INPUTS[:, :2], OUTPUTS)
    constants = found.follow(INPUTS, OUTPUTS + 4.0) - found.follow(INPUTS, OUTPUTS)
    np.testing.assert_allclose(constants, 4.0, atol=1e-9)
