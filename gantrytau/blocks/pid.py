"""The PID controller of the textbook, continuous and sampled, with limits that its integral knows of."""

from collections.abc import Iterator
from typing import Any

from gantrytau import Input, Model, Output, Parameter, Real, connect, der, if_else, require, sampled
from gantrytau.blocks.limiters import Limiter, Unlimited
from gantrytau.border.refusal import ModelError

KINDS = ("P", "PI", "PD", "PID")


class Pid(Model):
    """y = k (b u_s - u_m + I + D), limited: `Pid(k=3.0, T_i=0.5, T_d=0.1, limits=(-10.0, 10.0))`.

    I' = (u_s - u_m) / T_i and D = T_d (c u_s - u_m)', filtered with the time constant T_d / N (Astrom and Hagglund,
    Advanced PID Control, 2006, section 3). u_s is the set point, u_m what is measured, kind one of P, PI, PD, PID.
    At a limit the integral goes back with the time constant T_t, so that it does not wind up. Another model of the
    actuator, as a RateLimiter, is `actuator=RateLimiter(...)`. I begins at zero, D as if u_m had rested; gains and
    limits are open in their unit. Raises ModelError for another kind, and for times that are not above zero.
    """

    kind = "PID"
    k = Parameter(1.0, description="gain, in the unit of y for one of u")
    T_i = Parameter(1.0, unit="s", min=0.0, description="integral time")
    T_d = Parameter(0.1, unit="s", min=0.0, description="derivative time")
    N = Parameter(
        10.0, unit="1", min=0.0, description="T_d over the time constant of the derivative's filter"
    )
    b = Parameter(1.0, unit="1", description="weight of the set point in the proportional part")
    c = Parameter(0.0, unit="1", description="weight of the set point in the derivative part")
    T_t = Parameter(T_i, unit="s", min=0.0, description="time in which the integral goes back at a limit")
    u_s = Input(description="set point")
    u_m = Input(description="measured value")
    y = Output(description="output, within the limits")
    v = Real(description="output before the limits")
    integral = Real(description="integral part, in the unit of u", start=0.0)
    derivative = Real(description="derivative part, in the unit of u")
    filtered = Real(description="what is differentiated, filtered")
    actuator = Unlimited()

    def __init__(self, *, limits: tuple[Any, Any] | None = None, **modifications: Any):
        if not (limits is None or (isinstance(limits, (tuple, list)) and len(limits) == 2)):
            raise ModelError(
                f"{type(self).__name__}: limits: found {limits!r}, expected a pair, as (-10.0, 10.0); leave it out for none"
            )
        defaults = {} if limits is None else dict(actuator=Limiter(lower=limits[0], upper=limits[1]))
        super().__init__(defaults, **modifications)

    def equations(self):
        if self.kind not in KINDS:
            raise ModelError(f"kind: found {self.kind!r}, expected one of {', '.join(KINDS)}")
        yield self.v == self.k * (self.b * self.u_s - self.u_m + self.integral + self.derivative)
        yield connect(self.v, self.actuator.u)
        if "I" in self.kind:
            for value, name in ((self.T_i, "T_i"), (self.T_t, "T_t")):
                yield require(value > 0, f"expected {name} above zero; kind='PD' has no integral")
            yield require(self.k != 0, "expected a gain k that is not zero")
        else:
            yield self.integral == 0
        if "D" in self.kind:
            yield require(self.T_d > 0, "expected T_d above zero; kind='PI' has no derivative")
            yield require(self.N > 0, "expected N above zero")
        else:
            yield self.filtered == self._weighted()
            yield self.derivative == 0
        yield from self._memory()

    def _memory(self) -> Iterator[Any]:
        """What the integral and the filter of the derivative do, and the output."""
        if "I" in self.kind:
            yield der(self.integral) == self._integrand()
        if "D" in self.kind:
            gap = self.N * (self._weighted() - self.filtered)
            yield self.T_d * der(self.filtered) == gap
            yield self.derivative == gap
        yield connect(self.actuator.y, self.y)

    def _weighted(self) -> Any:
        """What is differentiated."""
        return self.c * self.u_s - self.u_m

    def _integrand(self) -> Any:
        """Rate of the integral, with what takes it back where the actuator does not follow."""
        too_much = (self.v - self.actuator.y) / self.k
        return (self.u_s - self.u_m) / self.T_i - too_much / self.T_t

    def initial_equations(self):
        if "D" in self.kind:
            yield self.derivative == 0


class DiscretePid(Pid):
    """The same once in a `period`: what it computes at an instant from u_s and u_m just before is held until the next.

    The integral is taken forwards, the derivative backwards (Astrom and Wittenmark, Computer-Controlled Systems, 1997,
    section 8.5). At the first instant the derivative part is zero.
    """

    period = Parameter(0.01, unit="s", min=0.0, description="from instant to instant, above zero")
    began = Real(unit="1", description="whether there was an instant before", start=0.0)

    def _memory(self) -> Iterator[Any]:
        h = self.period
        if "I" in self.kind:
            yield sampled(self.integral, self.integral + h * self._integrand(), period=h)
        if "D" in self.kind:
            now, time_constant = self._weighted(), self.T_d / self.N
            before = if_else(self.began > 0, self.filtered, now)
            share = (now - before) / (time_constant + h)
            yield self.derivative == self.T_d * share
            yield sampled(self.filtered, before + h * share, period=h)
        yield sampled(self.began, 1.0, period=h)
        yield sampled(self.y, self.actuator.y, period=h)

    def initial_equations(self):
        yield from ()
