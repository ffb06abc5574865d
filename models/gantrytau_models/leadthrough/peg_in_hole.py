"""A match that is led into its hole by hand, and aligned there by the torque of the tool."""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Model, Real, Start, atan2, connect, cross, white_noise
from gantrytau.border.checks import instance, number
from gantrytau.inputs.random_signals import WhiteNoise
from gantrytau.mechanics import multibody
from gantrytau_models.leadthrough.peg_control import Normal, PegControl
from gantrytau_models.leadthrough.peg_match import WOODEN, Match
from gantrytau_models.leadthrough.peg_tool import EYE_PERIOD, PegHand, PegTool
from gantrytau_models.leadthrough.servo_and_sensors import ForceSensor

TILT = float(np.radians(6.0))
STEEPEST = float(np.radians(30.0))  # to which a slender peg bends as it is told
ALWAYS = 1e6  # s: noise of this period is one number for a run


class PegInHole(Model):
    """A rigid, velocity-controlled tool with a match, which a hand pushes into a hole though it is tilted about y.

    match: the match and its hole. normal: the direction in which force is controlled, see `PegControl`. tilt: of the match
    at the start, rad. What is random comes from outside: `inputs=peg_disturbances()`; without, sensors and eye are perfect.
    Pushed from 20 s on, withdrawn from 79 s on: simulate with `stop=85.0`. Raises ModelError for other arguments.
    """

    hole = multibody.Fixed()
    tool = PegTool()
    contact = multibody.ElasticPegContact()
    hand = PegHand()
    control = PegControl()
    sensor = ForceSensor(std_t=3e-3, std_bias_t=5e-4)
    handle = ForceSensor(std_bias_f=0.05)
    f = Real(3, unit="N", description="force of the tool on the hole")
    t = Real(3, unit="N.m", description="torque of the tool on the hole about the tool centre point")
    alpha = Real(
        unit="rad", description="first angle of the tool, about z; singular where the tool points down"
    )
    beta = Real(unit="rad", description="second, about y; pi where the tool points down")
    gamma = Real(unit="rad", description="third, about z; singular like the first")
    yaw = Real(
        unit="rad",
        description="rotation about the match, alpha - gamma + pi less the start's: never singular",
    )

    def __init__(
        self, match: Match = WOODEN, normal: Normal = "force", tilt: float = TILT, **modifications: Any
    ):
        half = number("PegInHole", "tilt", tilt, unit="rad", least=-STEEPEST, most=STEEPEST) / 2
        instance("PegInHole", "match", match, Match, "a record such as Match(clearance=2e-4)")
        contact = {
            name: getattr(match, name) for name in ("length", "bending", "wall", "clearance", "depth", "mu")
        }
        tool = dict(q=Start([np.cos(half), 0.0, np.sin(half), 0.0]))
        super().__init__(
            dict(tool=tool, contact=contact, control=PegControl(normal).modifications), **modifications
        )

    def equations(self):
        tool, control, hand = self.tool, self.control, self.hand
        yield connect(self.hole.frame_b, self.contact.frame_a)
        yield connect(tool.frame_b, self.contact.frame_b)
        yield self.f == -self.contact.f
        yield self.t == -(self.contact.t - cross(tool.tcp * tool.axis, self.contact.f))
        axes = tool.frame_b.R @ ca.diag([1, -1, -1])  # of the tool: z into the hole
        yield self.sensor.f == axes.T @ self.f
        yield self.sensor.t == axes.T @ self.t
        yield self.handle.f == axes.T @ hand.f
        yield self.handle.t == 0
        yield control.f_t == self.sensor.f_seen
        yield control.t_t == self.sensor.t_seen
        yield control.f_h == self.handle.f_seen
        yield control.v_tool == axes.T @ tool.v
        yield tool.v_ref == axes @ control.v
        yield tool.w_ref == axes @ control.w
        yield hand.r == tool.r
        yield hand.v == tool.v
        # the tool's z points to the hole: half a turn about x from the match, q = (-x, s, z, -y)
        s, x, y, z = (tool.q[k] for k in range(4))
        yield self.alpha == atan2(-y, -x) + (self.yaw - np.pi) / 2
        yield self.gamma == atan2(-y, -x) - (self.yaw - np.pi) / 2
        yield self.beta == np.pi - tool.angle
        yield self.yaw == 2 * atan2(z, s)


def peg_disturbances(period: float = 0.004) -> dict[str, WhiteNoise]:
    """What is random in a `PegInHole`, as inputs of a simulation, whose seed, or that of a study, draws them.

    All are of standard deviation 1; what that makes is said by `std_f` and the like of the sensors, and `eye` of the hand.
    """
    found = {"hand.white": white_noise([1.0] * 2, EYE_PERIOD)}
    for sensor in ("sensor", "handle"):
        for letter in "ft":
            found[f"{sensor}.white_{letter}"] = white_noise([1.0] * 3, period)
            found[f"{sensor}.bias_{letter}"] = white_noise([1.0] * 3, ALWAYS)
    return found
