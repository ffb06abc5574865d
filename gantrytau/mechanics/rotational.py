"""Rotation about one axis: flanges, inertias, springs, dampers, sources.

Angle phi of a flange is absolute, its torque tau is positive into the component.
"""

from gantrytau import Connector, Flow, Input, Model, Parameter, Real, der


class Flange(Connector):
    """One end of a shaft."""

    phi = Real(unit="rad", description="angle")
    tau = Flow(unit="N.m", description="cut torque, positive into the component")


class Fixed(Model):
    """A shaft end that does not turn."""

    phi = Parameter(0.0, unit="rad", description="angle")
    flange = Flange()

    def equations(self):
        yield self.flange.phi == self.phi


class Inertia(Model):
    """A turning mass."""

    J = Parameter(1.0, unit="kg.m2", min=0.0, description="moment of inertia")
    phi = Real(unit="rad", description="angle")
    w = Real(unit="rad/s", description="angular velocity")
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.phi == self.flange_a.phi
        yield self.phi == self.flange_b.phi
        yield self.w == der(self.phi)
        yield self.J * der(self.w) == self.flange_a.tau + self.flange_b.tau


class Compliant(Model):
    """Base of components between two flanges that carry one torque tau."""

    phi_rel = Real(unit="rad", description="angle from flange_a to flange_b")
    tau = Real(unit="N.m", description="torque at flange_b")
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.phi_rel == self.flange_b.phi - self.flange_a.phi
        yield self.flange_b.tau == self.tau
        yield self.flange_a.tau == -self.tau


class Spring(Compliant):
    """A linear torsion spring."""

    c = Parameter(1.0, unit="N.m/rad", description="stiffness")
    phi_rel0 = Parameter(0.0, unit="rad", description="angle without torque")

    def equations(self):
        yield from super().equations()
        yield self.tau == self.c * (self.phi_rel - self.phi_rel0)


class Damper(Compliant):
    """A linear torsion damper."""

    d = Parameter(1.0, unit="N.m.s/rad", description="damping")

    def equations(self):
        yield from super().equations()
        yield self.tau == self.d * der(self.phi_rel)


class Torque(Model):
    """A given torque on the flange."""

    tau = Input(unit="N.m", description="torque on the flange", start=0.0)
    flange = Flange()

    def equations(self):
        yield self.flange.tau == -self.tau
