"""What an argument must be: one of a few words, a number, an array, an object of a class. Checked alike by all functions.

Each check takes the place that its message names, the argument and what was found, and returns the value.
"""

import inspect
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from numbers import Number
from typing import Any, Literal, get_args, get_origin

import casadi as ca
import numpy as np

from gantrytau.border.refusal import GantryTauError, Given, ModelError, meant
from gantrytau.border.units import given

Shape = tuple[int | None, ...]
BOOLS = (bool, np.bool_)


def one_of(place: str, argument: str, found: Any, words: Iterable[Any]) -> Any:
    """A word of those allowed; ModelError with all of them for anything else."""
    words = tuple(words)
    for word in words:
        if _same(found, word):
            return word
    names = [word for word in words if isinstance(word, str)]
    guess = meant(found, names) if isinstance(found, str) else ""
    raise _refused(place, argument, found, f"{either([repr(word) for word in words])}{guess}")


def _same(found: Any, word: Any) -> bool:
    """Whether a value, one of NumPy too, is a word: True is not 1."""
    kinds: Any = {bool: BOOLS, int: (int, np.integer)}.get(type(word), type(word))
    return isinstance(found, kinds) and isinstance(found, BOOLS) == isinstance(word, bool) and found == word


def check_words(function: Callable[..., Any], values: Mapping[str, Any], place: str | None = None) -> None:
    """ModelError for an argument of `function` whose `Literal` does not list the value found."""
    for argument, words in literals(function).items():
        if argument in values:
            one_of(function.__name__ if place is None else place, argument, values[argument], words)


