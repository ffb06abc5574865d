"""A mass on a rail and a discrete controller for it, for the tests of what is sampled."""

from gantrytau import Input, Model, Output, Parameter, Real, der, sampled


class Slide(Model):
    """A mass on a rail, pushed by a force."""

    m = Parameter(2.0, unit="kg", description="mass")
    x = Real(unit="m", description="position", start=1.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
    f = Input(unit="N", description="force", start=0.0)

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f


class Pd(Model):
    """A discrete PD controller."""

    period = Parameter(0.004, unit="s", description="sampling period")
    k = Parameter(50.0, unit="N/m", description="gain of the position")
    d = Parameter(5.0, unit="N.s/m", description="gain of the speed")
    wanted = Input(unit="m", description="wanted position", start=0.0)
    x = Input(unit="m", description="measured position")
    v = Input(unit="m/s", description="measured speed")
    force = Output(unit="N", description="force")

    def equations(self):
        push = self.k * (self.wanted - self.x) - self.d * self.v
        yield sampled(self.force, push, period=self.period)


class Held(Model):
    """A slide held by a discrete controller."""

    slide = Slide()
    control = Pd()

    def equations(self):
        yield self.control.x == self.slide.x
        yield self.control.v == self.slide.v
        yield self.slide.f == self.control.force
