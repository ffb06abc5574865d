"""What estimates leave: wrong models, strays, noise that is told wrongly, and deviations of noise that lasts."""

import numpy as np
import pytest
from scipy.signal import lfilter

from gantrytau import Model, Parameter, Real, Samples, der
from gantrytau_optimica import Experiment, Free, estimate


class Decay(Model):
    """x' = -k x."""

    k = Parameter(1.0)
    x = Real(start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == -self.k * self.x


class Swing(Model):
    """A mass on a spring with a damper."""

    c, k = Parameter(0.3), Parameter(4.0)
    x, v = Real(start=1.0, fixed=True), Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == -self.c * self.v - self.k * self.x


T, LONG = np.linspace(0.05, 5, 80), np.linspace(0, 8, 161)
TRUE = np.exp(-1.3 * T)


def noise(seed, count=80):
    return np.random.default_rng(seed).normal(size=count)


def swing(c=0.3, k=4.0, t=LONG):
    w = np.sqrt(k - c * c / 4)
    return np.exp(-c * t / 2) * (np.cos(w * t) + c / (2 * w) * np.sin(w * t))


def kinds(fit):
    return [f.kind for f in fit.diagnostics.facts]


def decay(y, deviation=None, **policy):
    return estimate(Decay, {"k": Free(1.0)}, Experiment({"x": Samples(T, y, deviation=deviation)}), **policy)


@pytest.mark.parametrize(
    ("kind", "y", "deviation"),
    [
        (None, TRUE + 0.01 * noise(0), None),
        (None, TRUE + 0.01 * noise(1), 0.01),
        ("noise larger", TRUE + 0.01 * noise(0), 1e-3),
        ("noise smaller", TRUE + 0.01 * noise(0), 1.0),
        ("outliers", TRUE + 0.01 * noise(0) + 0.4 * (np.arange(80) % 11 == 0), None),
        ("not white", TRUE + 0.01 * noise(0) + 0.03 * np.sin(3 * T), None),
        ("trend", TRUE + 0.01 * noise(0) + 0.05, None),
        ("drift", TRUE + 0.01 * noise(0) + 0.02 * (T - 1) * (T > 1), None),
    ],
)
def test_each_mistake_is_told_and_sound_data_are_not(kind, y, deviation):
    fit = decay(y, deviation)
    assert kinds(fit)[:1] == [kind][: kind is not None]
    assert len(fit.warnings) == len(kinds(fit))
    if kind == "outliers":
        assert "rows 0, 11, 22" in fit.warnings[0]
        assert "loss='robust'" in fit.report()
        assert kinds(decay(y, loss="robust")) == []


def test_an_output_that_comes_late_is_told():
    y = swing(t=LONG - 0.05) * (LONG >= 0.05) + (LONG < 0.05)
    known = {"c": Free(0.3, min=0.29, max=0.31)}  # with k free, too, a delay is a frequency and a phase
    fit = estimate(Swing, known, Experiment({"x": (LONG, y + 0.002 * noise(0, 161))}))
    assert fit.diagnostics.facts[0].kind == "delay"
    assert fit.diagnostics.facts[0].size == pytest.approx(0.05, rel=0.2)


@pytest.mark.nightly
@pytest.mark.parametrize("colour", ["white", "told", "lasting", "slow sensor"])
def test_told_deviations_are_those_counted(colour):
    """Over 40 seeds; noise of an autoregression of 0.9, and of values that a sensor repeats three times."""
    found = []
    for seed in range(40):
        e = noise(seed, 361)[200:]
        e = lfilter([np.sqrt(0.19)], [1, -0.9], noise(seed, 361))[200:] if colour == "lasting" else e
        e = e[::3].repeat(3)[:161] if colour == "slow sensor" else e
        data = Samples(LONG, swing() + 0.01 * e, deviation=0.01 if colour == "told" else None)
        found.append(estimate(Swing, {"c": Free(0.3), "k": Free(4.0)}, Experiment({"x": data}), elements=20))
    told = np.sqrt(np.mean([[fit.deviations[n] ** 2 for n in ("c", "k")] for fit in found], axis=0))
    off = np.array([[fit.parameters[n] - x for n, x in (("c", 0.3), ("k", 4.0))] for fit in found])
    counted = np.sqrt(np.mean(off**2, axis=0))
    assert np.all((told / counted > 0.8) & (told / counted < 1.25))
    assert sum("not white" in kinds(fit) for fit in found) == pytest.approx(
        0 if colour in ("white", "told") else 38, abs=4
    )
