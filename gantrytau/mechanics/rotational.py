"""Rotation about one axis: flanges, inertias, springs, dampers, friction, sources, sensors.

Angle phi of a flange is absolute, its torque tau is positive into the component.
"""

from gantrytau import Connector, Flow, Input, Model, Output, Parameter, Real, der, require, stick_slip, tanh
from gantrytau.mechanics.friction_laws import (
    asymmetric_friction,
    dahl_rate,
    end_stop,
    linear_sign,
    stribeck_friction,
)

TWICE_HELD = "something else holds this flange too, as Fixed, Position or Speed; of them only one may stay"
BESIDE = "a relative sensor carries no torque; connect it beside a component, not in its place"


class Flange(Connector):
    """One end of a shaft."""

    phi = Real(unit="rad", display="deg", description="angle")
    tau = Flow(unit="N.m", description="cut torque, positive into the component")


class Fixed(Model):
    """A shaft end that does not turn."""

    phi = Parameter(0.0, unit="rad", display="deg", description="angle")
    flange = Flange()

    def equations(self):
        yield self.flange.phi == self.phi


class Inertia(Model):
    """A turning mass."""

    J = Parameter(1.0, unit="kg.m2", min=0.0, description="moment of inertia")
    phi = Real(unit="rad", display="deg", description="angle")
    w = Real(unit="rad/s", display="rpm", description="angular velocity")
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.phi == self.flange_a.phi
        yield self.phi == self.flange_b.phi
        yield self.w == der(self.phi)
        yield self.J * der(self.w) == self.flange_a.tau + self.flange_b.tau


class Compliant(Model):
    """Base of components between two flanges that carry one torque tau."""

    phi_rel = Real(unit="rad", display="deg", description="angle from flange_a to flange_b")
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
    phi_rel0 = Parameter(0.0, unit="rad", display="deg", description="angle without torque")

    def equations(self):
        yield from super().equations()
        yield self.tau == self.c * (self.phi_rel - self.phi_rel0)


class Damper(Compliant):
    """A linear torsion damper."""

    d = Parameter(1.0, unit="N.m.s/rad", description="damping")

    def equations(self):
        yield from super().equations()
        yield self.tau == self.d * der(self.phi_rel)


class SpringDamper(Compliant):
    """A linear torsion spring and a linear torsion damper side by side."""

    c = Parameter(1.0, unit="N.m/rad", description="stiffness")
    d = Parameter(1.0, unit="N.m.s/rad", description="damping")
    phi_rel0 = Parameter(0.0, unit="rad", display="deg", description="angle without torque at rest")
    w_rel = Real(unit="rad/s", description="rate of phi_rel")

    def equations(self):
        yield from super().equations()
        yield self.w_rel == der(self.phi_rel)
        yield self.tau == self.c * (self.phi_rel - self.phi_rel0) + self.d * self.w_rel


class BearingFriction(Compliant):
    """Coulomb and viscous friction between two shafts, or a shaft and its housing, the sign smoothed by tanh."""

    tau_c = Parameter(0.0, unit="N.m", min=0.0, description="Coulomb friction")
    tau_v = Parameter(0.0, unit="N.m.s/rad", min=0.0, description="viscous friction")
    w_s = Parameter(0.05, unit="rad/s", min=0.0, description="smoothing speed")
    w_rel = Real(unit="rad/s", description="rate of phi_rel")

    def equations(self):
        yield from super().equations()
        yield self.w_rel == der(self.phi_rel)
        yield self.tau == self.tau_c * tanh(self.w_rel / self.w_s) + self.tau_v * self.w_rel


class Friction(Model):
    """Base of friction against the ground; replace it to choose another law, or `Frictionless` to leave it out."""

    w = Real(unit="rad/s", description="angular velocity against the ground")
    tau = Real(unit="N.m", description="friction torque on the flange, positive against positive speed")
    flange = Flange()

    def equations(self):
        yield self.w == der(self.flange.phi)
        yield self.flange.tau == self.tau


class Frictionless(Friction):
    """No friction."""

    def equations(self):
        yield from super().equations()
        yield self.tau == 0


