"""Models and Python functions as components of a system."""

import math
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Output, Parameter, Real, SolveError, der
from gantrytau_fmu import Channel, Master, PythonComponent, cosimulate, export_fmu

A, STEP = 2.0, 0.1
WIRES = [("tank.y", "law.y"), ("law.u", "tank.u")]


class Tank(Model):
    """x' = -a x + u."""

    a = Parameter(A, unit="1/s", description="rate")
    u = Input(unit="m/s", start=0.0, description="what flows in")
    x = Real(unit="m", start=1.0, fixed=True, description="level")
    y = Output(unit="m", description="measured level")

    def equations(self):
        yield der(self.x) == -self.a * self.x + self.u
        yield self.y == self.x


def law(t, values):
    return {"u": -3.0 * values["y"]}


def sampled_law(function=law, **changed):
    given: dict[str, Any] = dict(inputs=[Channel("y", "m")], outputs=[Channel("u", "m/s")])
    return PythonComponent(function, **(given | changed))


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    return export_fmu(Tank(), tmp_path_factory.mktemp("tank") / "tank.fmu", tolerance=1e-10)


def test_a_model_under_a_sampled_function_follows_its_difference_equation(tank):
    phi = math.exp(-A * STEP)
    gamma = (1 - phi) / A  # of the zero-order hold
    found = cosimulate({"tank": tank, "law": sampled_law()}, WIRES, stop=1.0, step=STEP)
    expected = (phi - 3.0 * gamma) ** np.arange(11)
    assert np.allclose(found["tank.y"], expected, atol=1e-8)  # a hundred times the tolerance of the FMU
    assert found.unit("law.u") == "m/s"


def test_a_model_is_the_fmu_that_it_becomes(tank):
    options: dict[str, Any] = dict(stop=0.5, step=STEP, master=Master(tolerance=1e-10))
    of_model = cosimulate({"tank": Tank(), "law": sampled_law()}, WIRES, **options)
    of_file = cosimulate({"tank": tank, "law": sampled_law()}, WIRES, **options)
    assert np.array_equal(of_model["tank.y"], of_file["tank.y"])


def test_a_function_may_be_the_plant_and_remember():
    level = [1.0]

    def plant(t, values):
        level[0] *= math.exp(-A * STEP)
        level[0] += values["u"] * (1 - math.exp(-A * STEP)) / A
        return {"y": level[0]}

    part = PythonComponent(
        plant, inputs=[Channel("u", "m/s")], outputs=[Channel("y", "m")], starts={"y": 1.0}, sampled=False
    )
    found = cosimulate({"tank": part, "law": sampled_law()}, WIRES, stop=1.0, step=STEP)
    phi = math.exp(-A * STEP)
    assert np.allclose(found["tank.y"], (phi - 3 * (1 - phi) / A) ** np.arange(11), rtol=1e-12)  # rounding


def test_vectors_and_parameters_come_by_name(tank):
    part = PythonComponent(
        lambda t, values: {"u": values["gain"] @ np.array([values["y"], 1.0]), "twice": values["gain"] * 2},
        inputs=[Channel("y", "m")],
        outputs=[Channel("u", "m/s"), Channel("twice", "1", 2)],
        parameters={Channel("gain", "1", 2): [0.0, 0.0]},
    )
    found = cosimulate({"tank": tank, "law": part}, WIRES, stop=1.0, step=STEP, start={"law.gain": [0.0, A]})
    assert np.allclose(found.final("tank.y"), 1.0, atol=1e-8)  # at rest where u = a x
    assert found.final("law.twice").tolist() == [0.0, 2 * A]


REFUSED = [
    (lambda t, v: {"v": 1.0}, "law: the function <lambda> answered ['v'], expected {name: value} of u"),
    (lambda t, v: 3.0, "law: the function <lambda> answered 3.0, expected {name: value} of u"),
    (lambda t, v: {"u": [1.0, 2.0]}, "law: the function <lambda> answered u = [1.0, 2.0], expected"),
    (lambda t, v: {"u": "fast"}, "law: the function <lambda> answered u = 'fast', expected 1 number"),
    (lambda t, v: {"u": 1 / 0}, "law: the function <lambda> raised ZeroDivisionError: division by zero;"),
    (lambda t, v: {"u": math.nan}, "law: found law.u = nan at t = 0.1 s, expected finite values"),
]


@pytest.mark.parametrize(("function", "said"), REFUSED, ids=lambda value: str(value)[:24])
def test_what_a_function_does_wrong_is_said_with_its_name_and_time(tank, function, said):
    with pytest.raises(SolveError) as error:
        cosimulate({"tank": tank, "law": sampled_law(function)}, WIRES, stop=1.0, step=STEP)
    assert said in str(error.value)
    assert error.value.result.final("tank.y") == 1.0


@pytest.mark.parametrize(
    ("master", "said"),
    [
        (Master(isolate=True), "isolate: law is a Python function, expected an FMU"),
        (Master(isolate=["law"]), "isolate: law is a Python function, expected an FMU"),
        (Master(error_estimate=True), "error_estimate: law is a Python function, which a second run would"),
        (Master(order="iterate"), "law: law cannot save and restore its state, which order='iterate' needs"),
    ],
)
def test_what_a_function_cannot_do_is_refused_by_name(tank, master, said):
    with pytest.raises(ModelError) as error:
        cosimulate({"tank": tank, "law": sampled_law()}, WIRES, stop=1.0, step=STEP, master=master)
    assert said in str(error.value)


def test_a_bare_function_is_told_how_to_become_a_component(tank):
    parts: Any = {"tank": tank, "law": law}
    with pytest.raises(ModelError, match=r"law: found <function law.*PythonComponent\(function") as error:
        cosimulate(parts, WIRES, stop=1.0, step=STEP)
    assert "expected an FMU file, a model instance or a PythonComponent" in str(error.value)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (dict(function=3.0), "PythonComponent: found 3.0, expected a function of t and values"),
        (dict(outputs=[Channel("y", "m")]), "PythonComponent: found 'y' twice, expected each name once"),
        (dict(starts={"v": 1.0}), "PythonComponent: found a start of 'v', which is no output; there is u."),
        (dict(starts={"u": [1.0, 2.0]}), "PythonComponent: found 2 numbers for u, expected 1"),
    ],
)
def test_a_component_that_is_declared_wrongly(changed, said):
    with pytest.raises(ModelError) as error:
        sampled_law(**changed)
    assert said in str(error.value)
