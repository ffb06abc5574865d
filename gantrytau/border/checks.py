"""What an argument must be: one of a few words, a number, an array, an object of a class. Checked alike by all functions.

Each check takes the place that its message names, the argument and what was found, and returns the value.
"""

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from numbers import Real
from typing import Any, Literal, get_args, get_origin

import numpy as np

from gantrytau.border.refusal import GantryTauError, Given, ModelError, meant
from gantrytau.border.units import given

Shape = tuple[int | None, ...]


def one_of(place: str, argument: str, found: Any, words: Iterable[Any]) -> Any:
    """A word of those allowed; ModelError with all of them for anything else."""
    words = tuple(words)
    if any(type(found) is type(word) and found == word for word in words):
        return found
    names = [word for word in words if isinstance(word, str)]
    guess = meant(found, names) if isinstance(found, str) else ""
    raise _refused(place, argument, found, f"{either([repr(word) for word in words])}{guess}")


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
    """A finite number within its limits, in SI; a text brings its unit, as "700 mm". ModelError for anything else."""
    value = _number(place, argument, found, unit)
    small = (least is not None and value < least) or (above is not None and value <= above)
    large = (most is not None and value > most) or (below is not None and value >= below)
    if not math.isfinite(value) or small or large:
        raise _refused(place, argument, found, f"a number{_limits(least, above, most, below)}{_in(unit)}")
    return value


def whole(place: str, argument: str, found: Any, *, least: int | None = None, most: int | None = None) -> int:
    """A whole number within its limits; ModelError for anything else, 2.0 and True too."""
    fits = isinstance(found, (int, np.integer)) and not isinstance(found, bool)
    if not fits or (least is not None and found < least) or (most is not None and found > most):
        raise _refused(place, argument, found, f"a whole number{_limits(least, None, most, None)}")
    return int(found)


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

    ModelError for another shape, for what is no number or beyond its limit, and unless `finite` is False for nan and
    infinity.
    """
    limits = _limits(least, above, None, None)
    wanted = f"numbers{limits}{_in(unit)}{_shaped(shapes)}"
    try:
        values = np.asarray(_si(place, argument, found, unit) if unit else found)
        if values.dtype.kind not in "iuf" and not (values.dtype.kind == "O" and _numeric(values)):
            raise TypeError
        values = values.astype(float)
    except (TypeError, ValueError):
        raise _refused(place, argument, found, wanted) from None
    if shapes and not any(_fits(values.shape, shape) for shape in shapes):
        size = " x ".join(map(str, values.shape)) or "a single number"
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


def _numeric(values: np.ndarray) -> bool:
    """Whether an array of objects holds numbers alone: a symbol of CasADi makes a float too, nan."""
    kinds = {type(value) for value in values.flat}
    return bool(kinds) and all(issubclass(kind, Real) and kind is not bool for kind in kinds)


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


def _number(place: str, argument: str, found: Any, unit: str | None) -> float:
    try:
        if isinstance(found, str) and unit:
            return float(_si(place, argument, found, unit))
        if isinstance(found, (bool, str, bytes)) or (isinstance(found, np.ndarray) and found.ndim):
            raise TypeError
        return float(found)
    except (TypeError, ValueError, RuntimeError):  # of CasADi: a symbol
        raise _refused(place, argument, found, f"a number{_in(unit)}") from None


def _si(place: str, argument: str, found: Any, unit: str) -> Any:
    """A value in SI, texts with their unit; ModelError for a text of another kind."""
    try:
        return given(argument, found, unit)
    except ModelError as error:
        raise ModelError(str(error), place=place, argument=argument) from None


def _limits(least: float | None, above: float | None, most: float | None, below: float | None) -> str:
    """Limits in words, with a space before them."""
    sides = [
        *([f"of at least {least:g}"] if least is not None else ()),
        *([f"above {above:g}"] if above is not None else ()),
        *([f"of at most {most:g}"] if most is not None else ()),
        *([f"below {below:g}"] if below is not None else ()),
    ]
    return f" {' and '.join(sides)}" if sides else ""


def _in(unit: str | None) -> str:
    return f" in {unit}" if unit and unit != "1" else ""


def _shaped(shapes: tuple[Shape, ...]) -> str:
    """Shapes in words: `of 3` or `of n x 3`."""
    sizes = [" x ".join("n" if n is None else str(n) for n in shape) for shape in shapes]
    return f", {either(sizes)}" if sizes and all(sizes) else ""


def _fits(found: Shape, wanted: Shape) -> bool:
    return len(found) == len(wanted) and all(n in (None, m) for m, n in zip(found, wanted, strict=True))
