"""What a model states of instants: values that are sampled and held, and friction that sticks.

`sampled` and `stick_slip` are yielded by `equations(self)` like equations. A sampled variable and the force
of such a friction count as known in the equations, as inputs do; what they are is kept beside.
"""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Sampling:
    """`sampled(variable, expression, period=..., start=...)`."""

    variable: Any
    expression: Any
    period: Any
    start: Any = None


@dataclass(frozen=True, eq=False)
class Sticking:
    """`stick_slip(force, speed, coulomb=..., smooth=..., breakaway=...)`."""

    force: Any
    speed: Any
    coulomb: Any
    smooth: Any
    breakaway: Any


def sampled(variable: Any, expression: Any, *, period: Any, start: Any = None) -> Sampling:
    """State that a variable is sampled: it takes a new value every period, and holds it in between.

    variable: a declared Real or Output, scalar or vector, for which there is no other equation; expression:
    of the same shape; at t0 + k * period, k = 0, 1, ..., with t0 where the simulation starts, the variable takes
    the value that it had just before; period: s, a number or an expression of parameters; start: before the
    first instant (else the variable's own start, or zero). What is sampled at the same instant does not see
    each other's new values.
    """
    return Sampling(variable, expression, period, start)


def stick_slip(force: Any, speed: Any, *, coulomb: Any, smooth: Any, breakaway: Any) -> Sticking:
    """State friction that sticks exactly; only an FMU runs it, as its equations change at instants.

    force: a declared Real for which there is no other equation, positive against positive speed; speed: a
    declared variable. In motion force == coulomb + smooth, or -coulomb + smooth where the speed is negative; at
    rest it holds the speed at zero, while |force| <= breakaway. coulomb >= 0 and breakaway >= coulomb.
    """
    return Sticking(force, speed, coulomb, smooth, breakaway)
