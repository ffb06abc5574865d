"""The Gantry-Tau robot as it gives way: a frame that sways, arms like springs, a wrist that magnifies.

Dressler (2012), sections 6.3 and 7.2. Nothing holds the tool but springs, so carts, frame and tool all have states:
the block of `linearize(...).A` that belongs to `tool` is the robot with its carts and its frame locked.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import Array, Model, Parameter, Real, connect, der, dot, norm_2, outer, require
from gantrytau.border.checks import array
from gantrytau.border.refusal import ModelError
from gantrytau.language.self_description.appearance import Ball, ForceArrow, Stick
from gantrytau.mechanics.multibody import Frame, PointMass, Prismatic, TwoFrames, World
from gantrytau.mechanics.translational import Fixed, Friction, SpringDamper, TanhFriction
from gantrytau_models.mechanisms.gantry_tau import Arm, Cart, Tool, check_record, driven_carts
from gantrytau_models.prototypes import FlexiblePrototype, Prototype


class ElasticRod(TwoFrames):
    """A rod with a ball joint at each end that gives way along itself: f = c (|r| - L) + d d|r|/dt."""

    L = Parameter(1.0, unit="m", min=0.0, description="length without force")
    m = Parameter(0.0, unit="kg", min=0.0, description="mass, in the middle of the rod")
    c = Parameter(1e6, unit="N/m", min=0.0, description="stiffness along the rod")
    d = Parameter(0.0, unit="N.s/m", min=0.0, description="damping along the rod")
    elongation = Real(unit="m", description="length less the length without force")
    f = Real(unit="N", description="force along the rod, positive when pulled")
    energy = Real(unit="J", description="elastic energy")
    world = outer(World)

    def equations(self):
        a, b = self.frame_a, self.frame_b
        rod = b.r - a.r
        length = norm_2(rod)
        # half of the force that the mass needs comes through each end
        inertial = self.m * (der(der((a.r + b.r) / 2)) - self.world.gravity) / 2
        yield require(
            self.L > 0, "expected a length above zero; connect the frames through a Bushing instead"
        )
        yield self.elongation == length - self.L
        yield self.f == self.c * self.elongation + self.d * dot(rod, der(rod)) / length
        yield self.energy == self.c * self.elongation**2 / 2
        yield a.f == -self.f * rod / length + inertial
        yield b.f == self.f * rod / length + inertial
        yield a.t == 0
        yield b.t == 0

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")
        yield Ball(at="frame_a.r")
        yield Ball(at="frame_b.r")


class ElasticArm(Arm):
    """Guideway and elastic link of one arm: frame_a on the robot's frame, frame_b at the tool."""

    c = Parameter(unit="N/m", min=0.0, description="stiffness of lever, cart and link, along the link")
    d = Parameter(unit="N.s/m", min=0.0, description="damping along the link")
    rail = Prismatic(n=Arm.direction, e=Arm.direction, drawn=False)
    link = ElasticRod(L=Arm.length, m=Arm.link_mass, c=c, d=d)

    def shapes(self):
        yield from super().shapes()
        yield ForceArrow(at="frame_cart.r", force="rail.f", direction="direction")


class SwayingFrame(Model):
    """The frame of the robot: a mass that sways along x of the world on a spring, and carries the guideways."""

    m = Parameter(unit="kg", min=0.0, description="mass that sways")
    c = Parameter(unit="N/m", min=0.0, description="stiffness of its feet along x")
    d = Parameter(unit="N.s/m", min=0.0, description="damping of its feet along x")
    s = Real(unit="m", description="sway along x of the world")
    v = Real(unit="m/s", description="speed of the sway")
    world = outer(World)
    rail = Prismatic(n=[1.0, 0.0, 0.0], drawn=False)
    feet = SpringDamper(c=c, d=d)
    floor = Fixed()
    body = PointMass(m=m, drawn=False)
    frame_b = Frame()

    def equations(self):
        yield connect(self.world.frame_b, self.rail.frame_a)
        yield connect(self.rail.frame_b, self.body.frame_a)
        yield connect(self.rail.frame_b, self.frame_b)
        yield connect(self.floor.flange, self.feet.flange_a)
        yield connect(self.feet.flange_b, self.rail.axis)
        yield self.s == self.rail.s
        yield self.v == self.rail.v


class Gauge(Model):
    """What length gauges at the wrist see, which moves by more than the plate when the arms give way."""

    r = Real(3, unit="m", description="position of the wrist, as if the plate were there, in the world")


