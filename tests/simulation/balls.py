"""A ball that falls on a floor and bounces, which several files of tests throw."""

from gantrytau import Discrete, Model, Parameter, Real, der, pre, reinit, when

G = 9.81  # m/s2


class Ball(Model):
    """A ball that falls on a floor and bounces."""

    g = Parameter(G, unit="m/s2", description="gravity")
    e = Parameter(0.8, unit="1", description="part of the speed that is left")
    h = Real(unit="m", description="height", start=1.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
    bounces = Discrete(0, unit="1", description="bounces so far")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -self.g
        yield when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.bounces == pre(self.bounces) + 1)
