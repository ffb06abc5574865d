"""Low-pass filters: they make a sampled reference differentiable, as an inverse model needs it.

Dressler (2012), Figure 3.2: the reference u passes through a filter, and the derivatives of its output y up
to the order of the filter are known without differentiating u:

    y + a1 y'/w + a2 y''/w^2 + ... + an y^(n)/w^n = u        (w: bandwidth)
"""

from math import comb, factorial, pi

import numpy as np

from gantrytau import Input, Model, Output, Parameter, der
from gantrytau.border.refusal import ModelError


class LowPass(Model):
    """A low-pass filter of order n with unit gain at rest: `LowPass(order=3, bandwidth=50.0, unit="m")`.

    order: 1 to 10, how often y may be differentiated; two for the forces of a rigid robot, three to have
    them without kinks. kind: "critical" (n equal real poles, no overshoot), "bessel" (hardly any
    overshoot, equal delay of all frequencies) or "butterworth" (flattest gain, overshoots). size: 0 for a
    scalar, else the length of the vector whose elements are filtered alike. unit: of u and y, open if not
    given. It starts at rest at the first value of u, by initial equations; a model that cannot stand at
    zero needs a start of u near it. With steady=False the start of y is taken, at rest all the same unless
    the model says otherwise. Raises ModelError for another order, kind or size when it is translated.
    """

    order = 3
    kind = "critical"
    size = 0
    steady = True
    bandwidth = Parameter(
        10.0, unit="rad/s", min=0.0, description="angular frequency at which the gain is 1/sqrt(2), -3 dB"
    )
    u = Input(lambda self: self.size or (), description="reference")
    y = Output(lambda self: self.size or (), description="filtered reference")

    def __init__(self, *, unit: str | None = None, **modifications):
        defaults = {} if unit is None else dict(u=dict(unit=unit), y=dict(unit=unit))
        super().__init__(defaults, **modifications)

    def equations(self):
        powers = coefficients(self.order, self.kind)
        left, derivative = self.y, self.y
        for power, coefficient in enumerate(powers[1:], start=1):
            derivative = der(derivative)
            left = left + float(coefficient) * derivative / self.bandwidth**power
        yield left == self.u

    def initial_equations(self):
        if not self.steady:
            return
        yield self.y == self.u
        derivative = self.y
        for _ in range(self.order - 1):
            derivative = der(derivative)
            yield derivative == 0


def coefficients(order: int, kind: str) -> np.ndarray:
    """Denominator of a low-pass filter, (order + 1,), rising powers of s, for a bandwidth of 1 rad/s.

    The first is 1, so the gain at rest is; at s = i the gain is 1/sqrt(2). kind: "critical", "bessel" or
    "butterworth". Raises ModelError for another order or kind.
    """
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= 10:
        raise ModelError(f"order: found {order!r}, expected a whole number from 1 to 10")
    if kind not in SHAPES:
        raise ModelError(f"kind: found {kind!r}, expected one of {', '.join(SHAPES)}")
    polynomial = SHAPES[kind](order)
    return polynomial * half_power(polynomial) ** np.arange(order + 1)


def half_power(polynomial: np.ndarray) -> float:
    """The angular frequency at which 1 / |polynomial(i w)| is 1/sqrt(2), by bisection; polynomial(0) is 1.

    The gain of all kinds here falls steadily, so there is one such frequency.
    """
    powers = 1j ** np.arange(polynomial.size) * polynomial
    below, above = 0.0, 1.0
    while abs(np.polyval(powers[::-1], above)) < 2**0.5:
        above *= 2
    while below < (middle := (below + above) / 2) < above:
        if abs(np.polyval(powers[::-1], middle)) < 2**0.5:
            below = middle
        else:
            above = middle
    return middle


def _critical(order: int) -> np.ndarray:
    """(1 + s)^n."""
    return np.array([comb(order, k) for k in range(order + 1)], dtype=float)


def _bessel(order: int) -> np.ndarray:
    """The reverse Bessel polynomial, divided by its constant term (Thomson 1949)."""
    found = [
        factorial(2 * order - k) / (2 ** (order - k) * factorial(k) * factorial(order - k))
        for k in range(order + 1)
    ]
    return np.array(found) / found[0]


def _butterworth(order: int) -> np.ndarray:
    """The poles stand evenly on the left half of the unit circle (Butterworth 1930)."""
    angles = pi * (0.5 + (np.arange(order) + 0.5) / order)
    found = np.real(np.poly(np.exp(1j * angles)))[::-1]
    return found / found[0]


SHAPES = {"critical": _critical, "bessel": _bessel, "butterworth": _butterworth}
