"""The Stewart platform: six legs with universal joints on the base, ball joints on the platform.

    legs[i].s * direction = r + R b_i - a_i        pose (r, R) of the platform, joints a_i on the base, b_i on it

Stewart, A platform with six degrees of freedom, Proc. Inst. Mech. Eng. 180, 1965. The legs are rigid bodies
that turn and slide; their forces are the inputs, and their lengths the driven coordinates.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, ModelError, Parameter, Real, StateSelect, connect, cross, der
from gantrytau.border.checks import array
from gantrytau.mechanics.multibody import (
    Body,
    FixedTranslation,
    Frame,
    Prismatic,
    Spherical,
    Universal,
    World,
)
from gantrytau.mechanics.multibody.orientation import of_quaternion
from gantrytau.mechanics.translational import Force
from gantrytau_models.mechanisms.six_link import Plate

PAIRING = [5, 0, 1, 2, 3, 4]  # joint of the platform for each leg

# the state of the robot is the pose of the platform, which gives the joints in closed form
PASSIVE = dict(phi=dict(prefer=StateSelect.DEFAULT), w=dict(prefer=StateSelect.DEFAULT))


class Leg(Model):
    """One leg: a cylinder on a universal joint, and a piston that slides in it up to a ball joint.

    At rest the leg points along `direction`; the first axis of its universal joint, fixed to the base, is `axis`.
    """

    base_offset = Parameter(
        shape=3, unit="m", description="universal joint on the base, resolved in the base"
    )
    platform_offset = Parameter(shape=3, unit="m", description="ball joint on the platform, resolved in it")
    direction = Parameter(
        shape=3, unit="1", description="from joint to joint where the angles are zero", evaluate=True
    )
    axis = Parameter(
        shape=3, unit="1", description="first axis of the universal joint, across direction", evaluate=True
    )
    cylinder_mass = Parameter(1.0, unit="kg", min=0.0, description="mass of the cylinder")
    cylinder_centre = Parameter(0.2, unit="m", description="its centre of mass, from the universal joint")
    cylinder_J = Parameter(
        np.zeros((3, 3)), unit="kg.m2", description="its inertia about that, in the base's axes at rest"
    )
    piston_mass = Parameter(1.0, unit="kg", min=0.0, description="mass of the piston")
    piston_centre = Parameter(0.2, unit="m", description="its centre of mass, back from the ball joint")
    piston_J = Parameter(
        np.zeros((3, 3)), unit="kg.m2", description="its inertia about that, in the base's axes at rest"
    )
    s = Real(unit="m", description="length of the leg, from joint to joint")
    v = Real(unit="m/s", description="rate of the length")
    f = Input(
        unit="N", description="force of the actuator, positive where it pushes the leg apart", start=0.0
    )
    frame_a = Frame()
    frame_b = Frame()
    base = FixedTranslation(r=base_offset)
    universal = Universal(
        n_a=axis, n_b=lambda self: cross(self.direction, self.axis), first=PASSIVE, second=PASSIVE
    )
    cylinder = Body(m=cylinder_mass, r_cm=lambda self: self.cylinder_centre * self.direction, J=cylinder_J)
    slide = Prismatic(n=direction, s=dict(prefer=StateSelect.DEFAULT), v=dict(prefer=StateSelect.DEFAULT))
    piston = Body(m=piston_mass, r_cm=lambda self: -self.piston_centre * self.direction, J=piston_J)
    ball = Spherical()
    platform = FixedTranslation(r=platform_offset)
    actuator = Force()

    def equations(self):
        yield connect(self.frame_a, self.base.frame_a)
        yield connect(self.base.frame_b, self.universal.frame_a)
        yield connect(self.universal.frame_b, self.cylinder.frame_a)
        yield connect(self.universal.frame_b, self.slide.frame_a)
        yield connect(self.slide.frame_b, self.piston.frame_a)
        yield connect(self.slide.frame_b, self.ball.frame_a)
        yield connect(self.ball.frame_b, self.platform.frame_b)
        yield connect(self.platform.frame_a, self.frame_b)
        yield connect(self.actuator.flange, self.slide.axis)
        yield self.actuator.f == self.f
        yield self.s == self.slide.s
        yield self.v == der(self.s)


class StewartPlatform(Model):
    """A platform on six legs, driven by their forces `legs[i].f`.

    base_joints, platform_joints: (6, 3) in m, in axes of the base and of the platform; home: where the platform
    is, level, when the angles of all universal joints are zero, in m. Further keywords modify members.
    The pose of the platform is `platform.r` and the unit quaternion `platform.q`; their start values (at first
    home) say where the robot starts, and the lengths `legs[i].s` follow. Fix the lengths, `legs=[dict(s=Fixed(0.9)),
    ...]`, and they decide instead. Raises ModelError for joints that are not (6, 3), or a leg without length at home.
    """

    world = World()
    legs = Array(Leg, 6)
    platform = Plate(
        free=True,
        m=10.0,
        J=np.diag([0.3, 0.3, 0.5]),
        r=dict(prefer=StateSelect.PREFER),
        q=dict(prefer=StateSelect.PREFER),
        v=dict(prefer=StateSelect.PREFER, start=0.0),
        w=dict(start=0.0),
    )

    def __init__(
        self,
        base_joints: Any = None,
        platform_joints: Any = None,
        *,
        home: Any = (0.0, 0.0, 0.8),
        **modifications: Any,
    ):
        model = type(self).__name__
        # the pairs on the platform stand between those on the base, and a leg goes to the nearer one
        below = pairs_of_joints(0.6, 0.2) if base_joints is None else base_joints
        above = pairs_of_joints(0.3, 0.2, np.pi / 3)[PAIRING] if platform_joints is None else platform_joints
        below = array(model, "base_joints", below, (6, 3), unit="m")
        above = array(model, "platform_joints", above, (6, 3), unit="m")
        home = array(model, "home", home, (3,), unit="m")
        legs = [_leg(model, k, a, b, home + b - a) for k, (a, b) in enumerate(zip(below, above, strict=True))]
        r, R = _starting_pose(modifications.get("platform"), home)
        for leg, length in zip(legs, np.linalg.norm(r + above @ R.T - below, axis=1), strict=True):
            leg["s"] = dict(start=float(length))
        super().__init__(dict(legs=legs, platform=dict(r=dict(start=list(home)))), **modifications)

    def equations(self):
        for leg in self.legs:
            yield connect(self.world.frame_b, leg.frame_a)
            yield connect(leg.frame_b, self.platform.frame_a)


def pairs_of_joints(radius: float, half: float, turn: float = 0.0) -> np.ndarray:
    """Six points on a level circle in three pairs, (6, 3) in m, anticlockwise.

    radius: m; half: half the angle between the points of a pair, rad (pi / 6 makes a regular hexagon);
    turn: direction of the first pair, rad.
    """
    angles = turn + np.repeat([0.0, 2 * np.pi / 3, 4 * np.pi / 3], 2) + np.tile([-half, half], 3)
    return radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(6)])


def _leg(model: str, number: int, below: np.ndarray, above: np.ndarray, way: np.ndarray) -> dict[str, Any]:
    """Modifications of a leg; way: from joint to joint at home, (3,) in m."""
    length = float(np.linalg.norm(way))
    if not length > 0:
        raise ModelError(
            f"{model}: the joints of legs[{number}] coincide at home, expected a leg of some length; move home"
        )
    along = way / length
    # the first axis of the universal joint is level: of a leg that stands upright along x
    level = np.cross([0.0, 0.0, 1.0], along)
    level = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-6 else np.array([1.0, 0.0, 0.0])
    level[np.abs(level) < 1e-15] = 0.0  # what rounding leaves of the cosine of a right angle
    axis = level - (level @ along) * along
    return dict(
        base_offset=list(below),
        platform_offset=list(above),
        direction=list(along),
        axis=list(axis / np.linalg.norm(axis)),
    )


def _starting_pose(platform: Any, home: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and orientation (3, 3) that modifications of the platform give as start, else home and level."""
    found = []
    for name, otherwise in (("r", home), ("q", [1.0, 0.0, 0.0, 0.0])):
        given = platform.get(name) if isinstance(platform, Mapping) else None
        value = given.get("start") if isinstance(given, Mapping) else getattr(given, "value", given)
        try:
            found.append(np.array(otherwise if value is None else value, dtype=float))
        except (TypeError, ValueError):
            found.append(np.array(otherwise))  # a formula, whose number is not known yet
    r, q = found
    return r, np.array(ca.evalf(of_quaternion(q / np.linalg.norm(q))))
