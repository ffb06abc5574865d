"""Robot and controller as two FMUs against one simulation of both."""

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau_fmu import Master, cosimulate, export_fmu
from gantrytau_models import prototypes
from gantrytau_models.control.plant import MeasuredGantryTau
from gantrytau_models.control.tracking import ControlledRobot, TrackingController
from gantrytau_models.mechanisms.gantry_tau import tool_ahead_of_carts

WIRES = [
    *((f"controller.f[{k}]", f"robot.carts[{k}].f") for k in range(3)),
    ("robot.q", "controller.q"),
    ("robot.v", "controller.v"),
]
REACH = 0.05  # m, along each axis of the world at once


@pytest.fixture(scope="module")
def system(tmp_path_factory):
    folder = tmp_path_factory.mktemp("system")
    parts = {"robot": MeasuredGantryTau(prototypes.L1), "controller": TrackingController(prototypes.L1)}
    find = {"robot": ["tool.r", "q", "v"], "controller": []}
    return {name: export_fmu(model, folder / f"{name}.fmu", find=find[name]) for name, model in parts.items()}


@pytest.fixture(scope="module")
def target():
    return np.array(tool_ahead_of_carts(prototypes.L1)) + REACH


@pytest.fixture(scope="module")
def together(target):
    """One simulation of both: the reference jumps at the start, and its filters make a motion of it."""
    return simulate(
        ControlledRobot(prototypes.L1), stop=0.5, points=126, inputs={"r_ref": target}, tolerance=1e-9
    )


def test_a_sampled_controller_and_its_robot_move_as_one_model(system, target, together):
    step = 1e-3  # a quarter of the period
    found = cosimulate(system, WIRES, stop=0.5, step=step, inputs={"controller.r_ref": target})
    assert np.linalg.norm(found.final("robot.tool.r") - target + REACH) > 0.01  # it moves
    difference = found["robot.tool.r"][:: round(4e-3 / step)] - together["r"]
    assert np.max(abs(difference)) < 1e-7  # m; the runtime's tolerance of 1e-6 leaves 2e-10


def test_a_smooth_reference_from_outside_is_followed_within_the_hold(system, target):
    def reference(t):
        return target - REACH * np.cos(2 * np.pi * t)

    def course(step):
        found = cosimulate(
            system,
            WIRES,
            stop=0.5,
            step=step,
            inputs={"controller.r_ref": reference},
            master=Master(steps={"controller": step / 4}),
        )
        return found["robot.tool.r"][:: round(4e-3 / step)]

    assert np.max(abs(course(1e-3) - course(5e-4))) < 0.05e-3  # m, what the project wants at 1 ms
