"""The four-bar linkage: crank, coupler and rocker in a plane in space, on pivots in the ground.

    crank pin  = crank e(crank.phi)                               crank pivot (0, 0)
    rocker pin = crank pin + coupler e(coupler.phi)
               = rocker pivot + rocker e(rocker.phi)              rocker pivot (ground, 0)

All four joints are plain revolutes: three of the six conditions under which the loop closes repeat the
others, and translation finds them, however the plane lies.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    StateSelect,
    branch,
    connect,
    cross,
    der,
    norm_2,
)
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, TwoFrames, World
from gantrytau.mechanics.rotational import Torque

CRANK_START = 1.0  # rad, where nothing else is said


class Plane(TwoFrames):
    """frame_b lies in a plane: z along its normal n, x along e as far as that lies in the plane."""

    n = Parameter([0.0, 0.0, 1.0], unit="1", description="normal, resolved in frame_a", evaluate=True)
    e = Parameter([1.0, 0.0, 0.0], unit="1", description="direction of x, resolved in frame_a", evaluate=True)

    def equations(self):
        a, b = self.frame_a, self.frame_b
        y = cross(self.n, self.e)
        x = cross(y, self.n)
        turn = ca.horzcat(*(side / norm_2(side) for side in (x, y, self.n)))
        yield branch(a, b, forward=dict(R=a.R @ turn, w=a.w), backward=dict(R=b.R @ turn.T, w=b.w))
        yield b.r == a.r
        yield a.f + b.f == 0
        yield a.t + b.t == 0


class Bar(TwoFrames):
    """A rigid bar along x of its frame_a, from pin to pin."""

    length = Parameter(unit="m", min=0.0, description="from pin to pin")
    m = Parameter(1.0, unit="kg", min=0.0, description="mass")
    r_cm = Parameter(
        lambda self: ca.vertcat(self.length / 2, 0, 0),
        shape=3,
        unit="m",
        description="centre of mass, resolved in frame_a; in the middle unless set otherwise",
    )
    J = Parameter(
        lambda self: self.m * self.length**2 / 12 * ca.diag(ca.vertcat(0, 1, 1)),
        shape=(3, 3),
        unit="kg.m2",
        description="inertia about the centre of mass, in frame_a; of a slender bar unless set otherwise",
    )
    phi = Real(unit="rad", display="deg", description="angle from the line of the pivots, about the normal")
    w = Real(unit="rad/s", display="deg/s", description="angular velocity about the normal")
    body = Body(m=m, r_cm=r_cm, J=J)
    rod = FixedTranslation(r=lambda self: ca.vertcat(self.length, 0, 0))

    def equations(self):
        yield connect(self.frame_a, self.body.frame_a)
        yield connect(self.frame_a, self.rod.frame_a)
        yield connect(self.rod.frame_b, self.frame_b)
        yield self.w == der(self.phi)


class FourBar(Model):
    """A four-bar linkage, driven by the `torque` of the ground on the crank.

    ground, crank, coupler, rocker: lengths in m, the ground being the distance of the pivots; or, for the three
    bars, modifications such as `crank=dict(length=0.3, m=2.0)`. Further keywords modify members. `n` is the
    normal of the plane and `e` the direction from the crank's to the rocker's pivot; angles count from e.

    Start values of the angles choose the pose: of the two ways in which coupler and rocker can be joined it is
    the one that is nearer to the starts of `rocker.phi` and `coupler.phi`, without them the one in which the
    rocker points more as the crank does. Raises ModelError for lengths that cannot be closed.
    """

    ground = Parameter(1.0, unit="m", min=0.0, description="distance of the pivots")
    n = Parameter([0.0, -1.0, 0.0], unit="1", description="normal of the plane, resolved in the world")
    e = Parameter(
        [1.0, 0.0, 0.0], unit="1", description="from the crank's pivot to the rocker's, resolved in the world"
    )
    torque = Input(unit="N.m", description="torque of the ground on the crank, about n", start=0.0)
    world = World()
    plane = Plane(n=n, e=e)
    base = FixedTranslation(r=lambda self: ca.vertcat(self.ground, 0, 0))
    crank = Bar(length=0.3, phi=dict(prefer=StateSelect.PREFER), w=dict(prefer=StateSelect.PREFER))
    coupler = Bar(length=0.9)
    rocker = Bar(length=0.6)
    motor = Torque()
    crank_pivot = Revolute()
    crank_pin = Revolute(phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))
    rocker_pin = Revolute(phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))
    rocker_pivot = Revolute(phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))

    def __init__(
        self, ground: Any = 1.0, crank: Any = 0.3, coupler: Any = 0.9, rocker: Any = 0.6, **modifications: Any
    ):
        bars = {
            name: bar if isinstance(bar, (Mapping, Bar)) else dict(length=bar)
            for name, bar in dict(crank=crank, coupler=coupler, rocker=rocker).items()
        }
        found = [bar.modifications if isinstance(bar, Bar) else bar for bar in bars.values()]
        own = [getattr(type(self), name).modifications.get("length", 1.0) for name in bars]
        lengths = [
            _number(ground),
            *(_number(bar.get("length", one)) for bar, one in zip(found, own, strict=True)),
        ]
        _refuse_open(type(self).__name__, lengths)
        _refuse_parallel(type(self).__name__, modifications)
        angles = _closed(lengths, [_start(bar.get("phi")) for bar in found])
        defaults = {name: dict(phi=dict(start=phi)) for name, phi in zip(bars, angles, strict=True)}
        super().__init__(dict(ground=ground, **defaults), **bars, **modifications)

    def equations(self):
        yield connect(self.world.frame_b, self.plane.frame_a)
        yield connect(self.plane.frame_b, self.base.frame_a)
        yield connect(self.plane.frame_b, self.crank_pivot.frame_a)
        yield connect(self.crank_pivot.frame_b, self.crank.frame_a)
        yield connect(self.crank.frame_b, self.crank_pin.frame_a)
        yield connect(self.crank_pin.frame_b, self.coupler.frame_a)
        yield connect(self.base.frame_b, self.rocker_pivot.frame_a)
        yield connect(self.rocker_pivot.frame_b, self.rocker.frame_a)
        yield connect(self.rocker.frame_b, self.rocker_pin.frame_a)
        yield connect(self.rocker_pin.frame_b, self.coupler.frame_b)
        yield connect(self.motor.flange, self.crank_pivot.axis)
        yield self.motor.tau == self.torque
        yield self.crank.phi == self.crank_pivot.phi
        yield self.coupler.phi == self.crank.phi + self.crank_pin.phi
        yield self.rocker.phi == self.rocker_pivot.phi


def _number(value: Any, otherwise: float = 1.0) -> float:
    """A length as a number, if need be the guess of one that is free; `otherwise` where it is a formula."""
    try:
        return float(getattr(value, "value", value))
    except (TypeError, ValueError):
        return otherwise


def _start(phi: Any) -> float | None:
    """The start that a modification of an angle gives, or None."""
    found = phi.get("start") if isinstance(phi, Mapping) else phi
    return None if found is None else _number(found)


def _refuse_open(model: str, lengths: Sequence[float]) -> None:
    """ModelError where one length is not less than the other three together."""
    names = ("ground", "crank", "coupler", "rocker")
    longest = int(np.argmax(lengths))
    others = sum(lengths) - lengths[longest]
    if not lengths[longest] < others:
        raise ModelError(
            f"{model}: found {names[longest]} = {lengths[longest]:g} m, expected less than {others:g} m, the other "
            "three lengths together: the loop cannot close. Shorten it, or lengthen another bar"
        )


def _refuse_parallel(model: str, modifications: Mapping[str, Any]) -> None:
    """ModelError where the line of the pivots is given along the normal of the plane."""
    n, e = (modifications.get(name, getattr(FourBar, name).value) for name in ("n", "e"))
    try:
        n, e = np.array(n, dtype=float), np.array(e, dtype=float)
        across = np.linalg.norm(np.cross(n, e))
    except (TypeError, ValueError):
        return  # formulas and wrong shapes are judged when the model is translated
    if not across > 1e-9 * np.linalg.norm(n) * np.linalg.norm(e):
        raise ModelError(
            f"{model}: found n = {n.tolist()} and e = {e.tolist()}, expected vectors that are not zero and not "
            "parallel; e points from the crank's pivot to the rocker's, across the normal n"
        )


def _closed(lengths: Sequence[float], starts: Sequence[float | None]) -> list[float]:
    """Angles of crank, coupler and rocker where the loop is closed, near the given starts."""
    ground, a, b, c = lengths
    theta = CRANK_START if starts[0] is None else starts[0]
    near = starts[1:] if any(s is not None for s in starts[1:]) else [None, theta]
    across = np.array([ground - a * np.cos(theta), -a * np.sin(theta)])
    distance = np.hypot(*across)
    cosine = (b**2 + distance**2 - c**2) / (2 * b * distance)
    # out of reach: not quite straight, so that it is clear to which side
    flat = 1 <= abs(cosine) < 1 + 1e-9  # straight, up to rounding
    bend = np.arccos(cosine if abs(cosine) < 1 else np.sign(cosine) * (1.0 if flat else 0.99))
    poses = []
    for side in (1.0, -1.0):
        phi = np.arctan2(across[1], across[0]) + side * bend
        pin = b * np.array([np.cos(phi), np.sin(phi)]) - across
        pose = [phi, np.arctan2(pin[1], pin[0])]
        # of the angles that say the same the one nearest to the start
        turns = [0 if s is None else round((s - x) / (2 * np.pi)) for x, s in zip(pose, near, strict=True)]
        poses.append([x + 2 * np.pi * k for x, k in zip(pose, turns, strict=True)])
    away = [sum(abs(x - s) for x, s in zip(pose, near, strict=True) if s is not None) for pose in poses]
    return [theta, *(float(x) for x in poses[int(np.argmin(away))])]
