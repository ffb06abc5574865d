"""Motion along one axis: flanges, masses, springs, dampers, friction, sources, sensors.

Position s of a flange is absolute, its force f is positive into the component.
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
BESIDE = "a relative sensor carries no force; connect it beside a component, not in its place"


class Flange(Connector):
    """One point on an axis."""

    s = Real(unit="m", description="position along the axis")
    f = Flow(unit="N", description="cut force along the axis, positive into the component")


class Fixed(Model):
    """A point that does not move."""

    s = Parameter(0.0, unit="m", description="position along the axis")
    flange = Flange()

    def equations(self):
        yield self.flange.s == self.s


class Mass(Model):
    """A sliding point mass."""

    m = Parameter(1.0, unit="kg", min=0.0, description="mass")
    s = Real(unit="m", description="position along the axis")
    v = Real(unit="m/s", description="speed")
    flange = Flange()

    def equations(self):
        yield self.s == self.flange.s
        yield self.v == der(self.s)
        yield self.m * der(self.v) == self.flange.f


class Compliant(Model):
    """Base of components between two flanges that carry one force f, positive in tension."""

    s_rel = Real(unit="m", description="distance from flange_a to flange_b")
    f = Real(unit="N", description="force, positive in tension")
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.s_rel == self.flange_b.s - self.flange_a.s
        yield self.flange_b.f == self.f
        yield self.flange_a.f == -self.f


class Spring(Compliant):
    """A linear spring."""

    c = Parameter(1.0, unit="N/m", description="stiffness")
    s_rel0 = Parameter(0.0, unit="m", description="length without force")

    def equations(self):
        yield from super().equations()
        yield self.f == self.c * (self.s_rel - self.s_rel0)


class Damper(Compliant):
    """A linear damper."""

    d = Parameter(1.0, unit="N.s/m", description="damping")

    def equations(self):
        yield from super().equations()
        yield self.f == self.d * der(self.s_rel)


class SpringDamper(Compliant):
    """A linear spring and a linear damper side by side."""

    c = Parameter(1.0, unit="N/m", description="stiffness")
    d = Parameter(1.0, unit="N.s/m", description="damping")
    s_rel0 = Parameter(0.0, unit="m", description="length without force at rest")
    v_rel = Real(unit="m/s", description="rate of s_rel")

    def equations(self):
        yield from super().equations()
        yield self.v_rel == der(self.s_rel)
        yield self.f == self.c * (self.s_rel - self.s_rel0) + self.d * self.v_rel


class Friction(Model):
    """Base of friction against the ground; replace it to choose another law, or `Frictionless` to leave it out."""

    v = Real(unit="m/s", description="speed against the ground")
    f = Real(unit="N", description="friction force on the flange, positive against positive speed")
    flange = Flange()

    def equations(self):
        yield self.v == der(self.flange.s)
        yield self.flange.f == self.f


class Frictionless(Friction):
    """No friction."""

    def equations(self):
        yield from super().equations()
        yield self.f == 0


class TanhFriction(Friction):
    """Coulomb and viscous friction, the sign smoothed by tanh: f = f_c tanh(v / v_s) + f_v v."""

    f_c = Parameter(0.0, unit="N", min=0.0, description="Coulomb friction")
    f_v = Parameter(0.0, unit="kg/s", min=0.0, description="viscous friction")
    v_s = Parameter(0.05, unit="m/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from super().equations()
        yield self.f == self.f_c * tanh(self.v / self.v_s) + self.f_v * self.v


class LinearFriction(TanhFriction):
    """Coulomb and viscous friction, the sign smoothed piecewise linearly (Dressler 2012, Figure 3.6)."""

    def equations(self):
        yield from Friction.equations(self)
        yield self.f == self.f_c * linear_sign(self.v / self.v_s) + self.f_v * self.v


class AsymmetricFriction(Friction):
    """Coulomb and viscous friction that differ with the direction, the sign smoothed by tanh: `f_c=(6.0, 4.5)`.

    Each side counts by its share (1 + tanh(v / v_s)) / 2, so that force and slope have no jump and it brakes at any speed.
    """

    f_c = Parameter(
        [0.0, 0.0], unit="N", min=0.0, description="Coulomb friction at positive and at negative speed"
    )
    f_v = Parameter(
        [0.0, 0.0], unit="kg/s", min=0.0, description="viscous friction at positive and at negative speed"
    )
    v_s = Parameter(0.05, unit="m/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from super().equations()
        yield self.f == asymmetric_friction(self.v, self.f_c, self.f_v, self.v_s)


class StribeckFriction(TanhFriction):
    """Friction that falls from static to Coulomb with the speed (Armstrong-Helouvry 1994), the sign smoothed by tanh.

    f = (f_c + (f_s - f_c) exp(-(|v| / v_stribeck)^n)) tanh(v / v_s) + f_v v.
    |v| is smoothed alike: take v_s well below v_stribeck.
    """

    f_s = Parameter(
        TanhFriction.f_c, unit="N", min=0.0, description="static friction, at least the Coulomb friction"
    )
    v_stribeck = Parameter(
        0.1, unit="m/s", min=0.0, description="Stribeck speed, at which the fall has come to 1/e"
    )
    n = Parameter(2.0, unit="1", min=0.0, description="exponent of the Stribeck speed, usually 0.5 to 2")
    v_s = Parameter(0.005, unit="m/s", min=0.0, description="smoothing speed")

    def equations(self):
        yield from Friction.equations(self)
        yield require(
            self.f_s >= self.f_c, "expected a static friction f_s of at least the Coulomb friction f_c"
        )
        yield require(self.v_stribeck > 0, "expected a Stribeck speed above zero")
        dry = stribeck_friction(self.v, self.v_s, self.f_c, self.f_s, self.v_stribeck, self.n)
        yield self.f == dry + self.f_v * self.v


class DahlFriction(Friction):
    """Coulomb friction that gives like a spring before it slides (Dahl 1968), and viscous friction.

    z' = v - sigma_0 |v| z / f_c, f = sigma_0 z + f_v v: but for f_v it depends on the way, not on the rate.
    To and fro by X on either side costs 4 f_c (X - x tanh(X / x)) each time, x = f_c / sigma_0.
    """

    f_c = Parameter(1.0, unit="N", min=0.0, description="Coulomb friction, which long ways lead to")
    sigma_0 = Parameter(1e4, unit="N/m", min=0.0, description="stiffness before it slides")
    f_v = Parameter(0.0, unit="kg/s", min=0.0, description="viscous friction")
    z = Real(unit="m", description="deflection before sliding", start=0.0, nominal=f_c / sigma_0)

    def equations(self):
        yield from super().equations()
        yield require(self.f_c > 0, "expected a Coulomb friction f_c above zero; take Frictionless for none")
        yield require(self.sigma_0 > 0, "expected a stiffness sigma_0 above zero")
        yield der(self.z) == dahl_rate(self.v, self.z, self.sigma_0, self.f_c)
        yield self.f == self.sigma_0 * self.z + self.f_v * self.v


class StickSlipFriction(Friction):
    """Coulomb and viscous friction that sticks exactly, up to a breakaway force, in `simulate` and FMUs."""

    f_c = Parameter(0.0, unit="N", min=0.0, description="Coulomb friction")
    f_v = Parameter(0.0, unit="kg/s", min=0.0, description="viscous friction")
    f_s = Parameter(f_c, unit="N", min=0.0, description="breakaway force, at least the Coulomb friction")

    def equations(self):
        yield from super().equations()
        yield stick_slip(self.f, self.v, coulomb=self.f_c, smooth=self.f_v * self.v, breakaway=self.f_s)


class EndStop(Model):
    """Stops at both ends of a way, which push back and never pull; beside a slide as `connect(stop.flange, slide.axis)`."""

    low = Parameter(-1.0, unit="m", description="where the stop at the lower end begins")
    high = Parameter(1.0, unit="m", description="where the stop at the upper end begins")
    c = Parameter(1e6, unit="N/m", min=0.0, description="stiffness")
    a = Parameter(
        0.5,
        unit="s/m",
        min=0.0,
        description="dissipation: slope of the lost share of a speed over that speed",
    )
    s = Real(unit="m", description="position along the axis")
    f = Real(unit="N", description="force of the stop, positive against positive speed")
    flange = Flange()

    def equations(self):
        yield require(self.low < self.high, "expected the lower end below the upper one")
        yield self.s == self.flange.s
        yield self.f == end_stop(self.s, der(self.s), (self.low, self.high), self.c, self.a)
        yield self.flange.f == self.f


class Force(Model):
    """A given force that pushes the flange against the ground."""

    f = Input(unit="N", description="force on the flange, positive along the axis", start=0.0)
    flange = Flange()

    def equations(self):
        yield self.flange.f == -self.f


class Position(Model):
    """Moves the flange as a given function of time, whatever force that takes."""

    s = Input(unit="m", description="position along the axis", start=0.0)
    f = Real(unit="N", description="force that it takes, positive along the axis", undetermined=TWICE_HELD)
    flange = Flange()

    def equations(self):
        yield self.flange.s == self.s
        yield self.flange.f == -self.f


class Speed(Model):
    """Moves the flange with a given speed, whatever force that takes; its position starts at `s`, `s=Fixed(0.5)`."""

    v = Input(unit="m/s", description="speed along the axis", start=0.0)
    s = Real(unit="m", description="position along the axis", start=0.0)
    f = Real(unit="N", description="force that it takes, positive along the axis", undetermined=TWICE_HELD)
    flange = Flange()

    def equations(self):
        yield self.flange.s == self.s
        yield der(self.s) == self.v
        yield self.flange.f == -self.f


class PositionSensor(Model):
    """Measures the position of a flange."""

    s = Output(
        unit="m",
        description="position along the axis",
        undetermined="a sensor of position carries no force, so it holds nothing",
    )
    flange = Flange()

    def equations(self):
        yield self.s == self.flange.s
        yield self.flange.f == 0


class SpeedSensor(Model):
    """Measures the speed of a flange."""

    v = Output(unit="m/s", description="speed along the axis")
    flange = Flange()

    def equations(self):
        yield self.v == der(self.flange.s)
        yield self.flange.f == 0


class RelativeSensor(Model):
    """Measures distance and speed between two flanges; connect it beside what it measures, not in between."""

    s_rel = Output(unit="m", description="distance from flange_a to flange_b", undetermined=BESIDE)
    v_rel = Output(unit="m/s", description="rate of s_rel", undetermined=BESIDE)
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.s_rel == self.flange_b.s - self.flange_a.s
        yield self.v_rel == der(self.s_rel)
        yield self.flange_a.f == 0
        yield self.flange_b.f == 0


class ForceSensor(Model):
    """Measures the force passed on from flange_a to flange_b; connect it between two parts."""

    f = Output(
        unit="N",
        description="force on the part at flange_b, positive along the axis",
        undetermined="both ends of the sensor are held, or it closes a rigid loop; its force could be anything",
    )
    flange_a = Flange()
    flange_b = Flange()

    def equations(self):
        yield self.flange_a.s == self.flange_b.s
        yield self.flange_a.f == self.f
        yield self.flange_b.f == -self.f
