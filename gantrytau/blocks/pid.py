"""The PID controller of the textbook, with limits that its integral knows of."""

from typing import Any

from gantrytau import Input, Model, Output, Parameter, Real, connect, der, require
from gantrytau.blocks.limiters import Limiter, Unlimited
from gantrytau.errors import ModelError

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
        defaults = {} if limits is None else dict(actuator=Limiter(lower=limits[0], upper=limits[1]))
        super().__init__(defaults, **modifications)

    def equations(self):
        if self.kind not in KINDS:
            raise ModelError(f"kind: found {self.kind!r}, expected one of {', '.join(KINDS)}")
        yield self.v == self.k * (self.b * self.u_s - self.u_m + self.integral + self.derivative)
        yield connect(self.v, self.actuator.u)
        yield connect(self.actuator.y, self.y)
        if "I" in self.kind:
            for value, name in ((self.T_i, "T_i"), (self.T_t, "T_t")):
                yield require(value > 0, f"expected {name} above zero; kind='PD' has no integral")
            yield require(self.k != 0, "expected a gain k that is not zero")
            too_much = (self.v - self.y) / self.k
            yield der(self.integral) == (self.u_s - self.u_m) / self.T_i - too_much / self.T_t
        else:
            yield self.integral == 0
        wanted = self.c * self.u_s - self.u_m
        if "D" in self.kind:
            yield require(self.T_d > 0, "expected T_d above zero; kind='PI' has no derivative")
            yield require(self.N > 0, "expected N above zero")
            yield self.T_d * der(self.filtered) == self.N * (wanted - self.filtered)
            yield self.derivative == self.N * (wanted - self.filtered)
        else:
            yield self.filtered == wanted
            yield self.derivative == 0

    def initial_equations(self):
        if "D" in self.kind:
            yield self.derivative == 0
