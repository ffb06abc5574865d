"""What a user's controller may be: one law as a function, a model, an FMU and in C gives the same motion."""

import shutil
import subprocess

import numpy as np
import pytest

from gantrytau import (
    Input,
    Model,
    ModelError,
    Output,
    Parameter,
    Real,
    Samples,
    SolveError,
    der,
    sampled,
    simulate,
)
from gantrytau_fmu import Channel, PythonComponent, export_fmu
from gantrytau_fmu.controller import AxisLimits, Controller
from gantrytau_models import CartServo
from tests.fmu.controller.conftest import InProcess, slide

STOP = 0.2
STEP = {"q_ref": Samples([0.0, 0.048, 1.0], [0.0, 0.1, 0.1], kind="constant")}


class Law(Model):
    """q_ref + gain (delta - q / 2), sampled."""

    gain = Parameter(0.5, unit="1", description="of the correction")
    q = Input(unit="m", description="measured")
    nominal = Input(unit="m", description="reference")
    delta = Input(unit="m", description="correction")
    q_ref = Output(unit="m", start=0.0, description="corrected reference")

    def equations(self):
        yield sampled(self.q_ref, self.nominal + self.gain * (self.delta - self.q / 2), period=0.004)


SOURCE = """
#include <stdint.h>
#define SHOWN __attribute__((visibility("default")))
SHOWN const char *gantrytau_values = "%s";
SHOWN const char *gantrytau_references = "%s";
SHOWN int gantrytau_sample(int64_t k, double time, const double *values, double *references) {
    references[0] = %s;
    return k == 40 && time > 1.0 ? 7 : %s;
}
"""
FORMULA = "values[1] + values[3] * (values[2] - values[0] / 2)"
TAKEN = "q q_ref stream.delta gain"
WIRES = {"nominal": "q_ref", "delta": "stream.delta"}


def compiled(folder, values=TAKEN, references="q_ref", formula=FORMULA, code="0"):
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    (folder / "law.c").write_text(SOURCE % (values, references, formula, code))
    command = [compiler, "-std=c99", "-ffp-contract=off", "-shared", "-fPIC", "law.c", "-o", "law.so"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "law.so"


def run(law, **options):
    client = InProcess(answers=lambda k: [0.01 * np.sin(0.3 * k)])
    controller = Controller(slide(), law, clients=[client], references=STEP, **options)
    controller.set("gain", 0.75, at=0.1)
    return controller.run(STOP)


GAIN = Channel("gain", "1")


@pytest.fixture(scope="module")
def by_function():
    def law(t, v):
        return {"q_ref": v["q_ref"] + v["gain"] * (v["stream.delta"] - v["q"] / 2)}

    return run(law, parameters={GAIN: 0.5})


def test_a_model_is_the_same_law(by_function):
    found = run(Law(), wires=WIRES)
    for name in ("q", "applied.q_ref", "gain"):
        assert np.allclose(found[name], by_function[name], rtol=0, atol=1e-15), name  # rounding of a metre


def test_an_fmu_is_the_same_law(by_function, tmp_path):
    found = run(export_fmu(Law(), tmp_path / "law.fmu", fmi="2.0", find=["q_ref"]), wires=WIRES)
    assert np.allclose(found["q"], by_function["q"], rtol=0, atol=1e-15)


def test_c_is_the_same_law_bit_by_bit(by_function, tmp_path):
    found = run(compiled(tmp_path), parameters={GAIN: 0.5})
    assert np.array_equal(found["q"], by_function["q"])


def test_a_python_component_is_the_same_law(by_function):
    part = PythonComponent(
        lambda t, v: {"q_ref": v["nominal"] + v["gain"] * (v["delta"] - v["q"] / 2)},
        inputs=[Channel("q", "m"), Channel("nominal", "m"), Channel("delta", "m")],
        outputs=[Channel("q_ref", "m")],
        parameters={GAIN: 0.5},
    )
    assert np.array_equal(run(part, wires=WIRES)["q"], by_function["q"])


class Cart(Model):
    """A cart under its servo."""

    servo = CartServo(k_p=20.0, k_v=2e3, delay=3)
    m = Parameter(20.0, unit="kg", description="mass")
    q_ref = Input(unit="m", start=0.0, description="reference")
    s = Real(unit="m", start=0.0, fixed=True, description="position")
    v = Real(unit="m/s", start=0.0, fixed=True, description="speed")
    q = Output(unit="m", description="measured position")

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.servo.f
        yield self.servo.q == self.s
        yield self.servo.v == self.v
        yield self.servo.q_ref == self.q_ref
        yield self.servo.v_ref == 0.0
        yield self.servo.f_ff == 0.0
        yield self.q == self.s


def test_a_model_under_its_servo_moves_as_in_one_simulation(tmp_path):
    file = export_fmu(Cart(), tmp_path / "cart.fmu", find=["q"], tolerance=1e-9)
    found = Controller(file, lambda t, v: {"q_ref": v["q_ref"] + 0.01}, references=STEP).run(STOP)
    moved = Samples([0.0, 0.048, 1.0], [0.01, 0.11, 0.11], kind="constant")
    alone = simulate(Cart(), stop=STOP, inputs={"q_ref": moved}, tolerance=1e-10)
    assert np.allclose(found["q"], [alone.at(t, "q") for t in found.time], atol=1e-7)  # a hundred tolerances
    assert found.final("q") > 0.05


WRONG = [
    (lambda t, v: {"q": 1.0}, SolveError, "the function <lambda> answered 'q', which is no reference;"),
    (lambda t, v: 1.0, SolveError, "the function <lambda> answered 1.0, expected {name: value} of"),
    (lambda t, v: {"q_ref": [1.0, 2.0]}, SolveError, "answered q_ref = [1.0, 2.0], expected 1 number"),
    (lambda t, v: {"q_ref": None}, SolveError, "answered q_ref = None, expected 1 number"),
    (lambda t, v: {"q_ref": "0.5"}, SolveError, "answered q_ref = '0.5', expected 1 number"),
    (lambda t, v: {"q_ref": [None]}, SolveError, "answered q_ref = [None], expected 1 number"),
    (lambda t, v: {"q_ref": 1j}, SolveError, "answered q_ref = 1j, expected 1 number"),
    (lambda t, v: {"q_ref": v["qq"]}, SolveError, "the function <lambda> raised KeyError: 'qq'; mend it"),
    ("law.so", ModelError, "controller: found no file law.so, expected a shared library"),
    ("law.exe", ModelError, "law.exe"),
    (3, ModelError, "controller: found 3, expected a function of t and values, a model, an FMU file, a"),
]


@pytest.mark.parametrize(("law", "kind", "said"), WRONG)
def test_what_is_no_law_is_said(law, kind, said, plant):
    with pytest.raises(kind) as error:
        Controller(plant, law).run(STOP)
    assert said in str(error.value)


def test_a_law_that_fails_on_the_way_leaves_what_was_run(plant, tmp_path):
    law = lambda t, v: {"q_ref": 1.0 / (0.1 - t) if t < 0.099 else 1 / 0}  # noqa: E731
    with pytest.raises(SolveError, match="ZeroDivisionError") as error:
        Controller(plant, law).run(STOP, log=tmp_path / "log.jsonl")
    assert error.value.time == pytest.approx(0.1)
    assert error.value.result.time.size == 25
    lines = (tmp_path / "log.jsonl").read_text().splitlines()
    assert len(lines) == 27
    assert "ZeroDivisionError" in lines[-1]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (dict(values="q speed"), "controller: law.so names 'speed', expected one of those that there are"),
        (dict(references="f"), "controller: law.so names 'f', expected one of those that there are"),
        (dict(references=""), "controller: law.so gives no reference, expected names in"),
        (dict(code="5"), "controller: law.so answered 5 in sample 0 at t = 0 s, expected 0"),
    ],
)
def test_a_library_that_does_not_fit_is_refused_by_name(changed, said, tmp_path):
    with pytest.raises((ModelError, SolveError)) as error:
        run(compiled(tmp_path, **changed), parameters={GAIN: 0.5})
    assert said in str(error.value)


