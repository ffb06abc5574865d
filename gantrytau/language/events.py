"""What a model states of instants: values that are sampled and held, what happens when, and friction that sticks.

`sampled`, `when` and `stick_slip` are yielded by `equations(self)` like equations. A sampled variable, a Discrete and
the force of such a friction count as known in the equations, as inputs do; what they are is kept beside.
"""

from dataclasses import dataclass
from typing import Any

from gantrytau.errors import ModelError


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


@dataclass(frozen=True, eq=False)
class Reinit:
    """`reinit(variable, value)`."""

    variable: Any
    value: Any


@dataclass(frozen=True, eq=False)
class Terminate:
    """`terminate(words)`."""

    words: str


@dataclass(frozen=True, eq=False)
class WhenChain:
    """`when(condition, action, ...)`, and what is tried after it: (condition, actions) of which one acts at an instant."""

    branches: tuple[tuple[Any, tuple[Any, ...]], ...]

    def elsewhen(self, condition: Any, *actions: Any) -> "WhenChain":
        """The same, and further actions where another condition becomes true and none before it does."""
        return WhenChain((*self.branches, (condition, actions)))


def when(condition: Any, *actions: Any) -> WhenChain:
    """State what happens at the instants at which a condition becomes true; one that is true at the start does not.

    condition: a comparison (`<`, `<=`, `>`, `>=`) of variables and time, `between`, a Discrete that is 0 or 1, or some of
    these joined by `logic_and`, `logic_or`, `logic_not`. actions: `discrete == expression`, which gives a Discrete a new
    value, `reinit(state, expression)`, `terminate("words")`. In an expression `pre(x)` is the value just before; a Discrete
    without it has its new value, any other variable the one just before. All whens whose conditions become true at an
    instant act together; then the conditions are looked at again, until none becomes true any more.
    `.elsewhen(condition, action, ...)` continues the chain, of which the first whose condition becomes true acts: a
    variable may be set by one chain only.
    """
    return WhenChain(((condition, actions),))


def reinit(variable: Any, value: Any) -> Reinit:
    """An action of `when`: a state, scalar or vector, takes another value, and what follows from it with it."""
    return Reinit(variable, value)


def terminate(words: str) -> Terminate:
    """An action of `when`: the simulation ends there, and says these words as `.ended` of its result."""
    if not isinstance(words, str) or not words.strip():
        raise ModelError(f"terminate: found {words!r}, expected a text that says why the simulation ends")
    return Terminate(words)


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
