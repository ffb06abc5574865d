"""Gears: what joins two shafts, or a shaft and a slide. All are free of loss and backlash.

The housing rests on the ground, which takes up the difference of the torques. Power that enters at
flange_a leaves at flange_b: a.tau a.phi' + b.tau b.phi' = 0, and the same with b.f b.s' for a slide.
"""

from math import pi

from gantrytau import Model, Parameter, Real, connect, cos, fabs, require, sin, sqrt
from gantrytau.mechanics import rotational, translational


class IdealGear(Model):
    """A gear of two shafts: flange_a, the motor's, makes `ratio` turns for one of flange_b; negative reverses."""

    ratio = Parameter(1.0, unit="1", description="angle of flange_a for a unit of angle of flange_b")
    flange_a = rotational.Flange()
    flange_b = rotational.Flange()

    def equations(self):
        yield self.flange_a.phi == self.ratio * self.flange_b.phi
        yield self.flange_b.tau == -self.ratio * self.flange_a.tau


class ElasticGear(Model):
    """A gear whose output shaft gives way: an ideal gear, then a spring and damper on the side of flange_b."""

    ratio = Parameter(1.0, unit="1", description="turns of flange_a for one of flange_b")
    c = Parameter(1e4, unit="N.m/rad", description="stiffness seen at flange_b, flange_a held")
    d = Parameter(1.0, unit="N.m.s/rad", description="damping seen at flange_b")
    flange_a = rotational.Flange()
    flange_b = rotational.Flange()
    gear = IdealGear(ratio=ratio)
    shaft = rotational.SpringDamper(c=c, d=d)

    def equations(self):
        yield connect(self.flange_a, self.gear.flange_a)
        yield connect(self.gear.flange_b, self.shaft.flange_a)
        yield connect(self.shaft.flange_b, self.flange_b)


class RackAndPinion(Model):
    """A pinion at flange_a that moves a rack at flange_b; also a pulley with its belt, or a wheel that rolls."""

    radius = Parameter(0.1, unit="m", description="pitch radius of the pinion; negative reverses")
    flange_a = rotational.Flange()
    flange_b = translational.Flange()

    def equations(self):
        yield self.flange_b.s == self.radius * self.flange_a.phi
        yield self.flange_a.tau == -self.radius * self.flange_b.f


class CyclicRack(Model):
    """A rack whose error repeats with its pitch: flange_a goes as the motor tells it, flange_b as the cart goes.

    s_b = s_a + cosine cos(2 pi s_a / pitch) + sine sin(2 pi s_a / pitch). The error stays far below the pitch, so that the
    cart never stands still while the motor turns. Dressler (2012), section 5.3, found such errors in the racks of its D1.
    """

    pitch = Parameter(0.01, unit="m", min=0.0, description="way after which the error repeats")
    cosine = Parameter(0.0, unit="m", description="amplitude of the cosine, error at s = 0")
    sine = Parameter(0.0, unit="m", description="amplitude of the sine")
    s = Real(unit="m", description="position that the motor tells, of flange_a")
    flange_a = translational.Flange()
    flange_b = translational.Flange()

    def equations(self):
        a, b = self.flange_a, self.flange_b
        yield require(self.pitch > 0, "expected a way above zero")
        angle = 2 * pi * a.s / self.pitch
        yield self.s == a.s
        yield b.s == a.s + self.cosine * cos(angle) + self.sine * sin(angle)
        slope = 1 + 2 * pi / self.pitch * (self.sine * cos(angle) - self.cosine * sin(angle))
        yield a.f == -slope * b.f


class BallScrew(Model):
    """A spindle at flange_a that moves its nut at flange_b; the nut is kept from turning."""

    lead = Parameter(
        0.01, unit="m", description="travel of the nut for one turn; negative for a left-hand screw"
    )
    flange_a = rotational.Flange()
    flange_b = translational.Flange()

    def equations(self):
        yield self.flange_b.s == self.lead * self.flange_a.phi / (2 * pi)
        yield self.flange_a.tau == -self.lead * self.flange_b.f / (2 * pi)


class ScrewLever(Model):
    """A spindle at flange_a between two pivots, which swings a lever at flange_b: the drive of a turntable.

    length^2 = base^2 + crank^2 - 2 base crank cos(angle + phi) by the law of cosines; both angles are 0 together. At its
    dead centres, where angle + phi is 0 or pi, it moves nothing; what swings there may go through.
    `gantrytau.kinematics.TurntableScrew` has the same in numbers.
    """

    base = Parameter(
        0.3, unit="m", min=0.0, description="from the axis of the lever to the pivot of the spindle"
    )
    crank = Parameter(
        0.1, unit="m", min=0.0, description="from the axis of the lever to the pivot of the nut"
    )
    angle = Parameter(
        pi / 2, unit="rad", description="from base to crank about the axis where flange_b is at 0; -pi to pi"
    )
    lead = Parameter(0.005, unit="m", description="by which a turn lengthens the screw; negative shortens it")
    length = Real(unit="m", description="from pivot to pivot", start=0.3)
    s = Real(unit="m", description="way of the nut along the spindle, 0 where flange_b is at 0")
    lever = Real(unit="m", description="distance of the screw from the axis, with the sign of angle")
    flange_a = rotational.Flange()
    flange_b = rotational.Flange()

    def equations(self):
        a, b = self.flange_a, self.flange_b
        yield require(self.base > 0, "expected a distance above zero")
        yield require(self.crank > 0, "expected a distance above zero")
        yield require(
            fabs(sin(self.angle)) > 1e-6, "expected an angle between 0 and pi, or -pi and 0, in rad"
        )
        opening = self.angle + b.phi
        squares, product = self.base**2 + self.crank**2, 2 * self.base * self.crank
        yield self.length == sqrt(squares - product * cos(opening))
        yield self.s == self.length - sqrt(squares - product * cos(self.angle))
        yield self.lead * a.phi == 2 * pi * self.s
        yield self.lever == product / 2 * sin(opening) / self.length
        # the force in the screw is 2 pi tau / lead, and acts on the lever
        yield self.lead * b.tau == -2 * pi * self.lever * a.tau
