"""A match that is led into its hole by hand, and aligned there by the torque of the tool."""

from typing import Any

import numpy as np

from gantrytau import Input, Model, Real, Start, atan2, connect, cross
from gantrytau.mechanics import multibody
from gantrytau_models.leadthrough.peg_control import PegControl
from gantrytau_models.leadthrough.peg_match import WOODEN, Match
from gantrytau_models.leadthrough.peg_tool import PegHand, PegTool

TILT = float(np.radians(6.0))


class PegInHole(Model):
    """A rigid, velocity-controlled tool with a match, which a hand pushes into a hole though it is tilted about y.

    match: the match and its hole. normal: the direction in which force is controlled, see `PegControl`. tilt: of the match
    at the start, rad. What is random comes from `PegDisturbances().inputs()`; without, sensors and eye are perfect.
    Pushed from 20 s on, withdrawn from 79 s on: simulate with `stop=85.0`.
    """

    hole = multibody.Fixed()
    tool = PegTool()
    contact = multibody.ElasticPegContact()
    hand = PegHand()
    control = PegControl()
    force_noise = Input(3, unit="N", start=0.0, description="noise of the tool's force")
    torque_noise = Input(3, unit="N.m", start=0.0, description="noise of the tool's torque")
    handle_noise = Input(3, unit="N", start=0.0, description="noise of the handle's force")
    force_bias = Input(3, unit="N", start=0.0, description="bias of the tool's force")
    torque_bias = Input(3, unit="N.m", start=0.0, description="bias of the tool's torque")
    handle_bias = Input(3, unit="N", start=0.0, description="bias of the handle's force")
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
        self, match: Match = WOODEN, normal: str = "force", tilt: float = TILT, **modifications: Any
    ):
        half = tilt / 2
        super().__init__(
            dict(
                tool=dict(q=Start([np.cos(half), 0.0, np.sin(half), 0.0])),
                contact=dict(
                    length=match.length,
                    bending=match.bending,
                    wall=match.wall,
                    clearance=match.clearance,
                    depth=match.depth,
                    mu=match.mu,
                ),
                control=PegControl(normal=normal).modifications,
            ),
            **modifications,
        )

    def equations(self):
        tool, control, hand = self.tool, self.control, self.hand
        yield connect(self.hole.frame_b, self.contact.frame_a)
        yield connect(tool.frame_b, self.contact.frame_b)
        yield self.f == -self.contact.f
        yield self.t == -(self.contact.t - cross(tool.tcp * tool.axis, self.contact.f))
        yield control.f == self.f + self.force_bias + self.force_noise
        yield control.t == self.t + self.torque_bias + self.torque_noise
        yield control.f_h == hand.f + self.handle_bias + self.handle_noise
        yield control.v == tool.v
        yield control.axis == tool.axis
        yield tool.v_ref == control.v_ref
        yield tool.w_ref == control.w_ref
        yield hand.r == tool.r
        yield hand.v == tool.v
        # the tool's z points to the hole: half a turn about x from the match, q = (-x, s, z, -y)
        s, x, y, z = (tool.q[k] for k in range(4))
        yield self.alpha == atan2(-y, -x) + (self.yaw - np.pi) / 2
        yield self.gamma == atan2(-y, -x) - (self.yaw - np.pi) / 2
        yield self.beta == np.pi - tool.angle
        yield self.yaw == 2 * atan2(z, s)
