"""Signals from outside: numbers, functions of time, or samples."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.errors import ModelError
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.shapes import check_shape, elements_of, fits, joined, numpy_shape
from gantrytau.language.instructions import refuse_calls
from gantrytau.language.symbols import time


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """Values at given times, joined by straight lines: times (n,) in s, values (n,)."""

    times: np.ndarray
    values: np.ndarray


Signal = ca.SX | PiecewiseLinear  # an expression of time, or samples


def read_signals(given: Mapping[str, Any], flat: FlatModel) -> dict[str, Signal]:
    """Signals by scalar name.

    given: name -> number, array, function of time, or (times, values); arrays have the shape of the input, (n,) or
    (rows, columns), and values that with the times in front of it.
    Raises ModelError for what is none of these, has the wrong shape, gaps, NaN or unsorted times.
    """
    found: dict[str, Signal] = {}
    if not isinstance(given, Mapping):
        raise ModelError(f"inputs: found {given!r}, expected {{name: number, function of time or samples}}")
    for name, value in given.items():
        elements, shape = flat.expand(name), flat.shape(name)
        if callable(value):
            columns = _function(name, value, shape)
        elif isinstance(value, tuple) and len(value) == 2 and np.ndim(value[0]) == 1:
            columns = _samples(name, value[0], value[1], shape)
        else:
            columns = _constant(name, value, shape)
        found.update(zip(elements, columns, strict=True))
    return found


def _function(name: str, function: Callable[[Any], Any], shape: tuple[int, ...]) -> list[Signal]:
    try:
        expression = joined(function(time))
    except (TypeError, RuntimeError, NotImplementedError, ValueError, AttributeError) as error:
        reason = str(error).splitlines()[0].split(": ")[-1] if str(error) else type(error).__name__
        raise ModelError(
            f"input {name}: the function of time does not work on a symbol ({reason}); write it with "
            "gantrytau.sin, exp, if_else, ..., or give samples (times, values)"
        ) from error
    refuse_calls(f"input {name}", expression)
    if any(e.is_constant() and not np.isfinite(float(e)) for e in expression.elements()):
        raise ModelError(
            f"input {name}: the function of time does not work on a symbol (it gave {expression}); write it with "
            "gantrytau.sin, exp, if_else, ..., or give samples (times, values)"
        )
    check_shape(f"input {name}", numpy_shape(expression), shape)
    return list(expression.elements())


def _constant(name: str, value: Any, shape: tuple[int, ...]) -> list[Signal]:
    try:
        numbers = elements_of(
            f"input {name}", value, shape, "a number, a function of time, or (times, values)"
        )
    except ModelError as error:
        if isinstance(value, list) and len(value) == 2 and np.ndim(value[0]) == 1:
            raise ModelError(f"{error}; samples are a tuple, (times, values)") from None
        raise
    return [ca.SX(x) for x in numbers]


def _samples(name: str, times: Any, values: Any, shape: tuple[int, ...]) -> list[Signal]:
    try:
        times, values = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(
            f"input {name}: found samples that are no numbers, expected (times, values)"
        ) from None
    if values.shape[:1] != times.shape or not fits(values.shape[1:], shape):
        raise ModelError(
            f"input {name}: samples have shapes {times.shape} and {values.shape}, "
            f"expected ({times.size},) and {(times.size, *(shape or (1,)))}"
        )
    values = values.reshape(times.size, -1, order="F")
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values))):
        row = int(np.flatnonzero(~np.isfinite(times) | ~np.isfinite(values).all(axis=1))[0])
        raise ModelError(f"input {name}: sample {row} is not finite; remove or repair it")
    if times.size < 2 or np.any(np.diff(times) <= 0):
        raise ModelError(f"input {name}: sample times must be at least two and rise strictly; sort them")
    return [PiecewiseLinear(times, values[:, k]) for k in range(values.shape[1])]
