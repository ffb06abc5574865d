"""Linear blocks with a memory: integrator, derivative, lag, transfer function."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from gantrytau import Output, Parameter, Real, der, fabs, if_else, require
from gantrytau.blocks.block import Block
from gantrytau.blocks.rational import Rational


class Integrator(Block):
    """y' = k u; y begins at zero, `y=Fixed(2.0)` says otherwise."""

    k = Parameter(1.0, description="gain, in the unit of y' for one of u")
    y = Output(description="k times the integral of the input", start=0.0, fixed=True)

    def equations(self):
        yield der(self.y) == self.k * self.u


class Derivative(Block):
    """k u', filtered: y = k s / (1 + s T) u. It begins as if u had rested, so y begins at zero."""

    k = Parameter(1.0, description="gain, in the unit of y for one of u'")
    T = Parameter(0.01, unit="s", min=0.0, description="time constant of the filter, above zero")
    x = Real(description="filtered input")

    def equations(self):
        yield require(self.T > 0, "expected a time constant T above zero: a derivative alone is not proper")
        yield self.T * der(self.x) == self.u - self.x
        yield self.y == self.k * (self.u - self.x) / self.T

    def initial_equations(self):
        yield self.x == self.u


class FirstOrder(Block):
    """A lag: T y' + y = k u; y begins at zero, `y=Fixed(2.0)` says otherwise."""

    k = Parameter(1.0, description="gain at rest, in the unit of y for one of u")
    T = Parameter(1.0, unit="s", min=0.0, description="time constant")
    y = Output(description="delayed output", start=0.0, fixed=True)

    def equations(self):
        yield require(self.T > 0, "expected a time constant T above zero; a Gain has none")
        yield self.T * der(self.y) + self.y == self.k * self.u


class TransferFunction(Rational):
    """y = (b0 s^m + ... + bm) / (a0 s^n + ... + an) u, m <= n: `TransferFunction(numerator=[2.0], denominator=[0.1, 1.0])`.

    Both in falling powers of s, with s in 1/s. Raises ModelError where m > n or a0 = 0.
    """

    def equations(self):
        yield from super().equations()
        b, a = self.coefficients()
        n = len(a) - 1
        # controllable canonical form in a time scaled so that the poles stand about one
        rate = _rate(a, b[n])
        a, b = ([c / (a[0] * rate**k) for k, c in enumerate(side)] for side in (a, b))
        level = if_else(a[n] == 0, 1, a[n])  # at rest, x[0] is u
        for lower, upper in pairwise(self.x.elements()):
            yield der(lower) == rate * upper
        fed_back = _weighted(reversed(a[1:]), self.x)
        yield der(self.x[n - 1]) == rate * (level * self.u - fed_back)
        yield (
            self.y == _weighted((b[k] - b[0] * a[k] for k in range(n, 0, -1)), self.x) / level + b[0] * self.u
        )


def _rate(a: Sequence[Any], last: Any) -> Any:
    """Geometric mean of the distances from zero of the poles that are not zero, 1/s.

    Of last / (a0 s^n), the rate at which the gain is one; 1 if last is zero.
    """
    rate = if_else(last == 0, 1, fabs(last / a[0]) ** (1 / (len(a) - 1)))
    for k, coefficient in enumerate(a[1:], start=1):
        rate = if_else(coefficient == 0, rate, fabs(coefficient / a[0]) ** (1 / k))
    return rate


def _weighted(weights: Iterable[Any], values: Any) -> Any:
    """Sum of elements with weights."""
    return sum(weight * value for weight, value in zip(weights, values.elements(), strict=True))