class Accelerometer(Model):
    """An accelerometer on the plate."""

    a = Real(3, unit="m/s2", description="acceleration of the plate without gravity, resolved in the world")


class FlexibleGantryTau(Model):
    """The three-link Gantry-Tau robot with an elastic structure, driven by the actuator forces `carts[i].f`.

    prototype: a record such as `prototypes.L1_flexible`; r: where the tool starts, (3,) in m, with no link stretched and
    the frame at rest. `frame=dict(m=, c=, d=)`, `arms=[dict(c=, d=), ...]` and `lever=` change what the record says.
    friction: as for `GantryTau`. `carts[i].s` is the position on the guideway, which sways with the frame; `tool.r` that
    of the plate, `gauge.r` that of the wrist. Raises ModelError for a record that says nothing of stiffness, and for a
    tool that the links do not reach.
    """

    plate_mass = Parameter(unit="kg", min=0.0, description="mass of plate, tool and wrist")
    lever = Parameter(
        shape=3,
        unit="1",
        description="deflection at the wrist for a unit of that of the plate, along each axis",
    )
    deflection = Real(
        3, unit="m", description="of the plate from where stiff arms would hold it, in the world"
    )
    world = World()
    frame = SwayingFrame()
    arms = Array(ElasticArm, 3)
    carts = Array(Cart, 3)
    tool = Tool(m=plate_mass)
    gauge = Gauge()
    accelerometer = Accelerometer()

    def __init__(
        self,
        prototype: FlexiblePrototype,
        *,
        r: ArrayLike = (0.9, 2.7, -0.7),
        friction: type[Friction] | None = TanhFriction,
        **modifications: Any,
    ):
        check_record(prototype, type(self).__name__, FlexiblePrototype)
        carts = driven_carts(prototype, friction, type(self).__name__)
        start = array("FlexibleGantryTau", "r", r, (3,), unit="m")
        positions = unstretched(prototype, start)
        defaults = dict(
            plate_mass=prototype.plate_mass,
            lever=list(prototype.lever),
            frame=dict(m=prototype.frame_mass, c=prototype.frame_stiffness, d=prototype.frame_damping),
            arms=[
                dict(
                    length=arm.length,
                    offset=list(arm.offset),
                    direction=list(arm.direction),
                    link_mass=prototype.link_masses[i],
                    c=prototype.arm_stiffness[i],
                    d=prototype.arm_damping[i],
                    rail=dict(s=dict(start=float(positions[i]))),
                )
                for i, arm in enumerate(prototype.arms)
            ],
            carts=carts,
            tool=dict(r=dict(start=start.tolist()), v=dict(start=0.0)),
        )
        super().__init__(defaults, **modifications)

    def equations(self):
        for arm, cart in zip(self.arms, self.carts, strict=True):
            yield connect(self.frame.frame_b, arm.frame_a)
            yield connect(arm.frame_cart, cart.frame)
            yield connect(arm.axis, cart.axis)
            yield connect(arm.frame_b, self.tool.frame)
            rod = arm.frame_b.r - arm.frame_cart.r
            # what lengthens the links, seen from the tool, to first order (5.9)
            yield dot(rod, self.deflection) == norm_2(rod) * arm.link.elongation
        yield self.gauge.r == self.tool.r + (self.lever - 1) * self.deflection
        yield self.accelerometer.a == der(self.tool.v)


def unstretched(prototype: Prototype, r: np.ndarray) -> np.ndarray:
    """Carts behind the tool at r (3,) in m with links as long as without force, (3,) in m.

    Raises ModelError for a tool that a link does not reach.
    """
    r = array("FlexibleGantryTau", "r", r, (3,), unit="m")
    positions = []
    for i, arm in enumerate(prototype.arms):
        away, along = r - np.array(arm.offset), np.array(arm.direction)
        # |away - along s| = length, the smaller root: the tool is ahead of the cart
        half, square = away @ along, along @ along
        root = half**2 - square * (away @ away - arm.length**2)
        if root < 0:
            raise ModelError(
                f"FlexibleGantryTau: found r={r.tolist()}, which link {i + 1} of {arm.length:g} m does not reach; expected "
                f"a tool nearer to the guideway of arms[{i}], whose distance is "
                f"{np.sqrt(arm.length**2 - root / square):.4g} m"
            )
        positions.append((half - np.sqrt(root)) / square)
    return np.array(positions)
