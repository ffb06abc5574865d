"""Limits of variables in FMUs: told through the logger, once for each, with the time and by how much."""

from ctypes import byref, c_bool, c_double, c_int, c_size_t

import numpy as np
import pytest

from gantrytau import Model, Output, Parameter, Real, der
from tests.fmu.exported import export
from tests.fmu.runtime.raw_calls import OK, reals


class Cooling(Model):
    """A decay with a state, an output and a parameter that have limits."""

    k = Parameter(1.0, unit="1/s", max=2.0)
    x = Real(start=1.0, fixed=True, unit="m", min=0.5)
    y = Output(unit="m", min=-1.0, max=-0.25)

    def equations(self):
        yield der(self.x) == -self.k * self.x
        yield self.y == -self.x


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def cooling(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("cooling") / "cooling.fmu"
    return export(Cooling(), path, request.param)


def told(fmu):
    lines = [text for category, text in fmu.library.messages if category == "logStatusWarning"]
    fmu.library.messages.clear()
    return [line.split("beyond")[0] for line in lines]


def test_each_variable_is_told_once_in_co_simulation(cooling):
    with cooling.new() as run:
        run.begin(k=2.5)
        assert told(cooling) == ["Cooling: k passes its max of 2 1/s and is 2.5 1/s at time = 0 s, 0.5 "]
        for k in range(8):
            assert run.instance.step(0.1 * k, 0.1) == OK
        x = np.exp(-2.5 * np.array([0.3, 0.6]))
        assert told(cooling) == [
            f"Cooling: x passes its min of 0.5 m and is {x[0]:.6g} m at time = 0.3 s, {0.5 - x[0]:.3g} ",
            f"Cooling: y passes its max of -0.25 m and is {-x[1]:.6g} m at time = 0.6 s, {0.25 - x[1]:.3g} ",
        ]
        assert run.instance("Reset") == OK
        run.begin(k=2.5)
        assert len(told(cooling)) == 1


def test_a_completed_step_of_model_exchange_tells_it(cooling):
    with cooling.new("ModelExchange") as run:
        run.begin()
        assert told(cooling) == []
        run.settle()
        boolean = c_int if cooling.version == 2 else c_bool
        for x in (0.4, 0.3):
            assert run.instance("SetTime", c_double(1.0 - x)) == OK
            assert run.instance("SetContinuousStates", reals([x]), c_size_t(1)) == OK
            asked = byref(boolean()), byref(boolean())
            assert run.instance("CompletedIntegratorStep", boolean(True), *asked) == OK
        assert told(cooling) == ["Cooling: x passes its min of 0.5 m and is 0.4 m at time = 0.6 s, 0.1 "]
