"""Functions for equations: CasADi's, accepting symbols, numbers and declarations of a class body alike."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gantrytau.errors import ModelError
from gantrytau.language.declarations import Formula


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


def if_else(condition: Any, then: Any, otherwise: Any) -> Any:
    """`then` where `condition` (`<`, `>=`, `between`) holds, else `otherwise`; both are evaluated."""
    if any(isinstance(argument, Formula) for argument in (condition, then, otherwise)):
        return Formula(if_else, condition, then, otherwise)
    if isinstance(condition, Between):
        condition = condition.condition()
    if isinstance(condition, ca.SX) and condition.numel() != 1:
        raise ModelError(f"if_else: the condition has shape {condition.shape}, expected one number")
    return ca.if_else(condition, then, otherwise)
