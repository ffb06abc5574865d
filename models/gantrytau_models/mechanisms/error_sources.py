"""What real robots have and nominal models lack, as models whose numbers `calibrate(..., parameters=[...])` finds.

Racks whose error repeats with their pitch, ball screws that turn the turntables of an F1, links that give way under the
weight of the plate. Dressler (2012), sections 5.3 and 5.4, leaves these to later work. Joints of the measurements are what
motors tell: `racks[i].s`, `screws[k].flange_a.phi`, `arms[i].s`.
"""

from typing import Any

from gantrytau import Array, Input, Model, Parameter, Real, connect, sqrt
from gantrytau.mechanics.gears import CyclicRack, ScrewLever
from gantrytau_models.mechanisms.f1 import F1GantryTau
from gantrytau_models.mechanisms.gantry_tau import GantryTau, check_record, tool_ahead_of_carts
from gantrytau_models.mechanisms.six_link import SixLinkGantryTau
from gantrytau_models.prototypes import Prototype


class WithRacks(Model):
    """Base of robots with a rack on each guideway, of any robot with `carts`: `class Mine(WithRacks, SixLinkGantryTau)`.

    Its actuators pull at the carts. `racks[i].s` is where the motor believes the cart to be, `racks[i].cosine` and `.sine`
    are the error.
    """

    carts: Any
    racks = Array(CyclicRack, 3)

    def equations(self):
        yield from super().equations()
        for rack, cart in zip(self.racks, self.carts, strict=True):
            yield connect(rack.flange_b, cart.axis)


class GantryTauOnRacks(WithRacks, GantryTau):
    """The three-link robot on racks."""


class SixLinkOnRacks(WithRacks, SixLinkGantryTau):
    """The six-link robot on racks."""


class F1OnScrews(F1GantryTau):
    """The F1 whose turntables are turned by ball screws: `screws[k].base`, `.crank`, `.angle`, `.lead`.

    `screws[k].flange_a.phi` is the angle of the motor; the angle of the turntable follows by the law of cosines. The
    thesis prints no numbers of these drives; those of `ScrewLever` are an example.
    """

    screws = Array(ScrewLever, 3)

    def equations(self):
        yield from super().equations()
        for screw, turntable in zip(self.screws, self.turntables, strict=True):
            yield connect(screw.flange_b, turntable.joint.axis)


class SaggingArm(Model):
    """One arm: a cart at position s, and a link that is elastic along its axis."""

    length = Parameter(unit="m", min=0.0, description="length of the link without force")
    offset = Parameter(shape=3, unit="m", description="joint on the cart at s = 0 (4.7)")
    direction = Parameter(shape=3, unit="1", description="axis of the guideway")
    compliance = Parameter(0.0, unit="m/N", description="of link, joints and cart, 0 where they are stiff")
    s = Input(unit="m", description="position of the cart", start=1.0)
    stretched = Real(unit="m", description="length of the link under force", start=2.0)
    f = Real(unit="N", description="force in the link, positive for tension")


class SaggingTool(Model):
    """The tool point of a plate that keeps its orientation."""

    r = Real(3, unit="m", description="position, resolved in the world")


class SaggingGantryTau(Model):
    """The three-link robot at rest, its links lengthened by the weight that they carry; moved by `arms[i].s`.

    stretched_i^2 = |T - A_i - s_i v_i|^2,  stretched_i = L_i + compliance_i f_i,  sum_i f_i u_i = m g, u_i from cart to tool

    prototype: as for `GantryTau`; further keywords modify members, as `arms=[dict(compliance=2e-6), {}, {}]`.
    """

    plate_mass = Parameter(unit="kg", min=0.0, description="mass of plate and tool")
    g = Parameter([0.0, 0.0, -9.81], unit="m/s2", description="acceleration of free fall")
    arms = Array(SaggingArm, 3)
    tool = SaggingTool()

    def __init__(self, prototype: Prototype, **modifications: Any):
        check_record(prototype, type(self).__name__)
        defaults = dict(
            plate_mass=prototype.plate_mass,
            arms=[
                dict(length=arm.length, offset=list(arm.offset), direction=list(arm.direction))
                for arm in prototype.arms
            ],
            tool=dict(r=dict(start=tool_ahead_of_carts(prototype))),
        )
        super().__init__(defaults, **modifications)

    def equations(self):
        pull = -self.plate_mass * self.g
        for arm in self.arms:
            d = self.tool.r - arm.offset - arm.s * arm.direction
            yield arm.stretched == sqrt(d.T @ d)
            yield arm.stretched == arm.length + arm.compliance * arm.f
            pull = pull + arm.f / arm.stretched * d
        yield pull == 0
