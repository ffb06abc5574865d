"""The three-link robot as the arm that is led: it follows velocities of its tool, and says what forces that takes."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Fixed, Parameter, Real, connect, der, dot
from gantrytau.border.checks import array
from gantrytau.mechanics.multibody import WorldForce
from gantrytau_models.leadthrough.servo_and_sensors import LedArm
from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_models.mechanisms.gantry_tau import GantryTau
from gantrytau_models.prototypes import Prototype

DOWN = ca.DM(np.diag([1.0, -1.0, -1.0]))  # axes of the tool in the world: z points down


class LedRobot(LedArm):
    """A Gantry-Tau robot whose carts follow speeds, T_v v' = v_ref - v, those with which its tool follows `v_ref`.

    prototype: as `prototypes.L1`; place: of the tool where r is zero, (3,) in m, in the world. The servos are as stiff as
    those of a velocity-controlled robot: no force pushes them back, and `drives` are the forces that this takes,
    those of the tool on the surface included. Raises ModelError for a place that is none, or that the links do not reach.
    """

    T_v = Parameter(2.303e-3, unit="s", min=0.0, description="time constant of the carts' speeds")
    place = Parameter(shape=3, unit="m", description="of the tool where r is zero, in the world")
    robot = GantryTau.open()
    reaction = WorldForce()
    ways = Real(3, unit="m/s", description="speeds of the carts that give v_ref")
    drives = Real(3, unit="N", description="forces of the actuators")

    def __init__(
        self,
        prototype: Prototype,
        *,
        place: Sequence[float] = (0.9, 2.7, -0.7),
        start: Sequence[float] = (0.0, 0.0, -0.03),
        **modifications: Any,
    ):
        origin = array("LedRobot", "place", place, (3,), unit="m")
        tool = origin + np.array(DOWN) @ array("LedRobot", "start", start, (3,), unit="m")
        unstretched(prototype, tool)  # refuses what is out of reach
        robot = dict(GantryTau(prototype).modifications)
        robot["tool"] = dict(r=Fixed(list(tool)), v=Fixed([0.0, 0.0, 0.0]))
        super().__init__(dict(place=list(origin), robot=robot), **modifications)

    def equations(self):
        robot = self.robot
        yield connect(self.reaction.frame_b, robot.tool.frame)
        yield self.reaction.f == -(DOWN @ self.f)
        yield self.r == DOWN.T @ (robot.tool.r - self.place)
        yield self.v == DOWN.T @ robot.tool.v
        wanted = DOWN @ self.v_ref
        for k, (arm, cart) in enumerate(zip(robot.arms, robot.carts, strict=True)):
            # a rod keeps its length: its two ends have the same speed along it
            rod = robot.tool.r - arm.frame_cart.r
            yield self.ways[k] == dot(rod, wanted) / dot(rod, arm.direction)
            yield cart.f == self.drives[k]
            yield self.T_v * der(cart.v) == self.ways[k] - cart.v
