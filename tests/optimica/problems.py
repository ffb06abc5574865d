"""Small problems with known answers, written as a user would write them."""

from typing import Any

from gantrytau import Fixed, Input, Model, Parameter, Real, Start, der, exp
from gantrytau_optimica import Free, Optimization, final, initial


class Mass(Model):
    """A mass of 1 kg pushed by a force, in bare numbers."""

    x = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    u = Input(unit="m/s2", description="force per mass")

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u


class FastestMass(Optimization):
    """From rest at 0 to rest at 1 in the least time."""

    mass: Any = Mass(u=dict(min=-1.0, max=1.0))
    final_time = Free(1.0, unit="s", min=0.1, max=100.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield initial(self.mass.x) == 0
        yield initial(self.mass.v) == 0
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


class VanDerPol(Model):
    """The oscillator of van der Pol with a control."""

    x1 = Real(start=0.0, fixed=True, description="speed")
    x2 = Real(start=1.0, fixed=True, description="position")
    u = Input(description="control")

    def equations(self):
        yield der(self.x1) == (1 - self.x2**2) * self.x1 - self.x2 + self.u
        yield der(self.x2) == self.x1


class BoundedOscillator(Optimization):
    """Least squares of state and control with a bound on the control."""

    oscillator = VanDerPol(u=dict(max=0.75))
    final_time = 20.0

    def integrand(self):
        o = self.oscillator
        return o.x1**2 + o.x2**2 + o.u**2


class FastestOscillator(Optimization):
    """To the origin in the least time."""

    oscillator: Any = VanDerPol(u=dict(min=-1.0, max=1.0))
    final_time: Any = Free(2.0, unit="s", min=0.2, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.oscillator.x1) == 0
        yield final(self.oscillator.x2) == 0


class LinearQuadratic(Optimization):
    """A quadratic cost between given ends, unbounded control."""

    mass = Mass(x=Fixed(1.0), v=Fixed(2.0))
    final_time = 3.0

    def integrand(self):
        m = self.mass
        return m.x**2 / self.one_m**2 + m.v**2 / self.one_v**2 + m.u**2 / self.one_u**2

    one_m = Parameter(1.0, unit="m", description="typical position")
    one_v = Parameter(1.0, unit="m/s", description="typical speed")
    one_u = Parameter(1.0, unit="m/s2", description="typical acceleration")

    def constraints(self):
        yield final(self.mass.x) == 4
        yield final(self.mass.v) == -2


class StirredTank(Model):
    """The continuously stirred tank reactor of Hicks and Ray (1971)."""

    F0, c0, T0, r, k0 = 100 / 1000 / 60, 1000.0, 350.0, 0.219, 7.2e10 / 60
    E, U, rho, Cp, dH, V = 8750.0, 915.6, 1000.0, 239.0, -5e4, 100.0
    c = Real(description="concentration", start=956.271065, fixed=True)
    T = Real(description="temperature", start=250.051971, fixed=True, max=350.0)
    Tc = Input(description="temperature of the coolant", min=230.0, max=370.0, start=350.0)

    def equations(self):
        rate = self.k0 * self.c * exp(-self.E / self.T)
        yield der(self.c) == self.F0 * (self.c0 - self.c) / self.V - rate
        yield der(self.T) == (
            self.F0 * (self.T0 - self.T) / self.V
            - self.dH / (self.rho * self.Cp) * rate
            + 2 * self.U / (self.r * self.rho * self.Cp) * (self.Tc - self.T)
        )


class Reactor(Optimization):
    """Bring the reactor to its set point."""

    tank = StirredTank()
    final_time = 150.0

    def integrand(self):
        t = self.tank
        return 1e-4 * ((338.775766 - t.c) ** 2 + (280.099198 - t.T) ** 2 + (280.0 - t.Tc) ** 2)


class LaunchedMass(Optimization):
    """A mass without force reaches x = 3 m at 2 s: the optimiser chooses its initial speed, 1.5 m/s."""

    mass = Mass(x=Fixed(0.0), v=Start(Free(1.0)), u=0.0)
    final_time = 2.0

    def objective(self):
        return (final(self.mass.x) - 3) ** 2
