"""Values of expressions and what operators and functions make of them (Modelica 3.6, chapters 3.4 to 3.7 and 10).

A value is a number, True or False, a text, a scalar symbol or expression of CasADi, an object array of NumPy of these
(so that a vector of one element and a matrix of one column stay what they are), a component, or a record.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.language.events import delay
from gantrytau.language.functions import fmax, fmin, if_else, logic_and, logic_not, logic_or, mod
from gantrytau.language.symbols import der, pre
from gantrytau.modelica.records.record_values import RecordValue, boxed, is_plain, mapped


class EnumerationValue(int):
    """A value of an enumeration: its number, from 1, with its name and its type."""

    literal: str
    type: str

    def __new__(cls, number: int, literal: str, type: str) -> "EnumerationValue":
        made = super().__new__(cls, number)
        made.literal, made.type = literal, type
        return made

    def __repr__(self) -> str:
        return f"{self.type}.{self.literal}"


def array(items: Sequence[Any]) -> Any:
    """Values of one shape as an array with one more dimension."""
    shapes = {np.shape(one) if isinstance(one, np.ndarray) else () for one in items}
    if len(shapes) > 1:
        raise ModelError(
            f"found the shapes {', '.join(map(str, sorted(shapes)))} in an array, expected one shape"
        )
    inner = shapes.pop() if shapes else ()
    found = np.empty((len(items), *inner), dtype=object)
    for k, one in enumerate(items):
        found[k] = one
    return found


def from_casadi(symbol: ca.SX, shape: tuple[int, ...]) -> Any:
    """A symbol of the language as a value."""
    if shape == ():
        return symbol
    found = np.empty(shape, dtype=object)
    for place, one in zip(np.ndindex(shape[::-1]), symbol.elements(), strict=True):  # column after column
        found[place[::-1]] = one
    return found


def in_rows(items: Sequence[Any], shape: tuple[int, ...]) -> Any:
    """Components that stand row after row as an array; the one of a scalar."""
    return array(items).reshape(shape) if shape else items[0]


def all_sizes(value: Any) -> tuple[int, ...]:
    """The sizes of an array; none of all else."""
    return value.shape if isinstance(value, np.ndarray) else ()


def to_casadi(value: Any) -> Any:
    """A value as the language takes it: a number, or an expression of CasADi."""
    if not isinstance(value, np.ndarray):
        return value
    if value.ndim > 2:
        raise ModelError(f"found {value.ndim} dimensions, expected at most two; use an array of components")
    if value.size == 0:
        raise ModelError("found an array without elements, expected at least one")
    rows = [ca.horzcat(*row) for row in (value if value.ndim == 2 else value[:, None])]
    found = ca.vertcat(*rows)
    return found if isinstance(found, ca.SX) else ca.DM(found)


def is_number(value: Any) -> bool:
    """Whether a value holds no symbol."""
    if isinstance(value, np.ndarray):
        return all(map(is_number, value.flat))
    return not isinstance(value, ca.SX) or value.is_constant()


def _plain(value: Any) -> Any:
    """A constant of CasADi as a number of Python."""
    return float(value) if isinstance(value, (ca.SX, ca.DM)) and value.is_constant() else value


def _numeric(sign: str, value: Any) -> Any:
    if isinstance(value, str) or not is_plain(value):
        raise ModelError(f"found {_kind(value)} beside '{sign}', expected numbers")
    return value


def _kind(value: Any) -> str:
    kinds = {
        str: "a text", np.ndarray: "an array of components", RecordValue: "a record", bool: "a Boolean",
    }  # fmt: skip
    return kinds.get(type(value), f"a {type(value).__name__}")


def _same_shape(sign: str, a: Any, b: Any) -> None:
    if all_sizes(a) != all_sizes(b):
        raise ModelError(
            f"found sizes {size_words(a)} and {size_words(b)} beside '{sign}', expected one size; '.{sign}' takes "
            "a scalar for every element"
        )


def size_words(value: Any) -> str:
    """The sizes of a value as Modelica writes them, or "a scalar"."""
    shape = all_sizes(value)
    return f"[{', '.join(map(str, shape))}]" if shape else "a scalar"


def _spread(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """An operation element by element; CasADi and NumPy do not know each other's."""

    def apply(a: Any, b: Any) -> Any:
        if not (isinstance(a, np.ndarray) or isinstance(b, np.ndarray)):
            return operation(a, b)
        return np.frompyfunc(operation, 2, 1)(boxed(a), boxed(b))

    return apply


def _product(a: Any, b: Any) -> Any:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return _spread(operator.mul)(a, b)
    if a.shape[-1] != b.shape[0]:
        raise ModelError(
            f"found sizes {size_words(a)} and {size_words(b)} beside '*', expected equal inner sizes"
        )
    return a.dot(b)


