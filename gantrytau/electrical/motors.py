"""Where a current makes a torque: the back-EMF, and the DC motor that is built on it."""

from gantrytau import Model, Parameter, Real, connect, der
from gantrytau.electrical.circuit import Inductor, Pin, Resistor, TwoPins
from gantrytau.mechanics import rotational


class Emf(TwoPins):
    """Converts without loss: v = k w, torque k i on the flange, against the ground."""

    k = Parameter(0.05, unit="N.m/A", description="torque for a current, and voltage for an angular velocity")
    w = Real(unit="rad/s", display="rpm", description="angular velocity of the flange")
    flange = rotational.Flange()

    def equations(self):
        yield from super().equations()
        yield self.w == der(self.flange.phi)
        yield self.v == self.k * self.w
        yield self.flange.tau == -self.k * self.i


class DcMotor(Model):
    """A DC motor with permanent magnets: winding of R and L, back-EMF k, rotor J, and friction of its bearings.

    `friction=dict(tau_c=..., tau_v=...)` sets Coulomb and viscous friction, of which there is none by default; any other
    of `mechanics.rotational`, as StickSlipFriction(...), takes its place.
    """

    R = Parameter(1.0, unit="Ohm", min=0.0, description="resistance of the winding")
    L = Parameter(1e-3, unit="H", min=0.0, description="inductance of the winding, above zero")
    k = Parameter(0.05, unit="N.m/A", description="torque constant, and back-EMF in V.s/rad")
    J = Parameter(1e-4, unit="kg.m2", min=0.0, description="moment of inertia of the rotor")
    i = Real(unit="A", description="current from pin_a to pin_b")
    pin_a, pin_b = Pin(), Pin()
    flange = rotational.Flange()
    resistor, inductor, emf = Resistor(R=R), Inductor(L=L), Emf(k=k)
    rotor = rotational.Inertia(J=J)
    friction = rotational.TanhFriction()

    def equations(self):
        yield connect(self.pin_a, self.resistor.pin_a)
        yield connect(self.resistor.pin_b, self.inductor.pin_a)
        yield connect(self.inductor.pin_b, self.emf.pin_a)
        yield connect(self.emf.pin_b, self.pin_b)
        yield connect(self.emf.flange, self.rotor.flange_a)
        yield connect(self.rotor.flange_a, self.friction.flange)
        yield connect(self.rotor.flange_b, self.flange)
        yield self.i == self.inductor.i
