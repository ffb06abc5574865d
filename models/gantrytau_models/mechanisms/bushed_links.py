"""The six-link Gantry-Tau robot whose links are bodies between two `Bushing`s.

Joints give way across the link as well as along it, and the link swings and turns on them with its own mass: what the
one spring of `ElasticLink` leaves out. Along the link there is no difference but for its mass.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Parameter, connect
from gantrytau.mechanics.multibody import Body, Bushing, FixedTranslation, TwoFrames
from gantrytau_models.mechanisms.clusters import Link, arms_of
from gantrytau_models.mechanisms.elastic_links import SixGivingLinks


class BushedRod(TwoFrames):
    """A tube that is stiff across itself and gives way along itself, on an elastic joint at each end.

    Without force it has the orientation of both frames, and lies along `axis` in them.
    """

    L = Parameter(1.0, unit="m", min=0.0, description="length between the joints without force")
    m = Parameter(0.5, unit="kg", min=0.0, description="mass, evenly along it")
    radius = Parameter(0.02, unit="m", min=0.0, description="of the tube, whose wall is thin")
    axis = Parameter(
        [1.0, 0.0, 0.0], unit="1", description="unit vector from frame_a to frame_b, without force"
    )
    c_joint = Parameter(115e6, unit="N/m", min=0.0, description="stiffness of each joint, in all directions")
    c_phi = Parameter(0.0, unit="N.m/rad", min=0.0, description="stiffness of each joint against rotation")
    c_tube = Parameter(25e6, unit="N/m", min=0.0, description="stiffness of the tube along itself")
    J = Parameter(
        lambda self: tube_inertia(self.m, self.L, self.radius, self.axis),
        shape=(3, 3),
        unit="kg.m2",
        description="inertia about its middle",
    )
    c_far = Parameter(
        lambda self: softer_along(self.axis, self.c_joint, self.c_tube),
        shape=(3, 3),
        unit="N/m",
        description="stiffness of the far joint with the tube before it, in the axes of the tube",
    )
    joint_a = Bushing(c=c_joint * np.eye(3), c_phi=c_phi * np.eye(3))
    near = FixedTranslation(r=axis * L / 2)
    body = Body(m=m, J=J)
    far = FixedTranslation(r=axis * L / 2)
    joint_b = Bushing(c=c_far, c_phi=c_phi * np.eye(3))

    def equations(self):
        yield connect(self.frame_a, self.joint_a.frame_a)
        yield connect(self.joint_a.frame_b, self.near.frame_a)
        yield connect(self.near.frame_b, self.body.frame_a)
        yield connect(self.near.frame_b, self.far.frame_a)
        yield connect(self.far.frame_b, self.joint_b.frame_a)
        yield connect(self.joint_b.frame_b, self.frame_b)


def tube_inertia(m: Any, L: Any, radius: Any, axis: Any) -> Any:
    """Inertia of a thin tube about its middle, (3, 3) in kg.m2."""
    along, across = m * radius**2, m * radius**2 / 2 + m * L**2 / 12
    return across * ca.SX.eye(3) + (along - across) * (axis @ axis.T)


def softer_along(axis: Any, c_joint: Any, c_tube: Any) -> Any:
    """Stiffness of a joint, (3, 3) in N/m, in series with a tube that gives way along an axis."""
    along = 1 / (1 / c_joint + 1 / c_tube)
    return c_joint * ca.SX.eye(3) + (along - c_joint) * (axis @ axis.T)


class BushedLink(Link):
    """One link that is a body between two elastic joints."""

    axis = Parameter(
        shape=3, unit="1", description="unit vector from cart to plate, without force, in the world"
    )
    rod = BushedRod(L=Link.length, m=Link.mass, axis=axis)


class BushedSixLinkGantryTau(SixGivingLinks):
    """The six-link robot with elastic joints at both ends of its links, driven by the actuator forces `carts[i].f`.

    prototype, friction: as for `SixLinkGantryTau`; r: where the tool starts, (3,) in m, without force in any joint.
    `arms[i].links[j].rod.c_joint`, `.c_phi` and `.c_tube` are stiffnesses. Links need masses above zero; all bodies have
    states of their own. Raises InitializationError where the robot with stiff links cannot stand.
    """

    arms = arms_of(BushedLink)

    def _start(self, stiff: Mapping[str, Any], i: int) -> dict[str, Any]:
        links = [_placed(stiff, f"arms[{i}].links[{j}].rod") for j in range(i + 1)]
        return super()._start(stiff, i) | dict(links=links)


def _placed(stiff: Mapping[str, Any], rod: str) -> dict[str, Any]:
    """Modifications of a link that lies where the stiff one does."""
    near, far = stiff[f"{rod}.frame_a.r"], stiff[f"{rod}.frame_b.r"]
    axis = (far - near) / np.linalg.norm(far - near)
    return dict(axis=axis.tolist(), rod=dict(body=dict(r=dict(start=((near + far) / 2).tolist()))))
