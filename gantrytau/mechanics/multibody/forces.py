"""Forces and torques that act on frames."""

from gantrytau import Input, Model, Real, norm_2
from gantrytau.language.self_description.appearance import ForceArrow
from gantrytau.mechanics import translational
from gantrytau.mechanics.multibody.frames import Frame, TwoFrames


class WorldForce(Model):
    """A given force on the origin of a frame, resolved in the world."""

    f = Input(3, unit="N", description="force on the frame, resolved in the world", start=0.0)
    frame_b = Frame()

    def equations(self):
        yield self.frame_b.f == -self.f
        yield self.frame_b.t == 0

    def shapes(self):
        yield ForceArrow(at="frame_b.r", force="f")


class WorldTorque(Model):
    """A given torque on a frame, resolved in the world."""

    t = Input(3, unit="N.m", description="torque on the frame, resolved in the world", start=0.0)
    frame_b = Frame()

    def equations(self):
        yield self.frame_b.f == 0
        yield self.frame_b.t == -self.t


class FrameForce(Model):
    """A given force on the origin of a frame, resolved in the frame, as of a thruster."""

    f = Input(3, unit="N", description="force on the frame, resolved in the frame", start=0.0)
    frame_b = Frame()

    def equations(self):
        yield self.frame_b.f == -(self.frame_b.R @ self.f)
        yield self.frame_b.t == 0

    def shapes(self):
        yield ForceArrow(at="frame_b.r", force="f", R="frame_b.R")


class FrameTorque(Model):
    """A given torque on a frame, resolved in the frame."""

    t = Input(3, unit="N.m", description="torque on the frame, resolved in the frame", start=0.0)
    frame_b = Frame()

    def equations(self):
        yield self.frame_b.f == 0
        yield self.frame_b.t == -(self.frame_b.R @ self.t)


class LineForce(TwoFrames):
    """A one-dimensional element, such as a spring, acts along the line between the origins of two frames.

    Connect it between flange_a and flange_b, whose distance is that of the frames.
    """

    s = Real(unit="m", description="distance between the origins", start=1.0)
    f = Real(
        3,
        unit="N",
        description="force on frame_a, resolved in the world",
        undetermined="the two frames coincide, so the line has no direction",
    )
    flange_a = translational.Flange()
    flange_b = translational.Flange()

    def equations(self):
        a, b = self.frame_a, self.frame_b
        line = b.r - a.r
        yield self.s == norm_2(line)
        yield self.flange_a.s == 0
        yield self.flange_b.s == self.s
        # not divided by s, so that nothing is said of the force where the line has no direction
        yield self.f * self.s == line * self.flange_b.f
        yield a.f == self.f
        yield b.f == -self.f
        yield a.t == 0
        yield b.t == 0