@cache
def literals(function: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    """The words that each argument of a function takes, from its annotation; those with other values are left out."""
    parameters = inspect.signature(function).parameters.values()
    return {one.name: words for one in parameters if (words := _listed(one.annotation))}


def _listed(hint: Any) -> tuple[Any, ...]:
    """The words of an annotation that is a Literal, or a Literal or None."""
    if get_origin(hint) is Literal:
        return get_args(hint)
    parts = get_args(hint)
    if not parts or any(part is not type(None) and get_origin(part) is not Literal for part in parts):
        return ()
    return tuple(word for part in parts for word in (get_args(part) or (None,)))


def number(
    place: str,
    argument: str,
    found: Any,
    *,
    unit: str | None = None,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    below: float | None = None,
) -> float:
    """A number within its limits, in SI; a text brings its unit, as "700 mm". ModelError for anything else.

    It is finite, unless `most` or `least` is infinite: there infinity stands for no limit.
    """
    limits = _limits(least, above, most, below)
    value = _number(place, argument, found, unit, limits)
    small = (least is not None and value < least) or (above is not None and value <= above)
    large = (most is not None and value > most) or (below is not None and value >= below)
    if small or large or not (math.isfinite(value) or value in (least, most)):
        kind = "a finite number" if math.isinf(value) else "a number"
        raise _refused(place, argument, found, f"{kind}{limits}{_in(unit)}")
    return value


def whole(place: str, argument: str, found: Any, *, least: int | None = None, most: int | None = None) -> int:
    """A whole number within its limits; ModelError for anything else, 2.0 and True too."""
    try:
        value = None if isinstance(found, BOOLS) else operator.index(found)
    except TypeError:
        value = None
    if value is None or (least is not None and value < least) or (most is not None and value > most):
        raise _refused(place, argument, found, f"a whole number{_limits(least, None, most, None)}")
    return value


def array(
    place: str,
    argument: str,
    found: Any,
    *shapes: Shape,
    unit: str | None = None,
    finite: bool = True,
    least: float | None = None,
    above: float | None = None,
) -> np.ndarray:
    """An array of numbers in SI of one of the shapes, None for any length; texts bring their unit.

    A column of CasADi's DM is a vector where one is expected.
    ModelError for another shape, for what is no number or beyond its limit, and unless `finite` is False for nan,
    infinity, and None, which is read as nan.
    """
    limits = _limits(least, above, None, None)
    wanted = f"{numbers_of(*shapes)}{limits}{_in(unit)}"
    try:
        values = np.asarray(_si(place, argument, found, unit) if unit else found)
        if values.dtype.kind not in "iuf" and not (
            values.dtype.kind == "O" and _numeric(values, lost=not finite)
        ):
            raise TypeError
        values = values.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise _refused(place, argument, found, wanted) from None
    if isinstance(found, ca.DM) and found.is_column() and not _fits(values.shape, *shapes):
        values = values.ravel()
    if not values.shape and not _fits((), *shapes):
        raise _refused(place, argument, found, wanted)
    if not _fits(values.shape, *shapes):
        size = numbers_of(values.shape) if values.ndim == 1 else " x ".join(map(str, values.shape))
        raise ModelError(f"found {argument} of {size}, expected {wanted}", place=place, argument=argument)
    wrong = ~np.isfinite(values) if finite else np.zeros(values.shape, dtype=bool)
    if least is not None:
        wrong = wrong | (values < least)
    if above is not None:
        wrong = wrong | (values <= above)
    if np.any(wrong):
        first = tuple(map(int, np.argwhere(wrong)[0]))
        where = f"[{', '.join(map(str, first))}]" if first else ""
        message = f"found {argument}{where} = {values[first]}, expected finite numbers{limits}{_in(unit)}"
        raise ModelError(message, place=place, argument=argument)
    return values


def _numeric(values: np.ndarray, lost: bool) -> bool:
    """Whether an array of objects holds numbers alone, or None for lost ones; a symbol of CasADi makes a float too, nan."""
    kinds = {type(value) for value in values.flat} - ({type(None)} if lost and values.ndim else set())
    return all(issubclass(kind, Number) and kind is not bool for kind in kinds)


def instance(place: str, argument: str, found: Any, kinds: Any, expected: str | None = None) -> Any:
    """An object of a class, or of one of a tuple of classes; ModelError for another, also for the class itself."""
    if isinstance(found, kinds):
        return found
    names = [kind.__name__ for kind in (kinds if isinstance(kinds, tuple) else (kinds,))]
    raise _refused(place, argument, found, expected or either(names))


def either(words: list[str]) -> str:
    """Alternatives in a sentence: `a, b or c`."""
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _refused(place: str, argument: str, found: Any, expected: str) -> GantryTauError:
    return ModelError(f"expected {expected}", place=place, found=Given(argument, found))


def _number(place: str, argument: str, found: Any, unit: str | None, limits: str) -> float:
    try:
        if isinstance(found, str) and unit:
            return float(_si(place, argument, found, unit))
        kind = getattr(getattr(found, "dtype", None), "kind", "")  # of an array, and of a number of NumPy
        if isinstance(found, (bool, str, bytes)) or (kind and (kind not in "iuf" or found.ndim)):
            raise TypeError
        return float(found)
    except (TypeError, ValueError, OverflowError, RuntimeError):  # the last of CasADi: a symbol
        raise _refused(place, argument, found, f"a number{limits}{_in(unit)}") from None


def _si(place: str, argument: str, found: Any, unit: str) -> Any:
    """A value in SI, texts with their unit; ModelError for a text of another kind."""
    try:
        return given(argument, found, unit)
    except ModelError as error:
        raise ModelError(str(error), place=place, argument=argument) from None


def _limits(least: float | None, above: float | None, most: float | None, below: float | None) -> str:
    """Limits in words, with a space before them."""
    sides = [
        *([f"of at least {least:g}"] if least not in (None, -math.inf) else ()),
        *([f"above {above:g}"] if above is not None else ()),
        *([f"of at most {most:g}"] if most not in (None, math.inf) else ()),
        *([f"below {below:g}"] if below is not None else ()),
    ]
    return f" {' and '.join(sides)}" if sides else ""


def _in(unit: str | None) -> str:
    return f" in {unit}" if unit and unit != "1" else ""


def numbers_of(*shapes: Shape) -> str:
    """Shapes in words: `3 numbers or n x 3 numbers`."""
    words = []
    for shape in shapes:
        letters = iter("nmkl")
        size = " x ".join(next(letters) if n is None else str(n) for n in shape)
        known = {(): "a number", (1,): "1 number", (None,): "a list of numbers"}
        words.append(known.get(shape, f"{size} numbers"))
    return either(words) or "numbers"


def _fits(found: Shape, *shapes: Shape) -> bool:
    return not shapes or any(
        len(found) == len(one) and all(n in (None, m) for m, n in zip(found, one, strict=True))
        for one in shapes
    )
