"""Sensors: what a frame does, what two frames do against each other, and what passes between them."""

from gantrytau import Model, Output, branch, der
from gantrytau.mechanics.multibody.frames import Frame, TwoFrames


class PoseSensor(Model):
    """Position, orientation and their rates of a frame, resolved in the world."""

    r = Output(3, unit="m", description="position of the origin, resolved in the world")
    v = Output(3, unit="m/s", description="velocity of the origin, resolved in the world")
    R = Output((3, 3), unit="1", description="orientation, world = R @ local")
    w = Output(3, unit="rad/s", description="angular velocity, resolved in the world")
    frame_a = Frame()

    def equations(self):
        a = self.frame_a
        yield self.r == a.r
        yield self.v == der(a.r)
        yield self.R == a.R
        yield self.w == a.w
        yield a.f == 0
        yield a.t == 0


class RelativeSensor(TwoFrames):
    """Pose of frame_b as seen from frame_a."""

    r = Output(3, unit="m", description="from frame_a to frame_b, resolved in frame_a")
    R = Output((3, 3), unit="1", description="orientation, frame_a = R @ frame_b")
    w = Output(3, unit="rad/s", description="angular velocity of frame_b against frame_a, in frame_a")

    def equations(self):
        a, b = self.frame_a, self.frame_b
        yield self.r == a.R.T @ (b.r - a.r)
        yield self.R == a.R.T @ b.R
        yield self.w == a.R.T @ (b.w - a.w)
        yield a.f == 0
        yield a.t == 0
        yield b.f == 0
        yield b.t == 0


class CutSensor(TwoFrames):
    """A rigid joint that measures the force and torque from frame_a to frame_b."""

    f = Output(3, unit="N", description="force from frame_a on frame_b, resolved in the frame")
    t = Output(3, unit="N.m", description="torque from frame_a on frame_b, resolved in the frame")

    def equations(self):
        a, b = self.frame_a, self.frame_b
        yield branch(a, b, forward=dict(R=a.R, w=a.w), backward=dict(R=b.R, w=b.w))
        yield b.r == a.r
        yield a.f + b.f == 0
        yield a.t + b.t == 0
        yield self.f == a.R.T @ a.f
        yield self.t == a.R.T @ a.t
