"""The six-link Gantry-Tau robot with elastic links: its plate hangs on springs along the links.

The joints of a link and its tube give way one after the other. Links and joints alone are far stiffer than a robot is
found to be, whose compliance sits in levers, carts, guideways and frame: see `FlexibleGantryTau` for that.
"""

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from gantrytau import Parameter, translate
from gantrytau.language.model import merge
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.mechanisms.clusters import Link, arms_of
from gantrytau_models.mechanisms.flexible import ElasticRod
from gantrytau_models.mechanisms.six_link import SixLinkGantryTau
from gantrytau_models.prototypes import Prototype


class ElasticLink(Link):
    """One link that gives way along itself: a tube between two elastic ball joints."""

    c_joint = Parameter(115e6, unit="N/m", min=0.0, description="stiffness of each of its two ball joints")
    c_tube = Parameter(25e6, unit="N/m", min=0.0, description="stiffness of the tube, carbon, 2 m (assumed)")
    d = Parameter(0.0, unit="N.s/m", min=0.0, description="damping along the link")
    # springs in series
    rod = ElasticRod(L=Link.length, m=Link.mass, c=1 / (2 / c_joint + 1 / c_tube), d=d)


class SixGivingLinks(SixLinkGantryTau):
    """Base of six-link robots whose links give way: it starts where the robot with stiff links has its tool at r."""

    def __init__(
        self,
        prototype: Prototype,
        *,
        r: ArrayLike = (0.9, 2.7, -0.7),
        friction: type[Friction] | None = TanhFriction,
        **modifications: Any,
    ):
        stiff = translate(SixLinkGantryTau(prototype, friction=None)).evaluate({"tool.r": r})
        starts = dict(
            arms=[self._start(stiff, i) for i in range(3)],
            tool=dict(r=dict(start=list(stiff["tool.r"])), q=dict(start=list(stiff["tool.q"]))),
        )
        super().__init__(prototype, friction=friction, **merge(starts, modifications))

    def _start(self, stiff: Mapping[str, Any], i: int) -> dict[str, Any]:
        """Modifications of an arm that stands where the stiff one does."""
        return dict(rail=dict(s=dict(start=stiff[f"arms[{i}].rail.s"])))


class ElasticSixLinkGantryTau(SixGivingLinks):
    """The six-link robot with elastic links and joints, driven by the actuator forces `carts[i].f`.

    prototype, friction: as for `SixLinkGantryTau`; r: where the tool starts, (3,) in m, with no link stretched.
    `arms[i].links[j].c_joint`, `.c_tube` and `.d` are stiffness and damping. Carts and plate have states of their own.
    Raises InitializationError where the robot with stiff links cannot stand.
    """

    arms = arms_of(ElasticLink)
