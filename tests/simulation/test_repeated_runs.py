"""What is made for a simulation of a translated model serves the next one, and changes no answer."""

import gc
import weakref

import casadi as ca
import numpy as np
import pytest

from gantrytau import Samples, simulate, sin, translate
from gantrytau.simulation import simulate as simulate_module
from gantrytau_models import FourBar, Pendulum
from tests.simulation.sampled_models import Held, Slide


def unbuilt(monkeypatch):
    """From here on no equations of motion are made, and no integrators."""

    def refused(*arguments, **options):
        raise AssertionError("made again")

    monkeypatch.setattr(simulate_module, "all_coordinates", refused)
    monkeypatch.setattr(ca, "integrator", refused)


@pytest.mark.parametrize("model", [Held, FourBar, Pendulum, Slide], ids=lambda m: m.__name__)
def test_a_second_run_makes_nothing_and_says_the_same(monkeypatch, model):
    dae = translate(model(), events=True)
    first = simulate(dae, stop=0.3)
    fresh = simulate(translate(model(), events=True), stop=0.3)
    unbuilt(monkeypatch)
    second = simulate(dae, stop=0.3)
    for name in first.names:
        assert np.array_equal(first[name], second[name]), name
        assert np.array_equal(first[name], fresh[name]), name


def test_other_samples_and_another_end_make_nothing(monkeypatch):
    dae = translate(Held(), events=True)
    times = np.linspace(0, 1, 11)

    def run(dae, slope, stop):
        return simulate(
            dae, stop=stop, inputs={"control.wanted": Samples(times, slope * times, kind="linear")}
        )

    run(dae, 1.0, 1.0)
    fresh = run(translate(Held(), events=True), 3.0, 0.7)
    unbuilt(monkeypatch)
    again = run(dae, 3.0, 0.7)
    assert np.array_equal(again["slide.x"], fresh["slide.x"])


def test_other_functions_of_time_are_other_equations():
    dae = translate(Slide())
    names = ["x", "v"]
    for rate in (1.0, 2.0, 1.0):
        found = simulate(dae, stop=1.0, tolerance=1e-10, inputs={"f": lambda t, w=rate: sin(w * t)})
        fresh = simulate(Slide(), stop=1.0, tolerance=1e-10, inputs={"f": lambda t, w=rate: sin(w * t)})
        assert all(np.array_equal(found[n], fresh[n]) for n in names)
        speed = (1 - np.cos(rate)) / (2 * rate)  # of 2 kg after 1 s
        assert found.final("v") == pytest.approx(speed, abs=1e-8)  # a hundred times the tolerance


def test_what_was_made_goes_with_the_model_and_is_not_sent_along():
    dae = translate(Pendulum())
    simulate(dae, stop=0.1)
    assert dae.made
    assert "made" not in dae.__getstate__()
    gone = weakref.ref(dae)
    del dae
    gc.collect()
    assert gone() is None