def _quotient(a: Any, b: Any) -> Any:
    if isinstance(b, np.ndarray):
        raise ModelError("found an array behind '/', expected a scalar; './' divides element by element")
    if not isinstance(b, ca.SX) and b == 0 and is_number(a):
        raise ModelError("found a division by zero, expected another number behind '/'")
    return _spread(operator.truediv)(a, b)


def _power(a: Any, b: Any) -> Any:
    if not (isinstance(a, np.ndarray) or isinstance(b, np.ndarray)):
        return a**b
    if len({*all_sizes(a)}) != 1 or np.ndim(a) != 2 or not isinstance(b, int) or b < 0:
        words = f"found {size_words(a)} and {size_words(b)} beside '^', expected a square matrix and a known Integer from 0"
        raise ModelError(f"{words}; '.^' takes the power of each element")
    return reduce(_product, [a] * b, np.eye(len(a), dtype=object))


ARITHMETIC: Mapping[str, Callable[[Any, Any], Any]] = {
    "*": _product,
    "/": _quotient,
    "^": _power,
    **{f"{dot}+": _spread(operator.add) for dot in ("", ".")},
    **{f"{dot}-": _spread(operator.sub) for dot in ("", ".")},
    ".*": _spread(operator.mul),
    "./": _spread(operator.truediv),
    ".^": _spread(operator.pow),
}
LOGICAL = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT)
RELATIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "<>": operator.ne,
}  # fmt: skip


def binary(sign: str, a: Any, b: Any) -> Any:
    """The value of an operator between two operands."""
    if sign in ("and", "or"):
        if isinstance(a, ca.SX) or isinstance(b, ca.SX):
            return (logic_and if sign == "and" else logic_or)(condition(a), condition(b))
        return (a and b) if sign == "and" else (a or b)
    if isinstance(a, str) and isinstance(b, str) and (sign == "+" or sign in RELATIONS):
        return a + b if sign == "+" else RELATIONS[sign](a, b)
    a, b = _numeric(sign, a), _numeric(sign, b)
    if sign in RELATIONS:
        if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
            raise ModelError(f"found an array beside '{sign}', expected scalars")
        found = RELATIONS[sign](a, b)
        return bool(_plain(found)) if is_number(found) else found
    if sign in "+-":
        _same_shape(sign, a, b)
    return ARITHMETIC[sign](a, b)


def unary(sign: str, a: Any) -> Any:
    """The value of a sign or `not` before an operand."""
    if sign == "not":
        return logic_not(condition(a)) if isinstance(a, ca.SX) else not a
    return -_numeric(sign, a) if "-" in sign else _numeric(sign, a)


def condition(value: Any) -> Any:
    """A Boolean as a condition: a variable that is no Discrete is true above one half."""
    number = isinstance(value, ca.SX) and not any(map(value.is_op, LOGICAL))
    return value > 0.5 if number else value


def chosen(test: Any, then: Any, otherwise: Any, smooth: bool) -> Any:
    """`if test then ... else ...` where the test holds symbols; arrays and records element by element.

    What has no value yet in one of the branches, None, has none: it is told where it is asked for.
    """
    if then is otherwise or then is None or otherwise is None:
        return then if then is otherwise else None
    if isinstance(then, np.ndarray) or hasattr(then, "member"):
        _same_shape("else", then, otherwise)
        return mapped(lambda a, b: chosen(test, a, b, smooth), then, otherwise)
    return if_else(condition(test), then, otherwise, smooth=smooth)


def _elementwise(function: Callable[..., Any]) -> Callable[..., Any]:
    def apply(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return array([apply(one) for one in value])
        return function(_numeric("(", value))

    return apply


def _of_numbers(plain: Callable[..., Any], symbolic: Callable[..., Any]) -> Callable[..., Any]:
    """A function that keeps whole numbers whole."""
    return lambda *values: (plain if all(map(is_number, values)) else symbolic)(*values)


def _reduced(function: Callable[[Any, Any], Any], start: Any) -> Callable[..., Any]:
    def apply(*values: Any) -> Any:
        if len(values) == 1:
            items = list(values[0].flat) if isinstance(values[0], np.ndarray) else list(values)
            return reduce(function, items) if items else start
        return function(*values)

    return apply


def _size(value: Any, dimension: int | None = None) -> Any:
    shape = all_sizes(value)
    if dimension is None:
        return array(list(shape))
    if not 1 <= dimension <= len(shape):
        raise ModelError(f"found size(..., {dimension}), expected 1 to {len(shape)}")
    return shape[dimension - 1]


def _filled(value: Any, *sizes: int) -> Any:
    found = np.empty(sizes, dtype=object)
    for place in np.ndindex(*sizes):
        found[place] = value
    return found


def _cat(axis: int, *parts: Any) -> Any:
    return np.concatenate([np.atleast_1d(boxed(one)) for one in parts], axis=axis - 1)


def _skew(a: Any) -> Any:
    return array([array([0, -a[2], a[1]]), array([a[2], 0, -a[0]]), array([-a[1], a[0], 0])])


def _truncated(x: Any) -> Any:
    return if_else(x >= 0, ca.floor(x), ca.ceil(x)) if isinstance(x, ca.SX) else int(x)


def _written(value: Any, *_: Any, **__: Any) -> str:
    if isinstance(value, EnumerationValue):
        return value.literal
    return str(value).lower() if isinstance(value, bool) else str(value)


PLAIN = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "sign")


