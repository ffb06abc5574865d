"""Functions for equations: CasADi's, accepting symbols, numbers and declarations of a class body alike."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Formula
from gantrytau.language.piecewise import smoothly


def _lifted(function: Callable[..., Any], name: str, words: str) -> Callable[..., Any]:
    def apply(*arguments: Any) -> Any:
        if any(isinstance(argument, Formula) for argument in arguments):
            return Formula(apply, *arguments)
        return function(*arguments)

    apply.__name__ = apply.__qualname__ = name
    apply.__doc__ = words
    return apply


sin = _lifted(ca.sin, "sin", "Sine of an angle in rad.")
cos = _lifted(ca.cos, "cos", "Cosine of an angle in rad.")
tan = _lifted(ca.tan, "tan", "Tangent of an angle in rad.")
asin = _lifted(ca.asin, "asin", "Arc sine, in rad.")
acos = _lifted(ca.acos, "acos", "Arc cosine, in rad.")
atan = _lifted(ca.atan, "atan", "Arc tangent, in rad.")
atan2 = _lifted(ca.atan2, "atan2", "Angle of the point (x, y) as atan2(y, x), in rad.")
sqrt = _lifted(ca.sqrt, "sqrt", "Square root.")
exp = _lifted(ca.exp, "exp", "Exponential function.")
log = _lifted(ca.log, "log", "Natural logarithm.")
tanh = _lifted(ca.tanh, "tanh", "Hyperbolic tangent.")
fabs = _lifted(ca.fabs, "fabs", "Absolute value.")
fmin = _lifted(ca.fmin, "fmin", "The smaller of two values, element by element.")
fmax = _lifted(ca.fmax, "fmax", "The larger of two values, element by element.")
sign = _lifted(ca.sign, "sign", "-1, 0 or 1.")
floor = _lifted(ca.floor, "floor", "The largest whole number that is not above a value.")
ceil = _lifted(ca.ceil, "ceil", "The smallest whole number that is not below a value.")
dot = _lifted(ca.dot, "dot", "Scalar product of two vectors.")
cross = _lifted(ca.cross, "cross", "Vector product of two vectors of three.")
norm_2 = _lifted(ca.norm_2, "norm_2", "Euclidean length of a vector.")


@dataclass(frozen=True, eq=False)
class Between:
    """`lower <= expression <= upper`, elementwise: a constraint, or a condition of `if_else`."""

    lower: Any
    expression: Any
    upper: Any

    def condition(self) -> Any:
        """The same as a CasADi condition."""
        return ca.logic_and(self.lower <= self.expression, self.expression <= self.upper)


def between(lower: Any, expression: Any, upper: Any) -> Between:
    """`lower <= expression <= upper`, which Python's chained comparison cannot say on symbols.

    The limits are numbers or expressions, scalar or of the shape of the expression, in its unit.
    """
    return Between(lower, expression, upper)


def mod(x: Any, y: Any) -> Any:
    """X - y * floor(x / y), what is left of x above the next lower multiple of y; it has the sign of y."""
    if isinstance(x, Formula) or isinstance(y, Formula):
        return Formula(mod, x, y)
    return x - y * ca.floor(x / y)


def limit(x: Any, low: Any, high: Any) -> Any:
    """x, but not below `low` and not above `high`, element by element."""
    return fmin(fmax(x, low), high)


def logic_and(*conditions: Any) -> Any:
    """Whether all of some conditions hold, for `if_else` and `when`; Python's `and` cannot say it on symbols."""
    return _joined(logic_and, ca.logic_and, conditions)


def logic_or(*conditions: Any) -> Any:
    """Whether at least one of some conditions holds, for `if_else` and `when`."""
    return _joined(logic_or, ca.logic_or, conditions)


def logic_not(condition: Any) -> Any:
    """Whether a condition does not hold, for `if_else` and `when`."""
    if isinstance(condition, Formula):
        return Formula(logic_not, condition)
    return ca.logic_not(plain_condition(condition))


def _joined(function: Callable[..., Any], join: Callable[..., Any], conditions: tuple[Any, ...]) -> Any:
    if any(isinstance(condition, Formula) for condition in conditions):
        return Formula(function, *conditions)
    if not conditions:
        raise ModelError(f"{function.__name__}: found no condition, expected at least one")
    return reduce(join, (plain_condition(condition) for condition in conditions))


def plain_condition(condition: Any) -> Any:
    """A condition as an expression of CasADi; `between` is one."""
    return condition.condition() if isinstance(condition, Between) else condition


def if_else(condition: Any, then: Any, otherwise: Any, *, smooth: bool = False) -> Any:
    """`then` where `condition` (`<`, `>=`, `between`) holds, else `otherwise`; both are evaluated.

    Where the condition turns on states or time, a simulation stops and starts anew. smooth: it does not, because both
    are the same there, with a derivative or two: it is integrated across, in steps of a 500th of the run or less.
    """
    if any(isinstance(argument, Formula) for argument in (condition, then, otherwise)):
        return Formula(partial(if_else, smooth=smooth), condition, then, otherwise)
    condition = plain_condition(condition)
    if isinstance(condition, ca.SX) and condition.numel() != 1:
        raise ModelError(f"if_else: the condition has shape {condition.shape}, expected one number")
    if smooth and isinstance(condition, ca.SX):
        condition = smoothly(condition)
    return ca.if_else(condition, then, otherwise)
