"""The six-link Gantry-Tau robot: the plate is a rigid body that six links hold.

Dressler (2012), section 4.4. Where the links of an arm are exactly parallel and of equal length the plate
keeps its orientation; offsets and lengths of their own make this the kinematic error model of (4.14).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from gantrytau import Array, Model, Real, StateSelect, connect
from gantrytau.border.refusal import ModelError
from gantrytau.language.self_description.appearance import Cuboid, ForceArrow, PathLine, Shape, Stick, Triad
from gantrytau.language.self_description.rods import Rods
from gantrytau.mechanics.multibody import Body, World
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.mechanisms.clusters import Arm, ThreeLinks, TwoLinks, arm_of_rods
from gantrytau_models.mechanisms.gantry_tau import Cart, driven_carts, tool_ahead_of_carts
from gantrytau_models.prototypes import Arm as Record
from gantrytau_models.prototypes import Link, Prototype

SEAT = "links[0].on_cart.frame_b.r"  # the first joint on a cart


class Plate(Body):
    """The plate with its tool, a rigid body that only the links hold."""

    R = Real((3, 3), unit="1", description="orientation, world = R @ plate")

    def equations(self):
        yield from super().equations()
        yield self.R == self.frame_a.R

    def shapes(self) -> Iterator[Shape]:
        yield from super().shapes()
        yield PathLine(at="r")
        yield Triad(at="r", R="R")


class PlateOnLinks(Model):
    """A plate on links, arm by arm, each with a cart on its guideway."""

    world = World()
    arms: Array
    carts: Array
    tool: Plate

    def equations(self):
        for arm, cart in zip(self.arms, self.carts, strict=True):
            yield connect(self.world.frame_b, arm.frame_a)
            yield connect(arm.frame_cart, cart.frame)
            yield connect(arm.frame_cart, arm.frame_links)
            yield connect(arm.axis, cart.axis)
            yield connect(arm.frame_b, self.tool.frame_a)

    def shapes(self):
        # offsets of the links are from the origin: carts are shown where their joints are
        for i, each in enumerate(self.arms):
            arm, cart, seat = f"arms[{i}]", f"carts[{i}]", f"arms[{i}].{SEAT}"
            yield Cuboid(owner=cart, at=seat, size=6.0, R=f"{arm}.frame_cart.R")
            yield ForceArrow(owner=cart, at=seat, force=f"{cart}.f", direction=f"{arm}.direction")
            for j in range(1, len(each.links)):
                yield Stick(owner=cart, a=seat, b=f"{arm}.links[{j}].on_cart.frame_b.r")


class SixLinkGantryTau(PlateOnLinks):
    """The six-link Gantry-Tau robot, driven by the actuator forces `carts[i].f`.

    prototype: a record such as `prototypes.L1` with links; friction: the class of friction of the carts, or
    None. Further keywords modify members. `tool.r`, `tool.v`, `tool.w` and `tool.R` are the pose of the plate;
    lengths and offsets are the parameters `arms[i].links[j].length`, `.offset`, `.plate_offset`.
    """

    arms = Array(Arm, [Arm(), TwoLinks(), ThreeLinks()])
    carts = Array(Cart, 3)
    tool = Plate(r=dict(prefer=StateSelect.PREFER), v=dict(prefer=StateSelect.PREFER))

    def __init__(
        self, prototype: Prototype, *, friction: type[Friction] | None = TanhFriction, **modifications
    ):
        name = type(self).__name__
        carts = driven_carts(prototype, friction, name)
        refuse_other_links(prototype, name)
        defaults = dict(
            arms=[links_on_guideway(arm, arm.links) for arm in prototype.arms],
            carts=[{**cart, "drawn": False} for cart in carts],
            tool=plate_of(prototype),
        )
        super().__init__(defaults, **modifications)

    def rods(self) -> Rods:
        """The links; joints on a cart have places of their own, so that of the cart is given (4.14)."""
        arms = [arm_of_rods(i, i + 1) for i in range(3)]
        return Rods(arms, given=[f"{arm.name}.offset" for arm in arms])


def refuse_other_links(prototype: Prototype, robot: str) -> None:
    """ModelError for a prototype that does not have one, two and three links on its arms."""
    found = tuple(len(arm.links) for arm in prototype.arms)
    if found != (1, 2, 3):
        raise ModelError(
            f"{robot}: found {prototype.name} with {found} links on its arms, expected (1, 2, 3); write another "
            "structure as a Model of its own, of Arm and Link"
        )


def plate_of(prototype: Prototype) -> dict:
    """Modifications of the plate of a robot on six links, which starts ahead of its carts."""
    return dict(
        m=prototype.plate_mass,
        J=np.array(prototype.plate_inertia),
        r_cm=list(prototype.plate_centre),
        r=dict(start=tool_ahead_of_carts(prototype)),
        v=dict(start=0.0),
        q=dict(start=quaternion(np.array(prototype.plate_rotation))),
    )


def links_on_guideway(arm: Record, links: Sequence[Link]) -> dict:
    """Modifications of an arm with these links on the guideway of a prototype's arm."""
    each = [
        dict(
            length=link.length,
            offset=list(link.offset),
            plate_offset=list(link.plate_offset),
            mass=link.mass,
            on_cart=dict(drawn=False),
        )
        for link in links
    ]
    return dict(offset=[0.0, 0.0, 0.0], direction=list(arm.direction), links=each, seat=SEAT)


def quaternion(R: np.ndarray) -> list[float]:
    """The unit quaternion of a rotation matrix, scalar first and not negative."""
    # the largest of four times the squares of its components is safe to divide by (Shepperd, 1978)
    a = np.array([
        1 + R[0, 0] + R[1, 1] + R[2, 2],
        1 + R[0, 0] - R[1, 1] - R[2, 2],
        1 - R[0, 0] + R[1, 1] - R[2, 2],
        1 - R[0, 0] - R[1, 1] + R[2, 2],
    ])  # fmt: skip
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    p, s, t = R[1, 0] + R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2]
    rows = np.array([[a[0], x, y, z], [x, a[1], p, s], [y, p, a[2], t], [z, s, t, a[3]]])
    row = rows[int(np.argmax(a))]
    return list(row / np.linalg.norm(row) * (1.0 if row[0] >= 0 else -1.0))
