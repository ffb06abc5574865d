"""The language of optimisation problems: a model, what is free, an objective and constraints.

Optimica (Åkesson, 2008) as Python: a problem is a class; it is a model as well, so it may declare
quantities and equations of its own.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError, Parameter, Samples
from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given
from gantrytau.flattening.shapes import numpy_shape


class Free(Parameter):
    """A number that the optimiser chooses: a time, a parameter, or with `Start(Free(...))` an initial value.

    guess: where the search starts; min, max: limits; unit, display, description: as for any parameter. The optimum has
    times and parameters as numbers, `optimum["final_time"]`, an initial value as `optimum["x"][0]`.
    """

    free = True

    def __init__(
        self,
        guess: Any = 1.0,
        *,
        unit: str | None = None,
        display: str | None = None,
        min: Any = None,
        max: Any = None,
        description: str = "",
    ):
        super().__init__(guess, unit=unit, display=display, min=min, max=max, description=description)


class Optimization(Model):
    """An optimal-control problem. Subclass it::

        class Fastest(Optimization):
            cart = Cart()
            final_time = Free(1.0, unit="s", min=0.1)

            def objective(self):
                return self.final_time

            def constraints(self):
                yield between(-1.0, self.cart.f, 1.0)
                yield initial(self.cart.s) == 0
                yield final(self.cart.s) == 1

    given: the complete list of what stays known, as in `translate`; empty: the optimiser chooses all inputs.
    inputs: courses of those that it does not choose, by name: numbers, functions of time, Samples, or signals
    as `prbs`.
    A component that is an Optimization itself is a phase: it has a clock, objective and limits of its own, and this
    problem may add an objective and conditions on values at times, `yield link(self.first, self.second)` among them.
    A problem without derivatives and time is a static one: its signals have one value. With static=True it is one at rest:
    all derivatives of its models are zero.
    Where it mentions the rate of an input, `between(-800, der(self.crane.f), 800)`, that input is continuous.
    """

    start_time: Any = 0.0
    final_time: Any = 1.0
    static: Any = False
    given: tuple[str, ...] = ()
    inputs: Mapping[str, Any] = MappingProxyType({})

    def objective(self) -> Any:
        """What is minimised, of free numbers and of signals at times: `self.final_time`, `final(x)**2`."""
        return 0.0

    def integrand(self) -> Any:
        """What is minimised as an integral over time, an expression of signals."""
        return 0.0

    def constraints(self) -> Iterator[Any]:
        """Limits and conditions, one per yield: `between`, `==`, `<=`, `>=`."""
        yield from ()


@dataclass(frozen=True, eq=False)
class Point:
    """An expression at one time: symbols that stand for it, the expression, and the time."""

    symbol: ca.SX
    expression: ca.SX
    time: Any  # "initial", "final", a number, or an SX of free numbers


@dataclass(frozen=True, eq=False)
class Target:
    """A symbol that stands for a sum over samples, or for an integral, of the squared error of an expression (k,)."""

    symbol: ca.SX
    expression: ca.SX
    samples: Samples
    integrated: bool


@dataclass(frozen=True, eq=False)
class PhaseLink:
    """The second phase begins where the first ends, but for the variables that jump."""

    first: Optimization
    second: Optimization
    jump: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Asked:
    """What the statements of a problem asked for while it was read."""

    points: list[Point] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)


_asked: ContextVar[Asked | None] = ContextVar("what the problem being read asked for", default=None)


@contextmanager
def reading() -> Iterator[Asked]:
    """While it lasts, `initial`, `final`, `at` and the sums over samples record what they are asked for."""
    asked = Asked()
    token = _asked.set(asked)
    try:
        yield asked
    finally:
        _asked.reset(token)


def link(first: Optimization, second: Optimization, *, jump: Sequence[str] = ()) -> PhaseLink:
    """`yield link(self.out, self.back)`: all states of the second phase begin where the first ends.

    jump: names within the phase that do not, as "ball.v" after a contact. A free start time of the second phase
    is the final time of the first.
    """
    for argument, phase in (("first", first), ("second", second)):
        instance("link", argument, phase, Optimization, "a phase: a component that is an Optimization")
    if isinstance(jump, str):
        raise ModelError(
            f"expected a list of names; write ['{jump}']", place="link", found=Given("jump", jump)
        )
    return PhaseLink(first, second, tuple(jump))


def sum_of_squares(expression: Any, samples: Samples) -> ca.SX:
    """For `objective`: the sum over all samples of ((expression at its time - value) / deviation)^2.

    expression: (k,) signals, samples of k columns; the times need not lie on the mesh.
    """
    return _target("sum_of_squares", expression, samples, integrated=False)


def integral_of_squares(expression: Any, samples: Samples) -> ca.SX:
    """For `objective`: the integral over the horizon of ((expression - course) / deviation)^2, in s times its square.

    The course between the samples is that of their kind, straight lines or steps; gaps are refused.
    """
    return _target("integral_of_squares", expression, samples, integrated=True)


def _target(words: str, expression: Any, samples: Samples, integrated: bool) -> ca.SX:
    asked = _asked.get()
    if asked is None:
        raise ModelError(f"{words} was used outside of an optimisation problem; use it in objective()")
    instance(words, "samples", samples, Samples, "Samples(times, values)")
    expression = _signals(words, expression, asked.points)
    if expression.numel() == samples.values.shape[1]:
        samples.check_shape(words, numpy_shape(expression))
    expression = ca.vec(expression)
    if expression.numel() != samples.values.shape[1]:
        raise ModelError(
            f"{words}: found {expression.numel()} expressions and samples of {samples.values.shape[1]} columns, expected "
            "as many"
        )
    symbol = ca.SX.sym(f"{words}({', '.join(str(e) for e in expression.elements())})")
    asked.targets.append(Target(symbol, expression, samples, integrated))
    return symbol


def initial(expression: Any) -> ca.SX:
    """The value of an expression at the start, of the same shape."""
    return _point("initial", expression, "initial")


def final(expression: Any) -> ca.SX:
    """The value of an expression at the end, of the same shape."""
    return _point("final", expression, "final")


def at(time: Any, expression: Any) -> ca.SX:
    """The value of an expression at any time in s, of the same shape; the time need not lie on the mesh."""
    if not isinstance(time, (int, float, ca.SX, ca.DM, np.number)) or isinstance(time, bool):
        raise ModelError(
            f"at: found the time {time!r}, expected a number in s or an expression of free numbers"
        )
    return _point(f"at({time})", expression, time)


def _point(words: str, expression: Any, time: Any) -> ca.SX:
    asked = _asked.get()
    if asked is None:
        raise ModelError(
            f"{words} was used outside of an optimisation problem; use it in constraints() or objective()"
        )
    expression = _signals(words, expression, asked.points)
    names = [
        f"{words}({e})" if words in ("initial", "final") else f"{words} of {e}" for e in expression.elements()
    ]
    symbol = ca.reshape(ca.vertcat(*(ca.SX.sym(name) for name in names)), *expression.shape)
    asked.points.append(Point(ca.vec(symbol), ca.vec(expression), time))
    return symbol


def _signals(words: str, expression: Any, points: list[Point]) -> ca.SX:
    """What a point is asked for, refused if it is no expression or a value at a time already."""
    try:
        expression = ca.densify(ca.SX(expression))
    except NotImplementedError:
        raise ModelError(
            f"{words}: found {type(expression).__name__}, expected a variable of the model or an expression"
        ) from None
    inside = {e.element_hash() for p in points for e in p.symbol.elements()}
    nested = [leaf for leaf in ca.symvar(expression) if leaf.element_hash() in inside]
    if nested:
        raise ModelError(f"{words}: found {nested[0]}, which has its time already; name the variable itself")
    return expression
