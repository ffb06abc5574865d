"""Components that files of robots need besides those of `multibody`: origins, planar joints, followers, links."""

from typing import Any

import casadi as ca

from gantrytau import Model, Parameter, branch, connect
from gantrytau.language.self_description.appearance import Shape, Stick
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import Body, PoseSensor, Prismatic, Revolute, TwoFrames
from gantrytau.mechanics.multibody.orientation import about


class Origin(TwoFrames):
    """frame_b stands in frame_a as an <origin> says: at xyz, turned by roll, pitch and yaw about fixed axes."""

    xyz = Parameter([0.0, 0.0, 0.0], unit="m", description="place of frame_b, resolved in frame_a")
    rpy = Parameter(
        [0.0, 0.0, 0.0], unit="rad", description="roll, pitch, yaw about x, y, z of frame_a", evaluate=True
    )

    def equations(self):
        a, b = self.frame_a, self.frame_b
        x, y, z = (ca.DM.eye(3)[:, k] for k in range(3))
        turn = about(z, self.rpy[2]) @ about(y, self.rpy[1]) @ about(x, self.rpy[0])
        # half a turn has the sine 0, not 1e-16: planes stay planes
        turn = ca.floor(turn * 2**50 + 0.5) / 2**50
        arm = a.R @ self.xyz
        yield branch(a, b, forward=dict(R=a.R @ turn, w=a.w), backward=dict(R=b.R @ turn.T, w=b.w))
        yield b.r == a.r + arm
        yield a.f + b.f == 0
        yield a.t + b.t + ca.cross(arm, b.f) == 0

    def shapes(self):
        yield Stick(a="frame_a.r", b="frame_b.r")


class PlanarJoint(TwoFrames):
    """Slides along two directions of a plane and turns about its normal n, in this order."""

    n = Parameter([1.0, 0.0, 0.0], unit="1", description="normal, resolved in frame_a", evaluate=True)
    n_x = Parameter([0.0, 1.0, 0.0], unit="1", description="first direction in the plane", evaluate=True)
    n_y = Parameter([0.0, 0.0, 1.0], unit="1", description="second direction in the plane", evaluate=True)
    along_x = Prismatic(n=n_x)
    along_y = Prismatic(n=n_y)
    turn = Revolute(n=n)

    def equations(self):
        yield connect(self.frame_a, self.along_x.frame_a)
        yield connect(self.along_x.frame_b, self.along_y.frame_a)
        yield connect(self.along_y.frame_b, self.turn.frame_a)
        yield connect(self.turn.frame_b, self.frame_b)


class TurnByTurn(Model):
    """A joint that follows another: its coordinate is multiplier times that one's, and offset; nothing is lost."""

    multiplier = Parameter(1.0, unit="1", description="coordinate of flange_a for a unit of flange_b")
    offset = Parameter(0.0, unit="rad", description="coordinate of flange_a where that of flange_b is 0")
    flange_a = rotational.Flange()
    flange_b = rotational.Flange()

    def equations(self):
        (a, force_a), (b, force_b) = _axis(self.flange_a), _axis(self.flange_b)
        yield a == self.multiplier * b + self.offset
        yield force_b == -self.multiplier * force_a


class SlideBySlide(TurnByTurn):
    """One that slides after one that slides."""

    offset = Parameter(0.0, unit="m", description="coordinate of flange_a where that of flange_b is 0")
    flange_a = translational.Flange()
    flange_b = translational.Flange()


class SlideByTurn(TurnByTurn):
    """One that slides after one that turns."""

    multiplier = Parameter(1.0, unit="m/rad", description="coordinate of flange_a for a unit of flange_b")
    offset = Parameter(0.0, unit="m", description="coordinate of flange_a where that of flange_b is 0")
    flange_a = translational.Flange()


class TurnBySlide(TurnByTurn):
    """One that turns after one that slides."""

    multiplier = Parameter(1.0, unit="rad/m", description="coordinate of flange_a for a unit of flange_b")
    flange_b = translational.Flange()


class LinkBody(Body):
    """A link with a mass; seen as its <visual>s, or else as a cuboid of its inertia."""

    visuals: tuple[Shape, ...] = ()

    def shapes(self):
        yield from self.visuals or super().shapes()


class LinkFrame(PoseSensor):
    """A link without a mass: a frame, as of a tool."""

    visuals: tuple[Shape, ...] = ()

    def shapes(self):
        yield from self.visuals


def _axis(flange: Any) -> tuple[Any, Any]:
    """Coordinate and flow of a flange of either kind."""
    return (flange.phi, flange.tau) if hasattr(flange, "phi") else (flange.s, flange.f)
