"""Blocks that bound or bend a signal. Where they switch is an event of `simulate`."""

from gantrytau import Discrete, Output, Parameter, der, if_else, limit, require, when
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


class Hysteresis(Block):
    """y is `high` above `upper` and `low` below `lower`; in between it stays what it was, at the start `low`."""

    lower = Parameter(-1.0, description="input below which y is low")
    upper = Parameter(1.0, description="input above which y is high")
    low = Parameter(0.0, description="output below")
    high = Parameter(1.0, description="output above")
    above = Discrete(0.0, unit="1", description="1 if u was last above, 0 if below")

    def equations(self):
        yield require(self.upper >= self.lower, RISING)
        # the last two matter where u is outside from the start on
        yield (
            when(self.u >= self.upper, self.above == 1)
            .elsewhen(self.u <= self.lower, self.above == 0)
            .elsewhen(self.u <= self.upper, self.above == 1)
            .elsewhen(self.u >= self.lower, self.above == 0)
        )
        between = if_else(self.above > 0, self.high, self.low)
        yield self.y == if_else(
            self.u > self.upper, self.high, if_else(self.u < self.lower, self.low, between)
        )
