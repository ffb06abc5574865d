"""Links one by one, and the arms that they hang on: what the six-link robots are made of.

Dressler (2012), sections 4.4 and 4.5.
"""

from collections.abc import Sequence

from gantrytau import Array, Model, Parameter, StateSelect, connect
from gantrytau.language.self_description.appearance import Slideway
from gantrytau.language.self_description.rods import RodArm, RodTurntable, SingleRod
from gantrytau.mechanics.multibody import FixedTranslation, Frame, Prismatic, SphericalSpherical
from gantrytau.mechanics.translational import Flange


class Link(Model):
    """One link from a cart to the plate, with its joints on both."""

    length = Parameter(unit="m", min=0.0, description="length between the ball joints")
    offset = Parameter(shape=3, unit="m", description="joint on the cart where s = 0, A_ij of (4.14)")
    plate_offset = Parameter(
        shape=3, unit="m", description="joint on the plate, in plate axes, B_ij of (4.14)"
    )
    mass = Parameter(0.0, unit="kg", min=0.0, description="mass, in the middle of the link")
    frame_cart = Frame()
    frame_plate = Frame()
    on_cart = FixedTranslation(r=offset)
    rod = SphericalSpherical(L=length, m=mass)
    on_plate = FixedTranslation(r=plate_offset)

    def equations(self):
        yield connect(self.frame_cart, self.on_cart.frame_a)
        yield connect(self.on_cart.frame_b, self.rod.frame_a)
        yield connect(self.rod.frame_b, self.on_plate.frame_b)
        yield connect(self.on_plate.frame_a, self.frame_plate)


class Arm(Model):
    """Guideway and links of one arm; subclasses say how many links there are.

    The links hang on frame_links, which is frame_cart itself or the frame of a turntable on it.
    """

    seat = "frame_cart.r"  # where pictures show the cart

    offset = Parameter([0.0, 0.0, 0.0], unit="m", description="cart at s = 0, A_i of (4.20)")
    direction = Parameter(
        shape=3, unit="1", description="axis of the guideway; its length is the transmission factor"
    )
    frame_a = Frame()
    frame_cart = Frame()
    frame_links = Frame()
    frame_b = Frame()
    base = FixedTranslation(r=offset, drawn=False)
    rail = Prismatic(
        drawn=False,
        n=direction,
        e=direction,
        s=dict(prefer=StateSelect.DEFAULT),
        v=dict(prefer=StateSelect.DEFAULT),
    )
    links = Array(Link, 1)
    axis = Flange()

    def equations(self):
        yield connect(self.frame_a, self.base.frame_a)
        yield connect(self.base.frame_b, self.rail.frame_a)
        yield connect(self.rail.frame_b, self.frame_cart)
        yield connect(self.rail.axis, self.axis)
        for link in self.links:
            yield connect(self.frame_links, link.frame_cart)
            yield connect(link.frame_plate, self.frame_b)

    def shapes(self):
        yield Slideway(at=self.seat, slides=True, direction="direction", coordinate="rail.s", R="frame_a.R")


class TwoLinks(Arm):
    """An arm of two links."""

    links = Array(Link, 2)


class ThreeLinks(Arm):
    """An arm of three links."""

    links = Array(Link, 3)


def arms_of(link: type[Link]) -> Array:
    """Arms of one, two and three links of a kind."""
    name = link.__name__
    kinds = {f"One{name}": 1, f"Two{name}s": 2, f"Three{name}s": 3}
    return Array(Arm, [type(kind, (Arm,), {"links": Array(link, count)})() for kind, count in kinds.items()])


def arm_of_rods(arm: int, count: int, turntables: Sequence[int] = ()) -> RodArm:
    """What `rods()` says of an arm of so many links, with turntables under them, from the cart outwards."""
    name = f"arms[{arm}]"
    links = [f"{name}.links[{j}]" for j in range(count)]
    return RodArm(
        name,
        f"carts[{arm}].s",
        f"{name}.direction",
        f"{name}.offset",
        [SingleRod(f"{link}.length", f"{link}.offset", f"{link}.plate_offset") for link in links],
        [
            RodTurntable(*(f"turntables[{k}].{part}" for part in ("phi", "axis", "offset", "orientation")))
            for k in turntables
        ],
    )
