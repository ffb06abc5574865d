"""The C of controllers as FMUs and on boards gives the inputs that their Python gives."""

import os
import shutil
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fmpy import extract, fmi2, fmi3, read_model_description

from gantrytau import ModelError
from gantrytau.blocks import DiscretePid
from gantrytau_fmu import check_fmu, export_code, read_fmu
from gantrytau_fmu.hardware import emulated_board, step_code
from gantrytau_optimica import Mpc
from tests.optimica.predictive.recorded import recorded_run
from tests.optimica.predictive.test_moves import Rest

pytestmark = pytest.mark.skipif(
    os.name != "posix" or not shutil.which("cc"), reason="needs pseudo-terminals and a C compiler"
)
PERIOD = 0.1


@pytest.fixture(scope="module")
def controlled():
    """C of a controller with two inputs, its measured states, and what it gave."""
    mpc = Mpc(Rest, period=PERIOD, elements=10, rates={"cart.u": 3.0})
    return mpc.c_code(), *recorded_run(mpc, stop=2.0, noise={"cart.v": 0.05})


class Slave:
    """An FMU for Co-Simulation in FMPy, which steps from sample to sample."""

    def __init__(self, path, code, start=0.0):
        about: Any = read_model_description(str(path))
        names = {v.name: v.valueReference for v in about.modelVariables}
        self.given, self.found = ([names[n] for n in part] for part in (code.given, code.find))
        self.period, self.time, self.old = code.period, start, about.fmiVersion == "2.0"
        kind: Any = fmi2.FMU2Slave if self.old else fmi3.FMU3Slave
        self.fmu = kind(
            guid=about.guid, unzipDirectory=extract(str(path)), instanceName="controller",
            modelIdentifier=about.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.fmu.instantiate()
        self.begin(start)

    def begin(self, start):
        self.time = start
        if self.old:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start)
        self.fmu.exitInitializationMode()

    def step(self, state):
        (self.fmu.setReal if self.old else self.fmu.setFloat64)(self.given, list(state))
        self.fmu.doStep(self.time, self.period)
        self.time += self.period
        return list((self.fmu.getReal if self.old else self.fmu.getFloat64)(self.found))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_of_a_predictive_controller_gives_the_inputs_of_python(fmi, controlled, tmp_path):
    code, states, inputs = controlled
    path = export_code(code, tmp_path / "controller.fmu", fmi=fmi)
    assert check_fmu(path, run=True) == []
    slave = Slave(path, code, start=1.0)
    # at the seventh sample a limit is only just touched: both methods end 1e-7 apart
    np.testing.assert_allclose([slave.step(state) for state in states], inputs, atol=1e-6)
    # a saved state holds the plan, and a reset forgets it
    if fmi == "3.0":
        kept = slave.fmu.getFMUState()
        again = slave.step(states[3]), slave.step(states[4])
        slave.fmu.setFMUState(kept)
        slave.time -= 2 * PERIOD
        assert (slave.step(states[3]), slave.step(states[4])) == again
    slave.fmu.reset()
    slave.begin(0.0)
    np.testing.assert_allclose(slave.step(states[0]), inputs[0], atol=1e-9)
    slave.fmu.terminate()
    slave.fmu.freeInstance()


def test_an_fmu_of_a_sampled_model_s_c_begins_with_its_starts(tmp_path):
    model = DiscretePid(k=3.0, T_i=0.2, T_d=0.02, limits=(-1.5, 1.5), period=PERIOD)
    code = step_code(model, given=["u_s", "u_m"], find=["y"])
    slave = Slave(export_code(code, tmp_path / "pid.fmu"), code)
    asked = np.random.default_rng(0).uniform(-0.3, 0.3, (10, 2))
    held, found = np.array(code.start), []
    for one in asked:
        y, held = (part.full().ravel() for part in code.function(one, held))
        found.append(y)
    np.testing.assert_allclose([slave.step(one) for one in asked], found, atol=1e-12)
    slave.fmu.terminate()
    slave.fmu.freeInstance()


def test_a_board_runs_a_predictive_controller(controlled):
    code, states, inputs = controlled
    with emulated_board(code) as line:
        np.testing.assert_allclose([line.step(state) for state in states[:5]], inputs[:5], atol=1e-9)


def test_names_and_units_of_the_fmu_are_those_of_the_code(tmp_path):
    mpc = Mpc(Rest, period=PERIOD, elements=3, disturbance=["cart.u"])
    code = replace(mpc.c_code(), units={"cart.x": "m", "cart.v": "m/s", "cart.u": "N"})
    about = read_fmu(export_code(code, tmp_path / "controller.fmu"))
    assert [v.unit for v in about.variables[1:]] == ["m", "m/s", "", "N", ""]
    assert about.inputs == ("cart.x", "cart.v", "'disturbance(cart.u)'")
    assert about.outputs == ("cart.u", "cart.brake")


def test_single_precision_is_no_fmu(tmp_path):
    code = step_code(DiscretePid(period=PERIOD), given=["u_s", "u_m"], find=["y"], real="float")
    with pytest.raises(ModelError, match="expected code in double precision"):
        export_code(code, tmp_path / "pid.fmu")
