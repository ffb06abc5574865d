"""What drives an input from outside: a number, a function of time, samples or a signal, and when it jumps or bends."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from gantrytau import Samples
from gantrytau.border.refusal import USERS_ERRORS, Given, ModelError
from gantrytau.border.units import given, scale
from gantrytau.inputs.input_signal import with_course

ROUNDINGS = 16  # of a time: a knot that is nearer to the end of a step stands there


def wrong(argument: str, name: str, *parts: str | Given) -> ModelError:
    """What is wrong with a value that an argument has for a name."""
    return ModelError(*parts, place=f"{argument}: {name}", argument=argument)


@dataclass(frozen=True, eq=False)
class Drive:
    """The value of an input over time; knots: times in s at which it jumps (it is then `held` in between) or bends."""

    course: Callable[[float], float]
    knots: np.ndarray = field(default_factory=lambda: np.zeros(0))
    held: bool = False

    def __call__(self, time: float) -> float:
        return self.course(time)

    def before(self, time: float) -> float:
        """The value just before a time."""
        earlier = self.knots[self.knots < time]
        return self.course(float(earlier[-1])) if self.held and earlier.size else self.course(time)

    def mean(self, begin: float, size: float) -> float:
        """The mean over a step: exact for samples, else the value in the middle, which is it to second order."""
        pieces = between(self.knots, begin, size)
        return sum(h * self.course(t + h / 2) for t, h in pieces) / sum(h for _, h in pieces)


def between(knots: np.ndarray, begin: float, size: float) -> list[tuple[float, float]]:
    """The parts of a step, begin and length in s, between which there are knots (rising)."""
    near = ROUNDINGS * np.spacing(abs(begin) + size)
    first, last = np.searchsorted(knots, [begin + near, begin + size - near]) if knots.size else (0, 0)
    if first >= last:
        return [(begin, size)]
    times = [begin, *knots[first:last].tolist(), begin + size]
    return [(low, high - low) for low, high in pairwise(times)]


def drives_of(argument: str, name: str, value: Any, count: int, span: tuple[float, float]) -> list[Drive]:
    """What drives the elements of an input, given as `argument`.

    value: number, array, function of time, Samples, (times, values) or a signal; span: begin and stop in s, which samples
    have to cover. Raises ModelError for what is none of these.
    """
    try:
        course = with_course(name, value, (count,) if count > 1 else (), lambda: span)
    except ModelError as error:
        raise error.within(argument) from error
    if isinstance(course, Samples):
        return _samples(f"{argument}: {name}", course, count, span)
    if callable(course):
        return _functions(argument, name, course, count, span[0])
    return [Drive(lambda t, x=number: x) for number in numbers_of(argument, name, course, count)]


def without_units(argument: str, name: str, value: Any, unit: str) -> Any:
    """A value for a variable of an FMU in its unit: texts such as "700 mm" and samples that say theirs brought to it.

    All else is as it is. Raises ModelError for a text or samples of another kind, and for units that nobody knows.
    """
    samples = value if isinstance(value, Samples) and value.unit is not None else None
    texts = isinstance(value, str) or (
        isinstance(value, (list, tuple)) and any(isinstance(x, str) for x in value)
    )
    if samples is None and not texts:
        return value
    try:
        own = scale(unit) if unit else None
    except ModelError:
        expected = f"expected numbers in '{unit}', the unit of this FMU; convert them"
        raise wrong(argument, name, f"found {value!r}, {expected}") from None
    coherent = None if own is None else unit if own.slope == 1.0 and not own.zero else own.coherent
    try:
        if samples is None:
            found = given(name, value, coherent)
            return found if own is None else own.written(np.asarray(found, dtype=float))
        samples.check_unit(name, coherent)
    except ModelError as error:
        raise ModelError(str(error), place=argument, argument=argument) from None
    values = samples.values if own is None else own.written(samples.values)
    shaped = values.reshape(samples.times.size, *samples.shape, order="F")
    return Samples(samples.times, shaped, kind=samples.kind, largest_gap=samples.largest_gap)


def numbers_of(argument: str, name: str, value: Any, count: int) -> list[float]:
    """So many finite numbers; ModelError if the value of an argument at a name is something else."""
    try:
        numbers = np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        raise wrong(argument, name, f"found {value!r}, expected a number or an array") from None
    if numbers.size != count or not np.all(np.isfinite(numbers)):
        expected = f"expected {count} finite number{'s' * (count > 1)}"
        raise wrong(argument, name, f"found {value!r}, {expected}")
    return [float(number) for number in numbers]


def _functions(
    argument: str, name: str, function: Callable[[float], Any], count: int, begin: float
) -> list[Drive]:
    """A function for each element, tried at the beginning."""

    def value(t: float) -> list[float]:
        try:
            found = function(t)
        except USERS_ERRORS as error:  # whatever a function of the user raises
            failed = f"the function failed at t = {t:.6g} s with {type(error).__name__}: {error}"
            raise wrong(
                argument, name, f"{failed}; expected a value at every time of the simulation"
            ) from error
        return numbers_of(argument, f"{name} at t = {t:.6g} s", found, count)

    value(begin)
    return [Drive(lambda t, k=k: value(t)[k]) for k in range(count)]


def _samples(place: str, samples: Samples, count: int, span: tuple[float, float]) -> list[Drive]:
    """Columns of samples; those of a matrix in the order of its elements, row after row."""
    if len(samples.shape) == 1 or samples.values.shape[1] != count:
        samples.check_shape(place, (count,) if count > 1 else ())
    samples.check_cover(place, *span)
    order = np.arange(count).reshape(*reversed(samples.shape)).T.ravel()
    held = samples.kind == "constant"
    return [
        Drive(lambda t, k=k: float(samples.at(np.array(t), k)), samples.times, held) for k in order.tolist()
    ]


def knots_of(drives: Mapping[Any, Drive]) -> np.ndarray:
    """All times in s at which one of some drives jumps or bends, rising; of those that rounding parts the last."""
    found = np.unique(np.concatenate([np.zeros(0), *(drive.knots for drive in drives.values())]))
    return found[np.append(np.diff(found) > ROUNDINGS * np.spacing(np.abs(found[1:])), True)[: found.size]]
