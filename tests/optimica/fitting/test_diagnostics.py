"""What a fit leaves: each mistake is told by its kind, and sound data are told nothing."""

from typing import Any

import numpy as np
import pytest

from gantrytau_optimica.fitting.diagnostics import ResidualSeries, diagnose, repeated
from gantrytau_optimica.fitting.facts import Fact

N = 400
t = 0.01 * np.arange(N)
q, v = np.sin(3 * t), 3 * np.cos(3 * t)
a = -9 * q
X = np.column_stack([a, v])


def fitted(y, **more: Any):
    """Least squares of y on a and v, in metres, with told noise of 1 if nothing else is said."""
    left = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    more = {"noise": 1.0} | more
    return ResidualSeries("f", left, y, jacobian=X, **more)


def noise(seed):
    return np.random.default_rng(seed).normal(size=N)


SIGNALS = {"q of x": q**3, "1": np.ones(N), "time": t, "sign v of x": np.sign(v)}
FORCE = 3 * a + 5 * v


@pytest.mark.parametrize("seed", range(20))
def test_sound_data_are_told_nothing(seed):
    groups = {"run": np.arange(N) // 100, "pose": np.arange(N) // 8}
    found = diagnose([fitted(FORCE + noise(seed), signals=SIGNALS, groups=groups)])
    assert found.findings == ()
    assert found.ratio["f"] == pytest.approx(1, abs=4 / np.sqrt(2 * N))  # four deviations of that of a sample


def test_noise_that_lasts_is_no_trend():
    """Neighbours correlate by 0.9, which is told; chance alone lets such noise resemble slow signals."""
    from scipy.signal import lfilter

    for seed in range(10):
        coloured = lfilter([np.sqrt(1 - 0.81)], [1, -0.9], noise(seed))
        found = diagnose([fitted(FORCE + coloured, signals=SIGNALS, noise=None)])
        assert [f.kind for f in found.facts] == ["not white"]
        assert found.correlation["f"] == pytest.approx(0.9, abs=0.1)


RUNS = np.arange(N) // 40
MISTAKES = {  # what is done -> kind, the force and what is said besides
    "strays": ("outliers", FORCE + noise(1) + 40.0 * (np.arange(N) % 57 == 3), {"noise": None}),
    "spring": ("trend", FORCE + noise(1) + 8 * q**3, {"signals": SIGNALS, "noise": None}),
    "drift": ("drift", FORCE + noise(1) + t, {"signals": SIGNALS, "noise": None}),
    "late": ("delay", FORCE - 0.05 * 15 * np.cos(9 * t) + noise(1), {"signals": {"rate": 15 * np.cos(9 * t)}}),
    "noise told too small": ("noise larger", FORCE + noise(1), {"noise": 0.5}),
    "noise told too large": ("noise smaller", FORCE + noise(1), {"noise": 100.0}),
    "another signal": ("explains nothing", 20 * noise(1), {"noise": None}),
    "one bad run": ("group", FORCE + noise(1) * (1 + 4 * (RUNS == 6)), {"noise": None, "groups": {"run": RUNS}}),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_by_its_kind(name):
    kind, force, more = MISTAKES[name]
    found = diagnose([fitted(force, **more)])
    assert found.facts[0].kind == found.findings[0].kind == kind
    if name == "strays":
        assert found.facts[0].rows.tolist() == np.flatnonzero(np.arange(N) % 57 == 3).tolist()
    if name == "late":
        assert found.facts[0].size == pytest.approx(0.05, abs=0.01)
    if name == "spring":
        assert found.facts[0].size == pytest.approx(8, abs=1)
        assert "follows q of x" in found.findings[0].message
        assert "a spring" in found.findings[0].message
    if name == "one bad run":
        assert found.facts[0].cause == "run 6"


def test_rows_that_do_not_count_and_runs_apart():
    """Strays are told by their numbers in the data, also where rows before them are not used."""
    series = fitted(FORCE + noise(2) + 60.0 * (np.arange(N) == 300), noise=None)
    left = series.left.copy()
    left[:100] = np.nan
    halves = [
        ResidualSeries("f", left[part], jacobian=X[part], rows=np.arange(N)[part])
        for part in (slice(0, 200), slice(200, N))
    ]
    assert [f.rows.tolist() for f in diagnose(halves).facts] == [[300]]


def test_filtered_noise_is_white_within_its_band():
    from scipy.signal import butter, sosfiltfilt

    smooth = sosfiltfilt(butter(4, 0.125, output="sos"), noise(3))
    assert [f.kind for f in diagnose([ResidualSeries("f", smooth)]).facts] == ["not white"]
    assert diagnose([ResidualSeries("f", smooth, band=0.125)]).facts == ()


def test_computed_data_leave_no_noise():
    assert diagnose([fitted(FORCE + 1e-9 * np.sin(t), noise=None, signals=SIGNALS)]).facts == ()


def test_the_same_data_twice():
    one, other = np.column_stack([q, noise(1)]), np.column_stack([q, noise(2)])
    assert repeated({"log 0": one, "log 1": other}) == []
    (fact,) = repeated({"log 0": one, "log 1": other, "log 2": one[50:]})
    assert (fact.kind, fact.cause, fact.quantity) == ("duplicates", "log 0", "log 2")
    assert "log 0 and log 2 hold the same values" in fact.finding.message


def test_facts_have_words():
    pull = Fact("limit", "m", held=0.0, wanted=-3.0, deviations=40.0)
    assert "m stands at its limit 0, data want -3, 40 deviations beyond" in pull.finding.message
    known = diagnose([fitted(FORCE + noise(1))], known=[pull], remedies={"limit": "look at the sign of f"})
    assert known.findings[0].message.endswith("look at the sign of f")


def test_a_signal_that_is_zero_throughout_is_explained_by_nothing():
    found = diagnose([ResidualSeries("f", noise(1), measured=np.zeros(N), jacobian=X)])
    assert [(f.kind, f.share) for f in found.facts] == [("explains nothing", 0.0)]