def test_a_library_without_the_names_is_refused(tmp_path, plant):
    (tmp_path / "law.so").write_text("no library")
    with pytest.raises(ModelError, match="with gantrytau_values, gantrytau_references and gantrytau_sample"):
        Controller(plant, tmp_path / "law.so")


@pytest.mark.parametrize(
    ("wires", "said"),
    [
        ({}, "controller.nominal: found no 'nominal' among what is known"),
        (WIRES | {"delta": "stream.beta"}, "controller.delta: found no 'stream.beta' among what is known;"),
        (WIRES | {"delta": "f_activate"}, "controller.delta: found 1 in m, expected 1 in 1, as f_activate"),
        (WIRES | {"detla": "q"}, "wires: the controller has no 'detla'; did you mean 'delta'?"),
        (WIRES | {"q_ref": "f"}, "controller.q_ref: found no 'f' among the references; there is q_ref."),
    ],
)
def test_inputs_of_a_model_that_nothing_gives_are_told(wires, said):
    part = PythonComponent(
        lambda t, v: {"q_ref": 0.0},
        inputs=[Channel("q", "m"), Channel("nominal", "m"), Channel("delta", "m")],
        outputs=[Channel("q_ref", "m")],
    )
    with pytest.raises(ModelError) as error:
        Controller(slide(), part, clients=[InProcess()], wires=wires)
    assert said in str(error.value)


def test_a_model_whose_outputs_are_no_references_is_refused(plant):
    part = PythonComponent(lambda t, v: {"f": 0.0}, inputs=[], outputs=[Channel("f", "N")])
    with pytest.raises(ModelError, match="found the outputs f, expected one that is a reference, q_ref"):
        Controller(plant, part)


def test_wires_of_a_function_are_refused(plant):
    with pytest.raises(ModelError, match="wires: found some, expected them with a model or an FMU"):
        Controller(plant, lambda t, v: {}, wires={"a": "b"}, limits={"q_ref": AxisLimits()})
