"""Blocks that bound or bend a signal. Where they switch is an event of `simulate`."""

from gantrytau import Output, Parameter, der, limit, require
from gantrytau.blocks.block import Block

RISING = "expected upper >= lower; exchange the two"


class Unlimited(Block):
    """y = u: what stands in a place where a `Limiter` may stand."""

    def equations(self):
        yield self.y == self.u


class Limiter(Block):
    """y = u, at least `lower` and at most `upper`."""

    lower = Parameter(-1.0, description="smallest output")
    upper = Parameter(1.0, description="largest output")

    def equations(self):
        yield require(self.upper >= self.lower, RISING)
        yield self.y == limit(self.u, self.lower, self.upper)


class DeadZone(Block):
    """y = 0 where u is between `lower` and `upper`, else u less the one that it has passed."""

    lower = Parameter(-1.0, description="lower end of the zone")
    upper = Parameter(1.0, description="upper end of the zone")

    def equations(self):
        yield require(self.upper >= self.lower, RISING)
        yield self.y == self.u - limit(self.u, self.lower, self.upper)


class RateLimiter(Block):
    """y follows u with the time constant T, its rate at least `falling` and at most `rising`; it begins at u."""

    rising = Parameter(1.0, min=0.0, description="largest rate of y, in its unit in a second")
    falling = Parameter(lambda self: -self.rising, max=0.0, description="smallest rate of y")
    T = Parameter(1e-3, unit="s", min=0.0, description="time constant with which y follows slower inputs")
    y = Output(description="output")

    def equations(self):
        yield require(self.T > 0, "expected a time constant T above zero")
        yield der(self.y) == limit((self.u - self.y) / self.T, self.falling, self.rising)

    def initial_equations(self):
        yield self.y == self.u
