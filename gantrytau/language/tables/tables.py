"""`table`: numbers over one or two arguments as an expression."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

import casadi as ca
import numpy as np

from gantrytau.border.checks import array, check_words
from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Formula
from gantrytau.language.symbols import note_range
from gantrytau.language.tables.local_polynomials import interpolating, polynomials


def table(
    x: Any,
    xs: Any,
    ys: Any,
    *,
    kind: Literal["linear", "spline"] = "linear",
    outside: Literal["hold", "linear", "error"] = "hold",
) -> Any:
    """The value at x of a table of numbers, as an expression: it has derivatives, and goes into C code as it is.

    x: a scalar expression, or a vector, of which each element is looked up; xs: numbers (n,) that rise strictly, n > 1, in
    the unit of x; ys: numbers (n,), in the unit that the equation asks for. Or `table((x, y), (xs, ys), values)` of two
    scalars, values (n, m) for xs (n,) and ys (m,). `read_table` has the numbers of a file.
    kind: "linear", straight lines, whose kinks simulations and FMUs find; "spline", the cubic with a continuous second
    derivative that has no knots at the last points but one (two points: a line, three: a parabola). Two arguments: bilinear
    and bicubic.
    outside: "hold" the value of the end; "linear", go on with the slope at the end; "error": a simulation that leaves the
    table ends with SolveError, which names the argument, functions are NaN there, and an FMU stops.
    ModelError for tables that do not rise, are not finite, or do not fit.
    """
    check_words(table, locals())
    two = isinstance(x, (tuple, list)) and len(x) == 2
    arguments: tuple[Any, ...] = tuple(x) if two else (x,)
    if any(isinstance(one, Formula) for one in arguments):
        return Formula(partial(_later, xs=xs, ys=ys, kind=kind, outside=outside), *arguments)
    if two:
        axes = _axes(xs)
    else:
        axes = [_axis("xs", xs)]
    if isinstance(ys, (ca.SX, ca.MX)):
        raise ModelError(
            "table: found symbols, expected numbers; what varies with parameters is k * table(...)"
        )
    values = array("table", "values" if two else "ys", ys, tuple(axis.size for axis in axes))
    return _applied(lambda *at: _value(at, axes, values, kind, outside), arguments)


def _later(*arguments: Any, xs: Any, ys: Any, kind: Any, outside: Any) -> Any:
    x = arguments if len(arguments) == 2 else next(iter(arguments))
    return table(x, xs, ys, kind=kind, outside=outside)


def _value(
    at: Sequence[ca.SX], axes: Sequence[np.ndarray], values: np.ndarray, kind: str, outside: str
) -> ca.SX:
    """The table at scalar arguments."""
    weights = interpolating(axes[0], values, kind)
    if len(axes) == 1:
        (value,), _ = polynomials(axes[0], weights[:, None], kind, outside).at(at[0])
    else:
        weights = interpolating(axes[1], weights.T, kind).T
        (rows, _), (columns, _) = (
            polynomials(axis, np.eye(axis.size), kind, outside).at(one)
            for one, axis in zip(at, axes, strict=True)
        )
        value = ca.dot(ca.vertcat(*rows), ca.DM(weights) @ ca.vertcat(*columns))
    if outside == "error":
        for one, axis in zip(at, axes, strict=True):
            value = only_within(value, one, axis)
    return value


def only_within(value: Any, at: ca.SX, axis: np.ndarray) -> Any:
    """A value at an argument, nan beyond the ends of its axis, where simulations stop."""
    low, high = float(axis[0]), float(axis[-1])
    note_range(at, low, high)
    return value * ca.sqrt(1 - 2 * ((at < low) + (at > high)))


def _applied(function: Callable[..., ca.SX], arguments: tuple[Any, ...]) -> Any:
    """A function of scalar expressions, of expressions or numbers of any shape element by element."""
    try:
        given = [one if isinstance(one, ca.MX) else ca.SX(one) for one in arguments]
    except (NotImplementedError, TypeError):
        raise ModelError(
            f"table: found the argument {arguments!r}, expected an expression or a number, or two of them; join lists "
            "with casadi.vertcat(...)"
        ) from None
    if len({one.shape for one in given}) > 1:
        raise ModelError(
            f"table: found arguments of shapes {' and '.join(str(one.shape) for one in given)}, expected the same shape"
        )
    if any(isinstance(one, ca.MX) for one in given):
        symbols = [ca.SX.sym("x", *one.shape) for one in given]
        return ca.Function("table", symbols, [_applied(function, tuple(symbols))])(*given)
    elements = zip(*(ca.densify(one).elements() for one in given), strict=True)
    found = ca.reshape(ca.vertcat(*(function(*at) for at in elements)), *given[0].shape)
    if all(one.is_constant() for one in given) and not any(isinstance(one, ca.SX) for one in arguments):
        number = np.array(ca.evalf(found))
        return float(number[0, 0]) if number.size == 1 else number.reshape(np.shape(arguments[0]), order="F")
    return found


def _axes(given: Any) -> list[np.ndarray]:
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise ModelError(
            f"table: found {type(given).__name__} for the numbers of two arguments, expected (xs, ys), as in "
            "table((x, y), (xs, ys), values)"
        )
    return [_axis("xs", given[0]), _axis("ys", given[1])]


def _axis(name: str, given: Any) -> np.ndarray:
    """Numbers that rise."""
    found = array("table", name, given, (None,))
    if found.size < 2:
        raise ModelError(f"table: found {found.size} numbers {name}, expected two or more", argument=name)
    falls = np.flatnonzero(~(np.diff(found) > 0))
    if falls.size:
        k = int(falls[0])
        raise ModelError(
            f"table: found {name}[{k}] = {found[k]:.17g} and {name}[{k + 1}] = {found[k + 1]:.17g} behind it, expected "
            "numbers that rise strictly; sort the points, and leave one of two at the same place"
        )
    return found
