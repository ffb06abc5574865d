"""The three-link Gantry-Tau robot: three carts on guideways, three links, a plate that cannot turn.

Dressler (2012), Figures 3.4 and 3.5. The links of one arm form a parallelogram, so they act as one link
between the cart and the tool; that the plate keeps its orientation is modelled by three passive
prismatic joints in series.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from gantrytau import Array, Input, Model, Parameter, Real, StateSelect, connect, der, outer
from gantrytau.border.refusal import ModelError, short
from gantrytau.language.self_description.appearance import Cuboid, ForceArrow, PathLine, Shape, Slideway
from gantrytau.language.self_description.rods import RodArm, Rods, SingleRod
from gantrytau.mechanics.multibody import (
    FixedTranslation,
    Frame,
    PointMass,
    Prismatic,
    SphericalSpherical,
    World,
)
from gantrytau.mechanics.translational import (
    AsymmetricFriction,
    Flange,
    Force,
    Friction,
    Frictionless,
    TanhFriction,
)
from gantrytau_models.prototypes import FlexiblePrototype, Prototype, RotatingPrototype
from gantrytau_models.quantities import Pair


class Arm(Model):
    """Guideway and link of one arm: frame_a at the base, frame_cart on the guideway, frame_b at the tool."""

    length = Parameter(unit="m", min=0.0, description="length of the link")
    offset = Parameter(
        shape=3, unit="m", description="cart at s = 0, less the place of the joint on the plate (4.7)"
    )
    direction = Parameter(
        shape=3, unit="1", description="axis of the guideway; its length is the transmission factor"
    )
    link_mass = Parameter(0.0, unit="kg", min=0.0, description="mass of the link")
    frame_a = Frame()
    frame_cart = Frame()
    frame_b = Frame()
    base = FixedTranslation(r=offset, drawn=False)
    rail = Prismatic(
        drawn=False,
        n=direction,
        e=direction,
        s=dict(prefer=StateSelect.DEFAULT),
        v=dict(prefer=StateSelect.DEFAULT),
    )
    link = SphericalSpherical(L=length, m=link_mass)
    axis = Flange()

    def equations(self):
        yield connect(self.frame_a, self.base.frame_a)
        yield connect(self.base.frame_b, self.rail.frame_a)
        yield connect(self.rail.frame_b, self.frame_cart)
        yield connect(self.frame_cart, self.link.frame_a)
        yield connect(self.link.frame_b, self.frame_b)
        yield connect(self.rail.axis, self.axis)

    def shapes(self) -> Iterator[Shape]:
        yield Slideway(at="rail.frame_a.r", direction="direction", coordinate="rail.s", R="frame_a.R")


class Cart(Model):
    """Cart and motor of one guideway: the actuator pushes, friction holds back."""

    m = Parameter(unit="kg", min=0.0, description="mass of cart and motor")
    s = Real(unit="m", description="position along the guideway")
    v = Real(unit="m/s", description="speed along the guideway")
    f = Input(unit="N", description="actuator force along the guideway, before friction", start=0.0)
    friction = Real(unit="N", description="friction force, positive against positive speed")
    body = PointMass(m=m, drawn=False)
    actuator = Force()
    law = TanhFriction()
    frame = Frame()
    axis = Flange()

    def equations(self):
        yield connect(self.frame, self.body.frame_a)
        yield connect(self.axis, self.actuator.flange)
        yield connect(self.axis, self.law.flange)
        yield self.actuator.f == self.f
        yield self.s == self.axis.s
        yield self.v == der(self.s)
        yield self.friction == self.law.f

    def shapes(self):
        yield Cuboid(at="frame.r", size=6.0, R="frame.R")


class Tool(Model):
    """The plate with its tool, a point mass that cannot turn."""

    m = Parameter(unit="kg", min=0.0, description="mass of plate and tool")
    r = Real(3, unit="m", description="position, resolved in the world", prefer=StateSelect.PREFER)
    v = Real(3, unit="m/s", description="velocity, resolved in the world", prefer=StateSelect.PREFER)
    world = outer(World)
    body = PointMass(m=m)
    x = Prismatic(n=[1.0, 0.0, 0.0], drawn=False)
    y = Prismatic(n=[0.0, 1.0, 0.0], drawn=False)
    z = Prismatic(n=[0.0, 0.0, 1.0], drawn=False)
    frame = Frame()

    def equations(self):
        # three passive joints in series hold the orientation and nothing else
        yield connect(self.world.frame_b, self.x.frame_a)
        yield connect(self.x.frame_b, self.y.frame_a)
        yield connect(self.y.frame_b, self.z.frame_a)
        yield connect(self.z.frame_b, self.body.frame_a)
        yield connect(self.body.frame_a, self.frame)
        yield self.r == self.frame.r
        yield self.v == der(self.r)

    def shapes(self):
        yield PathLine(at="r")


class GantryTau(Model):
    """The three-link Gantry-Tau robot, driven by the actuator forces `carts[i].f`.

    prototype: a record such as `prototypes.L1`; friction: the class of friction of the carts, `TanhFriction`
    or `LinearFriction`, or None for none; of a record with friction by direction `AsymmetricFriction` or a class of it.
    Further keywords modify members. Guideway directions are taken as they are, not normalised: the position of a cart is
    offset + s * direction.
    """

    plate_mass = Parameter(unit="kg", min=0.0, description="mass of plate and tool")
    world = World()
    arms = Array(Arm, 3)
    carts = Array(Cart, 3)
    tool = Tool(m=plate_mass)

    def __init__(
        self, prototype: Prototype, *, friction: type[Friction] | None = TanhFriction, **modifications
    ):
        carts = driven_carts(prototype, friction, type(self).__name__)
        defaults = dict(
            plate_mass=prototype.plate_mass,
            arms=[
                dict(
                    length=arm.length, offset=list(arm.offset), direction=list(arm.direction), link_mass=mass
                )
                for arm, mass in zip(prototype.arms, prototype.link_masses, strict=True)
            ],
            carts=carts,
            tool=dict(r=dict(start=tool_ahead_of_carts(prototype)), v=dict(start=0.0)),
        )
        super().__init__(defaults, **modifications)

    def equations(self):
        for arm, cart in zip(self.arms, self.carts, strict=True):
            yield connect(self.world.frame_b, arm.frame_a)
            yield connect(arm.frame_cart, cart.frame)
            yield connect(arm.axis, cart.axis)
            yield connect(arm.frame_b, self.tool.frame)

    def shapes(self):
        yield from forces_on_carts()

    def rods(self) -> Rods:
        """The links, one on each arm: their joints on the plate are in its tool point, as offsets say (4.7)."""
        names = [(f"arms[{i}]", f"carts[{i}].s") for i in range(3)]
        return Rods(
            [RodArm(a, s, f"{a}.direction", f"{a}.offset", [SingleRod(f"{a}.length")]) for a, s in names]
        )


def forces_on_carts() -> Iterator[ForceArrow]:
    """The actuator forces on three carts, as pictures show them."""
    for i in range(3):
        cart = f"carts[{i}]"
        yield ForceArrow(
            owner=cart, at=f"{cart}.frame.r", force=f"{cart}.f", direction=f"arms[{i}].direction"
        )


class WrongRecord(ModelError, TypeError):
    """What a robot was given is no record that describes it, or no class of friction."""


def _law(friction: type[Friction] | None, coulomb: float | Pair, viscous: float | Pair) -> Friction:
    if friction is None:
        return Frictionless()
    if issubclass(friction, AsymmetricFriction):
        pairs = [np.broadcast_to(number, 2).tolist() for number in (coulomb, viscous)]
        return friction(f_c=pairs[0], f_v=pairs[1])
    return friction(f_c=coulomb, f_v=viscous)


# a record of each kind that robots are made of
EXAMPLES = {
    Prototype: "prototypes.L1",
    RotatingPrototype: "prototypes.F1",
    FlexiblePrototype: "prototypes.L1_flexible",
}


def check_record(prototype: Any, robot: str, kind: type = Prototype) -> None:
    """ModelError for what does not describe a robot of that kind."""
    if not isinstance(prototype, kind):
        found = (
            f"{type(prototype).__name__}(name={prototype.name!r})"
            if hasattr(prototype, "name")
            else short(prototype)
        )
        raise WrongRecord(
            f"found {found}, expected a {kind.__name__} such as {EXAMPLES[kind]}; from gantrytau_models import prototypes",
            place=robot,
            argument="prototype",
        )


def driven_carts(
    prototype: Prototype | RotatingPrototype,
    friction: type[Friction] | None,
    robot: str,
    record: type = Prototype,
) -> list[dict]:
    """Modifications of the carts of a robot; ModelError for what is no such record or no friction."""
    check_record(prototype, robot, record)
    if friction is not None and not (isinstance(friction, type) and issubclass(friction, Friction)):
        raise WrongRecord(
            f"{robot}: found friction={friction!r}, expected a class such as LinearFriction, or None"
        )
    if friction and prototype.friction_by_direction():
        friction = AsymmetricFriction if friction is TanhFriction else friction
        if not issubclass(friction, AsymmetricFriction):
            raise WrongRecord(
                f"{robot}: found friction={friction.__name__} for {prototype.name}, whose friction differs with the "
                "direction, expected AsymmetricFriction or a class of it; or replace coulomb and viscous by one number each"
            )
    return [
        dict(m=mass, law=_law(friction, coulomb, viscous))
        for mass, coulomb, viscous in zip(
            prototype.cart_masses, prototype.coulomb, prototype.viscous, strict=True
        )
    ]


def tool_ahead_of_carts(prototype: Prototype) -> list[float]:
    """A guess of the tool that lies on the branch where the tool is ahead of the carts, carts at s = 1 m."""
    offset = np.mean([arm.offset for arm in prototype.arms], axis=0)
    direction = np.mean([arm.direction for arm in prototype.arms], axis=0)
    length = np.mean([arm.length for arm in prototype.arms])
    return list(offset + direction * (1.0 + 0.85 * length))
