"""The language of optimisation problems: a model, what is free, an objective and constraints.

Optimica (Åkesson, 2008) as Python: a problem is a class; it is a model as well, so it may declare
quantities and equations of its own.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gantrytau import Model, ModelError, Parameter


class Free(Parameter):
    """A number that the optimiser chooses: a time, a parameter, or with `Start(Free(...))` an initial value.

    guess: where the search starts; min, max: limits; unit, description: as for any parameter. The optimum has
    times and parameters as numbers, `optimum["final_time"]`, an initial value as `optimum["x"][0]`.
    """

    free = True

    def __init__(
        self,
        guess: Any = 1.0,
        *,
        unit: str | None = None,
        min: Any = None,
        max: Any = None,
        description: str = "",
    ):
        super().__init__(guess, unit=unit, min=min, max=max, description=description)


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
    """

    start_time: Any = 0.0
    final_time: Any = 1.0
    given: tuple[str, ...] = ()

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


_points: ContextVar[list[Point] | None] = ContextVar("points of the problem being read", default=None)


@contextmanager
def reading() -> Iterator[list[Point]]:
    """While it lasts, `initial`, `final` and `at` record what they are asked for."""
    points: list[Point] = []
    token = _points.set(points)
    try:
        yield points
    finally:
        _points.reset(token)


def initial(expression: Any) -> ca.SX:
    """The value of an expression at the start, of the same shape."""
    return _point("initial", expression, "initial")


def final(expression: Any) -> ca.SX:
    """The value of an expression at the end, of the same shape."""
    return _point("final", expression, "final")


def at(time: Any, expression: Any) -> ca.SX:
    """The value of an expression at any time in s, of the same shape; the time need not lie on the mesh."""
    return _point(f"at({time})", expression, time)


def _point(words: str, expression: Any, time: Any) -> ca.SX:
    points = _points.get()
    if points is None:
        raise ModelError(
            f"{words} was used outside of an optimisation problem; use it in constraints() or objective()"
        )
    expression = _signals(words, expression, points)
    names = [
        f"{words}({e})" if words in ("initial", "final") else f"{words} of {e}" for e in expression.elements()
    ]
    symbol = ca.reshape(ca.vertcat(*(ca.SX.sym(name) for name in names)), *expression.shape)
    points.append(Point(ca.vec(symbol), ca.vec(expression), time))
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
