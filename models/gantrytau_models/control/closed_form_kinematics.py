"""Forward and inverse kinematics of three-link robots in closed form, with a status instead of a failure.

A link of length L_i joins the cart at A_i = offset_i + q_i direction_i to the tool at r, so |A_i - r| = L_i:
Dressler (2012), (4.8) and (4.9), for guideways that need be neither parallel nor described by unit vectors.
Out of reach the results stay finite, and so do their derivatives: they are those of the nearest point with
respect to which the square root is zero, and `status` says so.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Output, Parameter, Real, cross, dot, if_else, sqrt
from gantrytau_models.mechanisms.gantry_tau import check_record, tool_ahead_of_carts
from gantrytau_models.prototypes import Prototype

ROUNDING = 1e-24  # m2, of a square whose root is then 1e-12 m: a root at zero has no derivative
NO_PLANE = 1e-16  # m4, square of the area below which three carts count as standing in one line


class ArmGeometry(Model):
    """Guideway and link of one arm; names as of `GantryTau.arms`."""

    length = Parameter(1.0, unit="m", min=0.0, description="length of the link")
    offset = Parameter([0.0, 0.0, 0.0], unit="m", description="cart at s = 0, less the joint on the plate")
    direction = Parameter(
        [1.0, 0.0, 0.0], unit="1", description="axis of the guideway; its length is the transmission factor"
    )


class ThreeLink(Model):
    """Base of what is computed from the geometry `arms` of a three-link robot."""

    arms = Array(ArmGeometry, 3)

    def __init__(self, prototype: Prototype, **modifications):
        check_record(prototype, type(self).__name__)
        super().__init__(self._defaults(prototype), **modifications)

    def _defaults(self, prototype: Prototype) -> dict:
        return dict(
            arms=[
                dict(length=arm.length, offset=list(arm.offset), direction=list(arm.direction))
                for arm in prototype.arms
            ]
        )


class InverseKinematics(ThreeLink):
    """Positions `q` of the carts for a position `r` of the tool.

    status is 0 where they were found and 1 where a link is too short: `reach[i]` is what remains of link i
    when its cart is nearest to the tool, negative out of reach. `side[i]` chooses among the two positions
    of a cart: 1 if the tool is ahead of it along its guideway, -1 if behind.
    """

    side = Parameter([1.0, 1.0, 1.0], unit="1", min=-1.0, max=1.0, description="tool ahead of the cart: 1")
    r = Input(3, unit="m", description="position of the tool, resolved in the world")
    q = Output(3, unit="m", description="positions of the carts along their guideways")
    reach = Output(3, unit="m", description="length of each link less distance from tool to guideway")
    status = Output(unit="1", description="0: solved, 1: out of reach, then q is nearest to the tool")

    def _defaults(self, prototype: Prototype) -> dict:
        return super()._defaults(prototype) | dict(r=dict(start=tool_ahead_of_carts(prototype)))

    def equations(self):
        for i, arm in enumerate(self.arms):
            gap = self.r - arm.offset
            scale = dot(arm.direction, arm.direction)
            along = dot(gap, arm.direction) / scale  # where the cart is nearest to the tool
            away = gap - along * arm.direction
            yield self.reach[i] == arm.length - root(dot(away, away))
            ahead = root((arm.length**2 - dot(away, away)) / scale)
            yield self.q[i] == along - self.side[i] * ahead
        solved = ca.mmin(self.reach) >= 0
        yield self.status == if_else(solved, 0.0, 1.0)


class ForwardKinematics(ThreeLink):
    """The position `r` of the tool for positions `q` of the carts: where three spheres meet.

    status is 0 where it was found, 1 where the links do not meet, when `margin` is negative, and 2 where the
    three carts stand in one line. side: 1 for the tool on that side of the plane through the carts to which
    the guideways point, -1 for the other.
    """

    side = Parameter(1.0, unit="1", min=-1.0, max=1.0, description="tool ahead of the plane of the carts: 1")
    q = Input(3, unit="m", description="positions of the carts along their guideways")
    r = Output(3, unit="m", description="position of the tool, resolved in the world")
    margin = Output(unit="m2", description="square of the height of the tool over the plane of the carts")
    status = Output(unit="1", description="0: solved, 1: links do not meet, 2: carts in one line")
    normal = Real(3, unit="m2", description="normal of the plane of the carts, twice the area long")
    foot = Real(3, unit="m", description="foot of the height of the tool, from the first cart")

    def _defaults(self, prototype: Prototype) -> dict:
        q = carts_behind(prototype, tool_ahead_of_carts(prototype))
        return super()._defaults(prototype) | dict(q=dict(start=q))

    def equations(self):
        first, second, third = (arm.offset + self.q[i] * arm.direction for i, arm in enumerate(self.arms))
        lengths = [arm.length for arm in self.arms]
        d, e = second - first, third - first
        yield self.normal == cross(d, e)
        area = dot(self.normal, self.normal)
        # the foot lies on the planes in which two spheres meet
        along_d = (dot(d, d) + lengths[0] ** 2 - lengths[1] ** 2) / 2
        along_e = (dot(e, e) + lengths[0] ** 2 - lengths[2] ** 2) / 2
        in_plane = along_d * cross(e, self.normal) + along_e * cross(self.normal, d)
        yield self.foot == in_plane / ca.fmax(area, NO_PLANE)
        yield self.margin == lengths[0] ** 2 - dot(self.foot, self.foot)
        ahead = if_else(dot(self.normal, sum(arm.direction for arm in self.arms)) < 0, -1.0, 1.0)
        height = self.side * ahead * root(self.margin)
        yield self.r == first + self.foot + height / sqrt(ca.fmax(area, NO_PLANE)) * self.normal
        yield self.status == if_else(area < NO_PLANE, 2.0, if_else(self.margin >= 0, 0.0, 1.0))


def root(square: ca.SX) -> ca.SX:
    """The square root of a square of lengths; (almost) zero, with derivative zero, where that is negative."""
    return sqrt(ca.fmax(square, ROUNDING))


def carts_behind(prototype: Prototype, tool: Sequence[float]) -> list[float]:
    """Positions of the carts behind the tool, the nearest ones where a link is too short; m."""
    found = []
    for arm in prototype.arms:
        direction, gap = np.array(arm.direction), np.array(tool) - np.array(arm.offset)
        along = gap @ direction / (direction @ direction)
        away = gap - along * direction
        ahead = max(arm.length**2 - away @ away, 0.0) / (direction @ direction)
        found.append(float(along - np.sqrt(ahead)))
    return found
