"""Signals from outside: numbers, functions of time, or samples."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.border.units import given as in_si
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.shapes import check_shape, elements_of, joined, numpy_shape
from gantrytau.inputs.input_signal import Span, with_course, with_seeds
from gantrytau.inputs.samples import Samples
from gantrytau.language.instructions import refuse_calls
from gantrytau.language.symbols import time


@dataclass(frozen=True, eq=False)
class SampledCourse:
    """Values at given times, held until the next or joined by straight lines: times (n,) in s, values (n,)."""

    times: np.ndarray
    values: np.ndarray
    held: bool


Signal = ca.SX | SampledCourse  # an expression of time, or samples


def signal_key(signal: Signal) -> tuple[str, object]:
    """Key of a signal: signals with equal keys lead to the same equations."""
    if isinstance(signal, SampledCourse):
        return "samples", None
    return "function", ca.Function("signal", [time], [signal]).serialize()


def read_signals(
    given: Mapping[str, Any], flat: FlatModel, span: Span, seed: int | None = None
) -> dict[str, Signal]:
    """Signals by scalar name.

    given: name -> number, array, function of time, Samples, (times, values) or a signal as `white_noise`; arrays have the
    shape of the input, (n,) or (rows, columns), and samples that with the times in front of it. span: of the run, s.
    seed: of the run, for signals without one.
    Raises ModelError for what is none of these, has the wrong shape, does not cover the run, NaN or unsorted times.
    """
    found: dict[str, Signal] = {}
    named = with_seeds(given, seed)
    flat.refuse_twice("inputs", named)
    for name, value in named.items():
        elements, shape = flat.expand(name), flat.shape(name)
        value = in_si(f"input {name}", value, flat.unit(name))
        course = with_course(name, value, shape, lambda: span)
        if callable(course):
            columns = _function(name, course, shape)
        elif isinstance(course, Samples):
            course.check_unit(f"input {name}", flat.unit(name))
            columns = _samples(name, course, shape, span)
        else:
            columns = _constant(name, course, shape)
        found.update(zip(elements, columns, strict=True))
    return found


def _function(name: str, function: Callable[[Any], Any], shape: tuple[int, ...]) -> list[Signal]:
    try:
        expression = joined(function(time))
    except (TypeError, RuntimeError, NotImplementedError, ValueError, AttributeError) as error:
        reason = str(error).splitlines()[0].split(": ")[-1] if str(error) else type(error).__name__
        raise ModelError(
            f"input {name}: the function of time does not work on a symbol ({reason}); write it with "
            "gantrytau.sin, exp, if_else, ..., or give Samples(times, values)"
        ) from error
    refuse_calls(f"input {name}", expression)
    if any(e.is_constant() and not np.isfinite(float(e)) for e in expression.elements()):
        raise ModelError(
            f"input {name}: the function of time does not work on a symbol (it gave {expression}); write it with "
            "gantrytau.sin, exp, if_else, ..., or give Samples(times, values)"
        )
    check_shape(f"input {name}", numpy_shape(expression), shape)
    return list(expression.elements())


def _constant(name: str, value: Any, shape: tuple[int, ...]) -> list[Signal]:
    try:
        numbers = elements_of(
            f"input {name}",
            value,
            shape,
            "a number, a function of time, Samples(times, values) or a signal as white_noise",
        )
    except ModelError as error:
        if isinstance(value, list) and len(value) == 2 and np.ndim(value[0]) == 1:
            raise ModelError(f"{error}; samples are a tuple, (times, values)") from None
        raise
    return [ca.SX(x) for x in numbers]


def _samples(name: str, samples: Samples, shape: tuple[int, ...], span: Span) -> list[Signal]:
    samples.check_shape(f"input {name}", shape)
    samples.check_cover(f"input {name}", *span)
    return [SampledCourse(samples.times, column, samples.kind == "constant") for column in samples.values.T]
