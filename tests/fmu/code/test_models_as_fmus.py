"""Models of the package as FMUs: kinematics with a status, and a robot with its controller in two files."""

import numpy as np
import pytest

from gantrytau import Real, simulate, translate
from gantrytau_fmu import cosimulate, export_fmu
from gantrytau_models import (
    CircularReference,
    ComputedTorqueController,
    ControlledRobot,
    InverseKinematics,
    MotorDrivenGantryTau,
    TrackingController,
    prototypes,
)
from gantrytau_models.mechanisms.gantry_tau import tool_ahead_of_carts

START = tool_ahead_of_carts(prototypes.D1)
AT_START = dict(r=dict(start=START))
CIRCLE = CircularReference(start=START, radius=0.05, period=0.5)
MEASURED = [("robot.q", "controller.q"), ("robot.v", "controller.v")]


class Circling(TrackingController):
    """The controller with a circle as its own reference."""

    r_ref = Real(3, unit="m", description="reference of the tool position")
    circle = CIRCLE

    def equations(self):
        yield from super().equations()
        yield self.r_ref == self.circle.r


class Whole(ControlledRobot):
    """Robot, controller and circle as one model."""

    r_ref = Real(3, unit="m", description="reference of the tool position")
    circle = CIRCLE

    def equations(self):
        yield from super().equations()
        yield self.r_ref == self.circle.r


def wires(output, pattern):
    return [*MEASURED, *((f"controller.{output}[{k}]", pattern.format(k)) for k in range(3))]


@pytest.fixture(scope="module")
def controller(tmp_path_factory):
    path = tmp_path_factory.mktemp("controller") / "controller.fmu"
    model = Circling(prototypes.D1, control=ComputedTorqueController, start=START)
    export_fmu(model, path, fmi="2.0", find=["f", "tau", "feedforward.r"])
    return path


@pytest.fixture(scope="module")
def whole():
    model = Whole(prototypes.D1, control=ComputedTorqueController, start=START)
    return simulate(model, stop=0.6, points=151)


def test_motors_take_the_torques_of_the_controller(controller, whole, tmp_path):
    export_fmu(
        MotorDrivenGantryTau(prototypes.D1, tool=AT_START), tmp_path / "robot.fmu", find=["tool.r", "q", "v"]
    )
    files = {"robot": tmp_path / "robot.fmu", "controller": controller}
    apart = cosimulate(files, wires("tau", "robot.motors[{}].tau"), stop=0.6, step=0.004)
    # torques change at samples only, so nothing is lost in between: tolerances of the two integrators
    np.testing.assert_allclose(apart["robot.tool.r"], whole["r"], atol=1e-7)
    assert np.ptp(whole["r"], axis=0).max() > 0.05  # m


def test_kinematics_tell_their_status(tmp_path):
    model = InverseKinematics(prototypes.L1)
    export_fmu(model, tmp_path / "kinematics.fmu")
    expected = translate(model).function(["r"], ["q", "reach", "status"])
    told = []
    for y in (2.8, 3.4, 5.3, 9.0, 1e4):
        tool = [0.5, y, -0.8]
        inputs = {f"k.r[{i}]": value for i, value in enumerate(tool)}
        found = cosimulate({"k": tmp_path / "kinematics.fmu"}, stop=0.01, step=0.01, inputs=inputs)
        q, reach, status = (np.array(x).ravel() for x in expected(tool))
        np.testing.assert_allclose(found.final("k.q"), q, rtol=1e-12)
        np.testing.assert_allclose(found.final("k.reach"), reach, rtol=1e-12)
        assert found.final("k.status") == status[0]
        told.append(status[0])
    assert told == [0.0, 0.0, 1.0, 1.0, 1.0]