class TanhFriction(Friction):
    """Coulomb and viscous friction, the sign smoothed by tanh: tau = tau_c tanh(w / w_s) + tau_v w."""

    tau_c = Parameter(0.0, unit="N.m", min=0.0, description="Coulomb friction")
    tau_v = Parameter(0.0, unit="N.m.s/rad", min=0.0, description="viscous friction")
    w_s = Parameter(0.05, unit="rad/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from super().equations()
        yield self.tau == self.tau_c * tanh(self.w / self.w_s) + self.tau_v * self.w


class LinearFriction(TanhFriction):
    """Coulomb and viscous friction, the sign smoothed piecewise linearly (Dressler 2012, Figure 3.6)."""

    def equations(self):
        yield from Friction.equations(self)
        yield self.tau == self.tau_c * linear_sign(self.w / self.w_s) + self.tau_v * self.w


class AsymmetricFriction(Friction):
    """Coulomb and viscous friction that differ with the direction, the sign smoothed by tanh: `tau_c=(6.0, 4.5)`.

    Each side counts by its share (1 + tanh(w / w_s)) / 2, so that torque and slope have no jump and it brakes at any speed.
    """

    tau_c = Parameter(
        [0.0, 0.0], unit="N.m", min=0.0, description="Coulomb friction at positive and at negative speed"
    )
    tau_v = Parameter(
        [0.0, 0.0],
        unit="N.m.s/rad",
        min=0.0,
        description="viscous friction at positive and at negative speed",
    )
    w_s = Parameter(0.05, unit="rad/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from super().equations()
        yield self.tau == asymmetric_friction(self.w, self.tau_c, self.tau_v, self.w_s)


class StribeckFriction(TanhFriction):
    """Friction that falls from static to Coulomb with the speed (Armstrong-Helouvry 1994), the sign smoothed by tanh.

    tau = (tau_c + (tau_s - tau_c) exp(-(|w| / w_stribeck)^n)) tanh(w / w_s) + tau_v w.
    |w| is smoothed alike: take w_s well below w_stribeck.
    """

    tau_s = Parameter(
        TanhFriction.tau_c, unit="N.m", min=0.0, description="static friction, at least the Coulomb friction"
    )
    w_stribeck = Parameter(
        0.1, unit="rad/s", min=0.0, description="Stribeck speed, at which the fall has come to 1/e"
    )
    n = Parameter(2.0, unit="1", min=0.0, description="exponent of the Stribeck speed, usually 0.5 to 2")
    w_s = Parameter(0.005, unit="rad/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from Friction.equations(self)
        yield require(
            self.tau_s >= self.tau_c,
            "expected a static friction tau_s of at least the Coulomb friction tau_c",
        )
        yield require(self.w_stribeck > 0, "expected a Stribeck speed above zero")
        dry = stribeck_friction(self.w, self.w_s, self.tau_c, self.tau_s, self.w_stribeck, self.n)
        yield self.tau == dry + self.tau_v * self.w


class DahlFriction(Friction):
    """Coulomb friction that gives like a spring before it slides (Dahl 1968), and viscous friction.

    z' = w - sigma_0 |w| z / tau_c, tau = sigma_0 z + tau_v w: but for tau_v it depends on the way, not on the rate.
    To and fro by X on either side costs 4 tau_c (X - x tanh(X / x)) each time, x = tau_c / sigma_0.
    """

    tau_c = Parameter(1.0, unit="N.m", min=0.0, description="Coulomb friction, which long ways lead to")
    sigma_0 = Parameter(1e4, unit="N.m/rad", min=0.0, description="stiffness before it slides")
    tau_v = Parameter(0.0, unit="N.m.s/rad", min=0.0, description="viscous friction")
    z = Real(unit="rad", description="deflection before sliding", start=0.0, nominal=tau_c / sigma_0)

    def equations(self):
        yield from super().equations()
        yield require(
            self.tau_c > 0, "expected a Coulomb friction tau_c above zero; take Frictionless for none"
        )
        yield require(self.sigma_0 > 0, "expected a stiffness sigma_0 above zero")
        yield der(self.z) == dahl_rate(self.w, self.z, self.sigma_0, self.tau_c)
        yield self.tau == self.sigma_0 * self.z + self.tau_v * self.w


class StickSlipFriction(Friction):
    """Coulomb and viscous friction that sticks exactly, up to a breakaway torque, in `simulate` and FMUs."""

    tau_c = Parameter(0.0, unit="N.m", min=0.0, description="Coulomb friction")
    tau_v = Parameter(0.0, unit="N.m.s/rad", min=0.0, description="viscous friction")
    tau_s = Parameter(
        tau_c, unit="N.m", min=0.0, description="breakaway torque, at least the Coulomb friction"
    )

    def equations(self):
        yield from super().equations()
        smooth = self.tau_v * self.w
        yield stick_slip(self.tau, self.w, coulomb=self.tau_c, smooth=smooth, breakaway=self.tau_s)


class EndStop(Model):
    """Stops at both ends of a way, which push back and never pull; beside a joint as `connect(stop.flange, joint.axis)`."""

    low = Parameter(-1.0, unit="rad", display="deg", description="where the stop at the lower end begins")
    high = Parameter(1.0, unit="rad", display="deg", description="where the stop at the upper end begins")
    c = Parameter(1e4, unit="N.m/rad", min=0.0, description="stiffness")
    a = Parameter(
        0.5,
        unit="s/rad",
        min=0.0,
        description="dissipation: slope of the lost share of a speed over that speed",
    )
    phi = Real(unit="rad", display="deg", description="angle about the axis")
    tau = Real(unit="N.m", description="torque of the stop, positive against positive speed")
    flange = Flange()

    def equations(self):
        yield require(self.low < self.high, "expected the lower end below the upper one")
        yield self.phi == self.flange.phi
        yield self.tau == end_stop(self.phi, der(self.phi), (self.low, self.high), self.c, self.a)
        yield self.flange.tau == self.tau


class Torque(Model):
    """A given torque that turns the flange against the ground."""

    tau = Input(unit="N.m", description="torque on the flange, positive with the angle", start=0.0)
    flange = Flange()

    def equations(self):
        yield self.flange.tau == -self.tau


class Position(Model):
    """Turns the flange as a given function of time, whatever torque that takes."""

    phi = Input(unit="rad", display="deg", description="angle", start=0.0)
    tau = Real(
        unit="N.m", description="torque that it takes, positive with the angle", undetermined=TWICE_HELD
    )
    flange = Flange()

    def equations(self):
        yield self.flange.phi == self.phi
        yield self.flange.tau == -self.tau


class Speed(Model):
    """Turns the flange with a given speed, whatever torque that takes; its angle starts at `phi`, `phi=Fixed(0.5)`."""

    w = Input(unit="rad/s", display="rpm", description="angular velocity", start=0.0)
    phi = Real(unit="rad", display="deg", description="angle", start=0.0)
    tau = Real(
        unit="N.m", description="torque that it takes, positive with the angle", undetermined=TWICE_HELD
    )
    flange = Flange()

    def equations(self):
        yield self.flange.phi == self.phi
        yield der(self.phi) == self.w
        yield self.flange.tau == -self.tau


class AngleSensor(Model):
    """Measures the angle of a flange."""

    phi = Output(
        unit="rad",
        display="deg",
        description="angle",
        undetermined="a sensor of angle carries no torque, so it holds nothing",
    )
    flange = Flange()

    def equations(self):
        yield self.phi == self.flange.phi
        yield self.flange.tau == 0


class SpeedSensor(Model):
    """Measures the angular velocity of a flange."""

    w = Output(unit="rad/s", display="rpm", description="angular velocity")
    flange = Flange()

    def equations(self):
        yield self.w == der(self.flange.phi)
        yield self.flange.tau == 0


class RelativeSensor(Model):
    """Measures angle and speed between two flanges; connect it beside what it measures, not in between."""

    phi_rel = Output(
        unit="rad", display="deg", description="angle from flange_a to flange_b", undetermined=BESIDE
    )
    w_rel = Output(unit="rad/s", description="rate of phi_rel", undetermined=BESIDE)
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.phi_rel == self.flange_b.phi - self.flange_a.phi
        yield self.w_rel == der(self.phi_rel)
        yield self.flange_a.tau == 0
        yield self.flange_b.tau == 0


class TorqueSensor(Model):
    """Measures the torque passed on from flange_a to flange_b; connect it between two shafts."""

    tau = Output(
        unit="N.m",
        description="torque on the shaft at flange_b, positive with the angle",
        undetermined="both ends of the sensor are held, or it closes a rigid loop; its torque could be anything",
    )
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.flange_a.phi == self.flange_b.phi
        yield self.flange_a.tau == self.tau
        yield self.flange_b.tau == -self.tau
