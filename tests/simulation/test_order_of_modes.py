"""Conditions of components that are written before what they hang on."""

import numpy as np
import pytest

from gantrytau import Input, Model, Output, Parameter, Real, der, if_else, sampled, simulate, sin, time


class Lag(Model):
    """A signal that is late, and clipped."""

    T = Parameter(1.0, unit="s", description="lag")
    x = Real(unit="1", start=0.0, fixed=True, description="state")
    y = Output(unit="1", description="the state, but not above 0.4")

    def equations(self):
        yield self.T * der(self.x) == sin(time) - self.x
        yield self.y == if_else(self.x > 0.4, 0.4, self.x)


class High(Model):
    """Whether a signal is above 0.3."""

    u = Input(unit="1", description="signal")
    y = Output(unit="1", description="1 where it is, else 0")

    def equations(self):
        yield self.y == if_else(self.u > 0.3, 1, 0)


class Watch(High):
    """The same, sampled."""

    period = Parameter(0.01, unit="s", description="sampling period")
    seen = Real(unit="1", start=0.0, description="y, sampled")

    def equations(self):
        yield from super().equations()
        yield sampled(self.seen, self.y, period=self.period)


class Chain(Model):
    """A lag, seen by `high`, which is seen by `watch`."""

    lag, high, watch = Lag(), High(), Watch()

    def equations(self):
        yield self.high.u == self.lag.y
        yield self.watch.u == self.high.y


class OutOfOrder(Model):
    """The same, with `watch` before what it sees."""

    lag, watch, high = Lag(), Watch(), High()

    def equations(self):
        yield self.high.u == self.lag.y
        yield self.watch.u == self.high.y


class Backwards(Model):
    """The same, with all of it backwards."""

    watch, high, lag = Watch(), High(), Lag()

    def equations(self):
        yield self.high.u == self.lag.y
        yield self.watch.u == self.high.y


@pytest.mark.parametrize("model", [OutOfOrder, Backwards])
def test_the_order_of_components_changes_nothing(model):
    one, other = (simulate(kind(), stop=6.0, points=301) for kind in (Chain, model))
    for name in ("watch.seen", "high.y", "lag.y"):
        assert one.final(name) == pytest.approx(other.final(name), abs=1e-8)
    found = other["high.y"]
    assert np.array_equal(found, (other["lag.y"] > 0.3).astype(float))
    assert 0 < found.mean() < 1
