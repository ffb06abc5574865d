"""A Gantry-Tau robot with five degrees of freedom: the six links of the plate on five carts.

On two of the three guideways of the six-link robot one link gets a cart of its own. With the carts of a guideway side by
side the plate moves as that of the six-link robot does; apart they turn it about two axes besides.
"""

from typing import Any

from gantrytau import Array, StateSelect
from gantrytau.language.self_description.rods import Rods
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.mechanisms.clusters import Arm, TwoLinks, arm_of_rods
from gantrytau_models.mechanisms.gantry_tau import Cart, driven_carts
from gantrytau_models.mechanisms.six_link import (
    Plate,
    PlateOnLinks,
    links_on_guideway,
    plate_of,
    refuse_other_links,
)
from gantrytau_models.prototypes import Prototype

# guideway of each cart, and the links on it
CARTS = ((0, (0,)), (1, (0,)), (2, (0, 1)), (1, (1,)), (2, (2,)))


class FiveDofGantryTau(PlateOnLinks):
    """A Gantry-Tau robot with five carts, driven by the actuator forces `carts[i].f`.

    prototype: a record such as `prototypes.L1` with links; friction: the class of friction of the carts, or None. Carts 0
    to 2 are those of the six-link robot; cart 3 carries the second link of guideway 2 and cart 4 the third of guideway 3.
    They weigh and rub as the other cart on their guideway, which is assumed. All start side by side. The pose of
    the plate is `tool.r`, `tool.R`; of its orientation two angles can be chosen, the third follows.
    """

    arms = Array(Arm, [Arm(), Arm(), TwoLinks(), Arm(), Arm()])
    carts = Array(Cart, 5)
    tool = Plate(r=dict(prefer=StateSelect.PREFER), v=dict(prefer=StateSelect.PREFER))

    def __init__(
        self, prototype: Prototype, *, friction: type[Friction] | None = TanhFriction, **modifications: Any
    ):
        name = type(self).__name__
        carts = driven_carts(prototype, friction, name)
        refuse_other_links(prototype, name)
        arms = [(prototype.arms[k], [prototype.arms[k].links[j] for j in links]) for k, links in CARTS]
        defaults = dict(
            arms=[links_on_guideway(arm, links) for arm, links in arms],
            carts=[{**carts[k], "drawn": False} for k, _ in CARTS],
            tool=plate_of(prototype),
        )
        super().__init__(defaults, **modifications)

    def rods(self) -> Rods:
        """The links; joints on a cart have places of their own, so that of the cart is given (4.14)."""
        arms = [arm_of_rods(i, len(links)) for i, (_, links) in enumerate(CARTS)]
        return Rods(arms, given=[f"{arm.name}.offset" for arm in arms])
