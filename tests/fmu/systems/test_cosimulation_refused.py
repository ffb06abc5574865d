"""Co-simulations that cannot be: connections, settings, signals and files that are refused."""

import numpy as np
import pytest

from gantrytau import GantryTauError, ModelError
from gantrytau_fmu import Master, cosimulate
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


def run(files, **policy):
    """A run whose keywords may be those of its master."""
    master = {name: policy.pop(name) for name in list(policy) if name in vars(Master())}
    return cosimulate(files, WIRES, **{"stop": 1.0, "step": 0.1, **policy}, master=Master(**master))


@pytest.mark.parametrize(
    ("policy", "argument", "words"),
    [
        (dict(stop=-1.0), "stop", "after the beginning at 0 s"),
        (dict(step=0.0), "step", "more than 0 and at most the 1 s that are simulated"),
        (dict(step=1.5), "step", "more than 0 and at most the 1 s"),
        (dict(step=None), "step", r"found no step, expected a time in s, as step=0\.1"),
        (dict(order="seidel"), "order", "did you mean 'gauss-seidel'"),
        (dict(tolerance=2.0), "tolerance", "below 1"),
        (dict(start={"a.q": 1.0}), "start", r"a has no variable 'q'"),
        (dict(start={"a.k": np.nan}), "start", r"a\.k: found nan"),
        (dict(start={"a.x": 1.0}), "start", r"a\.x: a continuous output .*, of which this FMU has none"),
        (dict(start={"a.k.start": 1.0}), "start", r"a\.k\.start: .*; in an FMU it is called 'a\.k'"),
        (dict(start={"a.q.start": 1.0}), "start", r"a\.q\.start: a has no variable 'q\.start'"),
        (dict(inputs={"a.qq": 1.0}), "inputs", r"a\.qq: a has no variable 'qq'; its inputs are f\."),
        (dict(inputs={"a.k": 1.0}), "inputs", r"a\.k: found a parameter, expected an input"),
        (dict(inputs={"b.u": 1.0}), None, r"b\.u is driven by a\.x and by inputs"),
        (dict(outputs=["a.y"]), None, r"a has no variable 'y'"),
        (dict(outputs="a.x"), "outputs", "expected names in a list"),
        (dict(steps={"a": 0.13}), "steps", r"a has 0\.13 s, expected a whole multiple or fraction"),
        (dict(steps={"q": 0.1}), "steps", "there is no component 'q'"),
        (dict(sequence=["a"]), "sequence", "expected each component once: a, b"),
        (dict(sequence=["a", "q"]), "sequence", "expected each component once: a, b"),
        (dict(isolate=["q"]), "isolate", "there is no component 'q'"),
    ],
)
def test_wrong_settings_are_refused(halves, policy, argument, words):
    with pytest.raises(ModelError, match=words) as refusal:
        run(halves, **policy)
    assert refusal.value.argument == argument


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (([0.0, 0.5], [0.0, 1.0]), r"samples cover 0 to 0\.5 s, expected 0 to 1 s"),
        (([0.0, 2.0], [0.0]), r"input a\.f: Samples: found times of shape \(2,\) and values of shape \(1,\)"),
        (([1.0, 0.0], [0.0, 1.0]), r"input a\.f: Samples: the time falls from 1 s in row 0 to 0 s"),
        (lambda t: np.nan, r"inputs: a\.f at t = 0 s: found nan"),
        ("much", r"inputs: a\.f: found 'much', expected a number"),
        (lambda t: 1 / (t - 0.45), r"inputs: a\.f: the function failed at t = 0\.45 s with"),
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
    with pytest.raises(ModelError, match=r"found components=\{\}, expected"):
        cosimulate({}, stop=1.0, step=0.1)


def test_a_time_may_bring_its_unit():
    assert Master(timeout="1 min").timeout == 60.0  # type: ignore[arg-type]