def _cardinality(connector: Any) -> int:
    if not hasattr(connector, "cardinality"):
        raise ModelError("found cardinality() of what is no connector, expected a connector with members")
    return connector.cardinality()


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{name: _elementwise(getattr(ca, name)) for name in PLAIN},
    "log10": _elementwise(ca.log10),
    "abs": _elementwise(_of_numbers(abs, ca.fabs)),
    "floor": _elementwise(ca.floor),
    "ceil": _elementwise(ca.ceil),
    "integer": _elementwise(lambda x: ca.floor(x) if isinstance(x, ca.SX) else int(np.floor(x))),
    "atan2": _spread(ca.atan2),
    "mod": _spread(_of_numbers(operator.mod, mod)),
    "div": _spread(lambda x, y: _truncated(x / y)),
    "rem": _spread(lambda x, y: x - y * _truncated(x / y)),
    "min": _reduced(_of_numbers(min, fmin), np.inf),
    "max": _reduced(_of_numbers(max, fmax), -np.inf),
    "sum": _reduced(operator.add, 0),
    "product": _reduced(operator.mul, 1),
    "size": _size,
    "ndims": lambda value: len(all_sizes(value)),
    "zeros": lambda *sizes: _filled(0, *sizes),
    "ones": lambda *sizes: _filled(1, *sizes),
    "fill": _filled,
    "identity": lambda n: np.eye(n, dtype=object),
    "diagonal": np.diag,
    "linspace": lambda a, b, n: array([a + (b - a) * k / (n - 1) for k in range(n)]),
    "transpose": np.transpose,
    "cross": np.cross,
    "skew": _skew,
    "outerProduct": np.outer,
    "vector": lambda value: np.ravel(boxed(value)),
    "matrix": lambda value: np.atleast_2d(boxed(value)) if len(all_sizes(value)) != 1 else value[:, None],
    "scalar": lambda value: value.item() if isinstance(value, np.ndarray) else value,
    "cat": _cat,
    "array": lambda *items: array(items),
    "der": _elementwise(lambda x: der(x) if isinstance(x, ca.SX) else 0.0),
    "pre": _elementwise(lambda x: pre(x) if isinstance(x, ca.SX) else x),
    "edge": lambda b: logic_and(condition(b), logic_not(condition(pre(b)))),
    "change": lambda x: x != pre(x),
    "delay": lambda x, T, *_: delay(x, T),
    "homotopy": lambda actual, simplified=0: actual,
    "smooth": lambda _, value: value,
    "noEvent": lambda value: value,
    "semiLinear": lambda x, above, below: if_else(x >= 0, above * x, below * x),
    "Integer": lambda value: value if isinstance(value, ca.SX) else int(value),
    "String": _written,
    "cardinality": _cardinality,
}  # fmt: skip
REFUSED: Mapping[str, str] = {
    "inStream": "write a connector with flow and potential variables",
    "actualStream": "write a connector with flow and potential variables",
    "spatialDistribution": "write a chain of volumes",
    "terminal": "leave out what is done at the end",
}


def called(name: str, arguments: Sequence[Any], named: Mapping[str, Any]) -> Any:
    """The value of a function of the language."""
    if name in REFUSED:
        raise ModelError(f"found {name}(), which is not supported here; {REFUSED[name]}")
    if name not in FUNCTIONS:
        raise ModelError(f"found '{name}(', expected a function{did_you_mean(name, FUNCTIONS)}")
    divisors = boxed(arguments[-1]).flat if name in ("div", "mod", "rem") else ()
    if any(is_number(y) and _plain(y) == 0 for y in divisors):
        raise ModelError(f"found {name}(..., 0), expected a divisor other than zero")
    try:
        return FUNCTIONS[name](*arguments, **named)
    except TypeError as error:
        found = ", ".join([*map(size_words, arguments), *named])
        raise ModelError(f"found {name}() of ({found}), expected other arguments") from error


def tested(value: Any) -> Any:
    """A condition: true, false, or an expression of symbols; ModelError for what is none."""
    if isinstance(value, ca.SX) or (isinstance(value, (bool, int, float)) and value in (0, 1)):
        return value
    raise ModelError(f"found {value!r} as a condition, expected true or false")
