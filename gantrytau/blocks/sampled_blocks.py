"""Blocks that act at instants, once in a period, and hold their output in between.

What is sampled at one instant sees the values before it: a block behind another one is a period behind.
"""

from casadi import vertcat

from gantrytau import Parameter, Real, if_else, limit, sampled, time
from gantrytau.blocks.block import Block
from gantrytau.blocks.rational import Rational


class SampleHold(Block):
    """y is u as it was at the last instant."""

    period = Parameter(0.01, unit="s", min=0.0, description="from instant to instant, above zero")

    def equations(self):
        yield sampled(self.y, self.u, period=self.period)


class DiscreteTransferFunction(Rational):
    """y = (b0 z^m + ... + bm) / (a0 z^n + ... + an) u, m <= n: as `numerator=[0.1], denominator=[1, -0.9]`.

    Both in falling powers of z, from sample to sample. Raises ModelError where m > n or a0 = 0.
    """

    period = Parameter(0.01, unit="s", min=0.0, description="from instant to instant, above zero")
    x = Real(lambda self: max(1, self.denominator.shape[0] - 1), description="state", start=0.0)

    def equations(self):
        yield from super().equations()
        b, a = ([c / self.denominator[0] for c in side] for side in self.coefficients())
        # direct form II, transposed: y = b0 u + x1; x1 = b1 u - a1 y + x2, ..., xn = bn u - an y
        y = b[0] * self.u + self.x[0]
        behind = [*self.x.elements()[1:], 0.0]
        memory = (bk * self.u - ak * y + x for bk, ak, x in zip(b[1:], a[1:], behind, strict=True))
        yield sampled(self.x, vertcat(*memory), period=self.period)
        yield sampled(self.y, y, period=self.period)


class PulseWidth(Block):
    """y = amplitude in the first part u of each period, else zero: u, within 0 and 1, is taken as the period begins."""

    amplitude = Parameter(1.0, description="height of the pulses")
    period = Parameter(1e-3, unit="s", min=0.0, description="from pulse to pulse, above zero")
    end = Real(unit="s", description="end of the pulse", start=0.0)

    def equations(self):
        yield sampled(self.end, time + limit(self.u, 0, 1) * self.period, period=self.period)
        yield self.y == if_else(time < self.end, self.amplitude, 0)
