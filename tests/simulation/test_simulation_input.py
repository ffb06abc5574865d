"""What wrong inputs, parameters and policies of a simulation get."""

import math
import os
import signal
import subprocess
import threading
import time

import numpy as np
import pytest

import gantrytau.simulation.integration
from gantrytau import Input, Model, ModelError, Real, SolveError, der, simulate, sin
from gantrytau_models import GantryTau, prototypes
from tests.simulation.test_simulation import Circuit, Oscillator


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({"g": 1.0}, "has no variable or parameter 'g'"),
        ({"x": 1.0}, "x is not an input of Oscillator (inputs: f)"),
        ({"f": [1.0, 2.0]}, "input f: found 2 values, expected 1"),
        ({"f": math.nan}, "expected finite numbers"),
        ({"f": "strong"}, "input f: found 'strong', expected a number and its unit"),
        ({"f": object()}, "expected a number, a function of time, Samples(times"),
        ({"f": ([0.0, 1.0], [0.0, math.nan])}, "input f: Samples: row 1 is not finite, expected numbers"),
        ({"f": ([0.0, 2.0, 1.0], [0.0, 1.0, 1.0])}, "input f: Samples: the time falls from 2 s in row 1 to"),
        ({"f": ([0.0], [0.0])}, "samples cover 0 to 0 s, expected 0 to 1 s; add samples"),
        ({"f": ([0.0, 0.5], [0.0, 1.0])}, "samples cover 0 to 0.5 s, expected 0 to 1 s"),
        ({"f": ([0.0, 1.0], [[0.0, 1.0], [1.0, 2.0]])}, "input f: found 2 columns, expected 1"),
        ({"f": math.sin}, "input f: the function of time does not work on a symbol"),
        ({"f": lambda t: 1.0 if t > 1 else 2.0}, "write it with gantrytau.sin, exp, if_else"),
        ({"f": lambda t: [t, t]}, "input f: found 2 values, expected 1"),
        ({"f": lambda: 1.0}, "input f: the function of time"),
        (3.0, "found inputs=3.0, expected"),
    ],
)
def test_wrong_inputs(inputs, words):
    with pytest.raises(ModelError) as caught:
        simulate(Oscillator(), stop=1.0, inputs=inputs)
    assert words in str(caught.value)


def test_an_input_without_a_value():
    with pytest.raises(ModelError, match=r"input source has no value; give inputs=\{'source': ...\}"):
        simulate(Circuit(), stop=1.0)


def test_samples_cannot_be_differentiated():
    class Differentiator(Model):
        u = Input(unit="m", description="position")
        v = Real(unit="m/s", description="its rate")

        def equations(self):
            yield self.v == der(self.u)

    found = simulate(Differentiator(), stop=1.0, inputs={"u": lambda t: t**2})
    np.testing.assert_allclose(found["v"], 2 * found.time, atol=1e-12)
    with pytest.raises(ModelError, match="input u is differentiated 1 times by the model"):
        simulate(Differentiator(), stop=1.0, inputs={"u": ([0.0, 1.0], [0.0, 1.0])})


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (dict(start=2.0, stop=1.0), "found stop=1.0, expected a number above 2 in s"),
        (dict(stop=1.0, tolerance=0.0), "found tolerance=0.0"),
        (dict(stop=1.0, points=1), "found points=1, expected a whole number of at least 2"),
        (dict(stop=1.0, parameters={"k": 1.0}), "has no parameter 'k'"),
        (dict(stop=1.0, parameters={"c": [1.0, 2.0]}), "c: found 2 values, expected 1"),
        (dict(stop=1.0, parameters={"c": math.inf}), "c: found inf, expected finite numbers"),
        (dict(stop=1.0, parameters={"c": "stiff"}), "c: found 'stiff', expected"),
        (dict(stop=1.0, outputs="x"), "write ['x']"),
    ],
)
def test_wrong_policy(keywords, words):
    with pytest.raises(ModelError) as caught:
        simulate(Oscillator(), **keywords)
    assert words in str(caught.value)


def test_ctrl_c_stops_a_simulation_and_keeps_what_was_computed(monkeypatch):
    class Begun(gantrytau.simulation.integration.Progress):
        def __enter__(self):
            threading.Timer(0.2, signal.raise_signal, [signal.SIGINT]).start()
            return super().__enter__()

    monkeypatch.setattr(gantrytau.simulation.integration, "Progress", Begun)
    with pytest.raises(SolveError, match=r"simulation interrupted at t = ") as raised:
        simulate(
            GantryTau(prototypes.L1),
            stop=3000.0,
            inputs={"carts[0].f": lambda t: 300 * sin(20 * t)},
            points=20001,
        )
    assert 0 < raised.value.time < 3000.0
    assert np.isfinite(raised.value.result["tool.r"]).all()


@pytest.mark.parametrize("points", [3, 501])  # one interval alone would take half a minute
def test_ctrl_c_is_not_swallowed_by_an_integrator_at_work(points):
    class Fast(Model):
        x = Real(start=0.0, fixed=True)
        v = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.x) == 1e6 * self.v
            yield der(self.v) == -1e6 * self.x

    begin = time.perf_counter()
    pressed = subprocess.Popen(["sh", "-c", f"sleep 1; kill -INT {os.getpid()}"])
    with pytest.raises(SolveError, match="Fast: simulation interrupted at t = "):
        simulate(Fast(), stop=1.0, points=points)
    assert time.perf_counter() - begin < 4.0
    assert pressed.wait() == 0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
