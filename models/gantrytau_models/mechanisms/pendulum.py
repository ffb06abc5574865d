"""The pendulum in Cartesian coordinates: the smallest mechanism with a constraint (index three)."""

from gantrytau import Model, Parameter, Real, der
from gantrytau.language.self_description.appearance import Ball, PathLine, Stick


class Pendulum(Model):
    """A point mass on a massless rod, swinging in the x-y plane, y upwards, the pivot in the origin."""

    L = Parameter(1.0, unit="m", min=0.0, description="length of the rod")
    m = Parameter(1.0, unit="kg", min=0.0, description="mass")
    g = Parameter(9.81, unit="m/s2", description="acceleration of gravity")
    damping = Parameter(0.0, unit="kg/s", description="drag of the air per speed")
    x = Real(unit="m", description="horizontal position", start=0.8)
    y = Real(unit="m", description="vertical position", start=-0.6)
    v_x = Real(unit="m/s", description="horizontal speed", start=0.0)
    v_y = Real(unit="m/s", description="vertical speed", start=0.0)
    tension = Real(unit="N/m", description="force of the rod divided by its length, positive when pulled")
    kinetic_energy = Real(unit="J", description="kinetic energy")
    potential_energy = Real(unit="J", description="potential energy, zero at the height of the pivot")

    def equations(self):
        yield self.v_x == der(self.x)
        yield self.v_y == der(self.y)
        yield self.m * der(self.v_x) == -self.tension * self.x - self.damping * self.v_x
        yield self.m * der(self.v_y) == -self.tension * self.y - self.damping * self.v_y - self.m * self.g
        yield self.x**2 + self.y**2 == self.L**2
        yield self.kinetic_energy == self.m / 2 * (self.v_x**2 + self.v_y**2)
        yield self.potential_energy == self.m * self.g * self.y

    def shapes(self):
        yield Stick(a=(0.0, 0.0, 0.0), b=("x", 0.0, "y"))
        yield Ball(at=("x", 0.0, "y"), mass="m")
        yield PathLine(at=("x", 0.0, "y"))
