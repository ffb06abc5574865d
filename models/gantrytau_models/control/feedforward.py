"""Inverse dynamics as feedforward: what forces move the tool of a robot along a reference.

Dressler (2012), Figure 3.2: each coordinate of the reference passes through a low-pass filter, whose output
may be differentiated as often as its order says. The robot is led along the filtered reference; its forces,
positions and speeds follow from the same equations as its motion under given forces.
"""

from collections.abc import Sequence
from typing import Any

from gantrytau import Array, Input, Model, Output, Parameter, der
from gantrytau.mechanics.filters import LowPass
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.mechanisms.gantry_tau import GantryTau, tool_ahead_of_carts
from gantrytau_models.prototypes import Prototype


class Feedforward(Model):
    """Forces `f` and filtered references `r`, `q`, `v`, `a` for a reference `r_ref` of the tool.

    prototype, friction: as of `GantryTau`; start: the start value of `r_ref`, (3,) in m, ahead of the carts
    unless given; `robot=dict(plate_mass=12.0)` modifies the robot inside, `robot=SixLinkGantryTau(...)` puts
    another with three carts in its place. The filters are critical and of order three unless modified, so that
    forces have no kinks; alike, so that a straight line stays one: a reference that moves steadily comes out
    later by 1.53 / bandwidth. They start at rest at the first value of `r_ref`, which has to be within reach.
    """

    bandwidth = Parameter(40.0, unit="rad/s", min=0.0, description="of the filters, at -3 dB")
    r_ref = Input(3, unit="m", description="reference of the tool position, resolved in the world")
    r = Output(3, unit="m", description="filtered reference of the tool position")
    q = Output(3, unit="m", description="positions of the carts that belong to r")
    v = Output(3, unit="m/s", description="speeds of the carts")
    a = Output(3, unit="m/s2", description="accelerations of the carts")
    f = Output(3, unit="N", description="actuator forces of the carts, before friction")
    filters = Array(LowPass, 3, order=3, bandwidth=bandwidth, u=dict(unit="m"), y=dict(unit="m"))
    robot = GantryTau.open()

    def __init__(
        self,
        prototype: Prototype,
        *,
        friction: type[Friction] | None = TanhFriction,
        start: Sequence[float] | None = None,
        **modifications: Any,
    ):
        tool = dict(start=tool_ahead_of_carts(prototype) if start is None else list(start))
        robot = GantryTau(prototype, friction=friction, tool=dict(r=tool))
        super().__init__(dict(r_ref=tool, robot=robot.modifications), **modifications)

    def equations(self):
        for k, (low_pass, cart) in enumerate(zip(self.filters, self.robot.carts, strict=True)):
            yield low_pass.u == self.r_ref[k]
            yield self.robot.tool.r[k] == low_pass.y
            yield self.q[k] == cart.s
            yield self.v[k] == cart.v
            yield self.a[k] == der(cart.v)
            yield self.f[k] == cart.f
        yield self.r == self.robot.tool.r
