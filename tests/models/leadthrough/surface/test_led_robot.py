"""The three-link robot as the arm that is led."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, simulate, translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_models.leadthrough import LedRobot, SurfaceTracking, surface_disturbances, surfaces

OUTPUTS = ["f_n", "arm.r", "arm.v", "face.f"]


def led(arm, more=(), **settings):
    model = SurfaceTracking(surfaces.METAL, arm=arm, **settings)
    return simulate(
        translate(model, events=True),
        stop=4.0,
        points=1001,
        seed=0,
        inputs=surface_disturbances(),
        outputs=[*OUTPUTS, *more],
    )


@pytest.fixture(scope="module")
def robot():
    return led(
        LedRobot(prototypes.L1),
        ["arm.drives", "arm.robot.tool.r", "arm.robot.tool.v", "der(arm.robot.tool.v)"],
    )


def test_a_robot_moves_as_a_rigid_arm(robot):
    """Carts lag as the tool does, but for how their ways to it turn within 2 ms."""
    rigid = led(None)
    assert robot["f_n"].max() > 2
    assert np.abs(robot["arm.r"] - rigid["arm.r"]).max() < 1e-6
    assert np.abs(robot["f_n"] - rigid["f_n"]).max() < 1e-3


def test_drives_are_those_of_the_robot_with_the_tool_force_on_it(robot):
    """Inverse dynamics of a robot by itself, plus what the tool feels, by the virtual work of its carts."""
    dae = translate(GantryTau(prototypes.L1))
    ways = [f"carts[{i}].f" for i in range(3)]
    forces = dae.function(["tool.r", "tool.v", "der(tool.v)"], ways)
    speeds = dae.function(["tool.r", "tool.v"], [f"carts[{i}].v" for i in range(3)])
    k = np.searchsorted(robot.time, 3.0) + 1
    r, v, a = (robot[name][k] for name in ("arm.robot.tool.r", "arm.robot.tool.v", "der(arm.robot.tool.v)"))
    alone = np.array([float(f) for f in forces(r, v, a)])
    to_carts = np.array([[float(s) for s in speeds(r, unit)] for unit in np.eye(3)]).T
    on_tool = -np.diag([1.0, -1.0, -1.0]) @ robot["face.f"][k]
    needed = np.linalg.solve(to_carts.T, -on_tool)
    assert np.linalg.norm(on_tool) > 1
    assert np.allclose(robot["arm.drives"][k], alone + needed, atol=1e-6)


def test_a_place_out_of_reach_is_refused():
    with pytest.raises(ModelError, match="reach"):
        LedRobot(prototypes.L1, place=[0.0, 9.0, 0.0])
    for name, value in (("place", (0.9, 2.7)), ("place", "here"), ("start", (0.0, 0.0))):
        wrong: Any = {name: value}
        with pytest.raises(ModelError, match=f"LedRobot: (found )?{name}"):
            LedRobot(prototypes.L1, **wrong)
