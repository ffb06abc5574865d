"""Co-simulations that cannot be: connections, settings, signals and files that are refused."""

import numpy as np
import pytest

from gantrytau import GantryTauError, ModelError
from gantrytau_fmu.systems.cosimulate import cosimulate
from tests.fmu.systems.coupled_masses import WIRES

pytestmark = pytest.mark.usefixtures("nothing_stays_behind")


@pytest.mark.parametrize(
    ("wires", "words"),
    [
        ([("a.y", "b.u")], r"connection a\.y -> b\.u: a has no variable 'y'; its outputs are x, v\."),
        ([("a.x", "c.u")], r"connection .*: 'c\.u' begins with no component of the system"),
        ([("b.u", "a.x")], r"found input -> output, .*turn them round"),
        ([("a.x", "b.x")], r"found output -> output, expected an output and the input it drives"),
        ([("a.x", "b.u"), ("b.x", "b.u")], r"b\.u is driven by a\.x and by b\.x, expected one of them"),
        (["a.x"], r"connection 'a\.x': expected an output and an input"),
    ],
)
def test_wrong_connections_are_refused(halves, wires, words):
    with pytest.raises(ModelError, match=words):
        cosimulate(halves, wires, stop=1.0, step=0.1)


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (dict(stop=-1.0), r"found stop=-1, expected a time after the beginning at 0 s; choose"),
        (
            dict(step=0.0),
            r"found step=0, expected more than 0 and at most the 1 s that are simulated; choose",
        ),
        (dict(step=1.5), r"found step=1\.5, expected more than 0 and at most the 1 s"),
        (dict(step=None), r"found no step, expected a time in s, as step=0\.1"),
        (dict(order="seidel"), r"found order='seidel', .*did you mean 'gauss-seidel'"),
        (dict(tolerance=2.0), r"found tolerance=2\.0, expected a number between 0 and 1"),
        (dict(iterations=0), r"found iterations=0"),
        (dict(start={"a.q": 1.0}), r"a has no variable 'q'"),
        (dict(start={"a.k": np.nan}), r"start a\.k: found nan, expected 1 finite number"),
        (
            dict(start={"a.x": 1.0}),
            r"start a\.x is a continuous output that is calculated, expected .*, of which this FMU has none",
        ),
        (
            dict(start={"a.k.start": 1.0}),
            r"start a\.k\.start: found no such variable; in an FMU it is called 'a\.k'",
        ),
        (dict(start={"a.q.start": 1.0}), r"start a\.q\.start: a has no variable 'q\.start'"),
        (dict(inputs={"a.qq": 1.0}), r"inputs a\.qq: a has no variable 'qq'; its inputs are f\."),
        (dict(inputs={"a.k": 1.0}), r"inputs a\.k: found a parameter, expected an input"),
        (dict(inputs={"b.u": 1.0}), r"b\.u is driven by a\.x and by inputs"),
        (dict(outputs=["a.y"]), r"a has no variable 'y'"),
        (dict(outputs="a.x"), r"outputs: found 'a\.x', expected names in a list"),
        (dict(steps={"a": 0.13}), r"steps: a has 0\.13 s, expected a whole multiple or fraction"),
        (dict(steps={"q": 0.1}), r"steps: there is no component 'q'"),
        (dict(sequence=["a"]), r"sequence: found a, expected each component once: a, b"),
        (dict(sequence=["a", "q"]), r"sequence: there is no component 'q'"),
        (dict(isolate=["q"]), r"isolate: there is no component 'q'"),
    ],
)
def test_wrong_settings_are_refused(halves, policy, words):
    with pytest.raises(ModelError, match=words):
        cosimulate(halves, WIRES, **{"stop": 1.0, "step": 0.1, **policy})


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (([0.0, 0.5], [0.0, 1.0]), r"samples cover 0 to 0\.5 s, expected 0 to 1 s"),
        (([0.0, 2.0], [0.0]), r"input a\.f: Samples: found times of shape \(2,\) and values of shape \(1,\)"),
        (([1.0, 0.0], [0.0, 1.0]), r"input a\.f: Samples: the time falls from 1 s in row 0 to 0 s"),
        (lambda t: np.nan, r"inputs a\.f at t = 0 s: found nan"),
        ("much", r"inputs a\.f: found 'much', expected a number"),
        (
            lambda t: 1 / (t - 0.45),
            r"inputs a\.f: the function failed at t = 0\.45 s with ZeroDivisionError: .*; expected a value at every",
        ),
    ],
)
def test_wrong_signals_are_refused(halves, samples, words):
    with pytest.raises(ModelError, match=words):
        cosimulate(halves, WIRES[:1], stop=1.0, step=0.1, inputs={"a.f": samples})


def test_files_that_are_no_fmus_are_refused(tmp_path, build, halves):
    torn = tmp_path / "torn.fmu"
    torn.write_bytes(halves["a"].read_bytes()[:500])
    for file in (torn, tmp_path / "missing.fmu"):
        with pytest.raises(GantryTauError, match=str(file.name)):
            cosimulate({"a": file}, stop=1.0, step=0.1)
    with pytest.raises(ModelError, match=r"components: found \{\}, expected"):
        cosimulate({}, stop=1.0, step=0.1)
