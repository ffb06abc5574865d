"""Circuits: pins, resistors, inductors, capacitors, sources.

The potential v of a pin is that against the Ground, its current i is positive into the component.
"""

from gantrytau import Connector, Flow, Input, Model, Parameter, Real, der, require

NO_GROUND = "no Ground holds the potential of this circuit; connect one"
NO_LOOP = "current sources and open ends leave no way for it, or two voltage sources stand side by side"


class Pin(Connector):
    """One end of a component in a circuit."""

    v = Real(unit="V", description="potential", undetermined=NO_GROUND)
    i = Flow(unit="A", description="current, positive into the component")


class Ground(Model):
    """Potential zero; every circuit needs one."""

    pin = Pin()

    def equations(self):
        yield self.pin.v == 0


class TwoPins(Model):
    """Base of components that pass a current i from pin_a to pin_b at a voltage v between them."""

    v = Real(unit="V", description="voltage from pin_a to pin_b")
    i = Real(unit="A", description="current from pin_a to pin_b")
    pin_a, pin_b = Pin(), Pin()

    def equations(self):
        yield self.v == self.pin_a.v - self.pin_b.v
        yield self.pin_a.i == self.i
        yield self.pin_b.i == -self.i


class Resistor(TwoPins):
    """A linear resistor, v = R i."""

    R = Parameter(1.0, unit="Ohm", min=0.0, description="resistance")

    def equations(self):
        yield from super().equations()
        yield self.v == self.R * self.i


class Inductor(TwoPins):
    """A linear inductor, L i' = v; i=Fixed(...) is the current at the start."""

    L = Parameter(1e-3, unit="H", min=0.0, description="inductance, above zero")

    def equations(self):
        yield require(self.L > 0, "expected an inductance L above zero; connect its pins for none")
        yield from super().equations()
        yield self.L * der(self.i) == self.v


class Capacitor(TwoPins):
    """A linear capacitor, C v' = i; v=Fixed(...) is the voltage at the start."""

    C = Parameter(1e-6, unit="F", min=0.0, description="capacitance, above zero")

    def equations(self):
        yield require(self.C > 0, "expected a capacitance C above zero; leave the component out for none")
        yield from super().equations()
        yield self.C * der(self.v) == self.i


class VoltageSource(Model):
    """A given voltage, whatever current that takes: an input, or constant as `VoltageSource(v=24.0)`."""

    v = Input(unit="V", description="voltage from pin_a to pin_b", start=0.0)
    i = Real(unit="A", description="current that it takes, positive out of pin_a", undetermined=NO_LOOP)
    pin_a, pin_b = Pin(), Pin()

    def equations(self):
        yield self.pin_a.v - self.pin_b.v == self.v
        yield self.pin_a.i == -self.i
        yield self.pin_b.i == self.i


class CurrentSource(Model):
    """A given current, whatever voltage that takes: an input, or constant as `CurrentSource(i=2.0)`."""

    i = Input(unit="A", description="current out of pin_a, back into pin_b", start=0.0)
    v = Real(unit="V", description="voltage from pin_a to pin_b that it takes")
    pin_a, pin_b = Pin(), Pin()

    def equations(self):
        yield self.v == self.pin_a.v - self.pin_b.v
        yield self.pin_a.i == -self.i
        yield self.pin_b.i == self.i
