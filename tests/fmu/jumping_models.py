"""Models whose variables jump or switch at instants that depend on their motions."""

from gantrytau import (
    Discrete,
    Model,
    Parameter,
    Real,
    cos,
    der,
    if_else,
    mod,
    pre,
    reinit,
    terminate,
    time,
    when,
)

G = 9.81  # m/s2


class Ball(Model):
    """A ball that bounces, and how often."""

    e = Parameter(0.8, description="restitution")
    h = Real(start=1.0, fixed=True, unit="m", description="height")
    v = Real(start=0.0, fixed=True, unit="m/s", description="speed")
    n = Discrete(0.0, description="bounces")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -G
        yield when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.n == pre(self.n) + 1)


class Tank(Model):
    """Torricelli's tank, until a fifth is left."""

    h = Real(start=1.0, fixed=True, description="level")

    def equations(self):
        yield der(self.h) == -(self.h**0.5)
        yield when(self.h <= 0.25, terminate("the tank is empty: 100 % of what may flow"))


class Thermostat(Model):
    """Heats below 19, and no more above 21."""

    T = Real(start=18.0, fixed=True, description="temperature")
    on = Discrete(1.0, description="heats")

    def equations(self):
        yield der(self.T) == 10 * self.on - 0.25 * self.T
        yield when(self.T >= 21, self.on == 0).elsewhen(self.T <= 19, self.on == 1)


class Balls(Model):
    """Two balls on a rail between two walls, without loss; the second is twice as heavy."""

    x = Real(2, start=[0.2, 0.7], fixed=True, description="positions")
    v = Real(2, start=[1.0, -0.3], fixed=True, description="speeds")
    hits = Discrete(0.0, description="of each other")

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == 0 * self.x
        a, b = pre(self.v[0]), pre(self.v[1])
        yield (
            when(
                self.x[0] >= self.x[1],
                reinit(self.v[0], (-a + 4 * b) / 3),
                reinit(self.v[1], (2 * a + b) / 3),
                self.hits == pre(self.hits) + 1,
            )
            .elsewhen(self.x[0] <= 0, reinit(self.v[0], -a))
            .elsewhen(self.x[1] >= 1, reinit(self.v[1], -b))
        )


class PulsedDrive(Model):
    """A motor with inductance that is switched by a carrier of 20 Hz, up to the speed wanted."""

    i = Real(start=0.0, fixed=True, description="current")
    w = Real(start=0.0, fixed=True, description="speed")
    u = Real(description="voltage")

    def equations(self):
        share = 0.5 + 0.1 * (2.0 - self.w)
        yield self.u == if_else(mod(20 * time, 1.0) < share, 24.0, 0.0)
        yield 0.05 * der(self.i) == self.u - 2.0 * self.i - 3.0 * self.w
        yield 0.1 * der(self.w) == 3.0 * self.i - 0.5


class RelayLoop(Model):
    """A relay with hysteresis that drives a lag and an integrator round in a limit cycle."""

    side = Discrete(1.0, description="of the relay, 1 or -1")
    x = Real(start=0.0, fixed=True, description="controlled")
    v = Real(start=0.0, fixed=True, description="its rate")

    def equations(self):
        yield der(self.x) == self.v
        yield 0.2 * der(self.v) == self.side - self.v
        error = 0.3 * cos(0.4 * time) - self.x
        yield when(error < -0.1, self.side == -1).elsewhen(error > 0.1, self.side == 1)
