"""Signals from outside: numbers, functions of time, or samples."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.errors import ModelError
from gantrytau.language.instructions import refuse_calls
from gantrytau.language.symbols import time


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """Values at given times, joined by straight lines: times (n,) in s, values (n,)."""

    times: np.ndarray
    values: np.ndarray


Signal = ca.SX | PiecewiseLinear  # an expression of time, or samples


def read_signals(given: Mapping[str, Any], expand: Callable[[str], Sequence[str]]) -> dict[str, Signal]:
    """Signals by scalar name.

    given: name -> number, array, function of time, or (times, values); expand: scalar names of a name.
    Raises ModelError for what is none of these, has the wrong length, gaps, NaN or unsorted times.
    """
    found: dict[str, Signal] = {}
    if not isinstance(given, Mapping):
        raise ModelError(f"inputs: found {given!r}, expected {{name: number, function of time or samples}}")
    for name, value in given.items():
        elements = expand(name)
        if callable(value):
            columns = _function(name, value, len(elements))
        elif isinstance(value, tuple) and len(value) == 2 and np.ndim(value[0]) == 1:
            columns = _samples(name, value[0], value[1], len(elements))
        else:
            columns = _constant(name, value, len(elements))
        found.update(zip(elements, columns, strict=True))
    return found


def _function(name: str, function: Callable[[Any], Any], size: int) -> list[Signal]:
    try:
        value = function(time)
        if isinstance(value, (list, tuple)):
            value = ca.vertcat(*value)
        expression = ca.densify(ca.SX(value))
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
    return list(_sized(name, expression, size))


def _constant(name: str, value: Any, size: int) -> list[Signal]:
    try:
        numbers = np.asarray(value, dtype=float).ravel()
    except (TypeError, ValueError):
        raise ModelError(
            f"input {name}: found {value!r}, expected a number, a function of time, or (times, values)"
        ) from None
    if not np.all(np.isfinite(numbers)):
        raise ModelError(f"input {name}: found {value!r}, expected finite numbers")
    return list(_sized(name, ca.SX(ca.DM(numbers)), size))


def _sized(name: str, expression: ca.SX, size: int) -> list[ca.SX]:
    if expression.numel() != size:
        raise ModelError(f"input {name}: found {expression.numel()} values, expected {size}")
    return expression.elements()


def _samples(name: str, times: Any, values: Any, size: int) -> list[Signal]:
    times, values = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    if values.ndim == 1:
        values = values[:, None]
    if values.shape != (times.size, size):
        raise ModelError(
            f"input {name}: samples have shapes {times.shape} and {values.shape}, "
            f"expected ({times.size},) and ({times.size}, {size})"
        )
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values))):
        row = int(np.flatnonzero(~np.isfinite(times) | ~np.isfinite(values).all(axis=1))[0])
        raise ModelError(f"input {name}: sample {row} is not finite; remove or repair it")
    if times.size < 2 or np.any(np.diff(times) <= 0):
        raise ModelError(f"input {name}: sample times must be at least two and rise strictly; sort them")
    return [PiecewiseLinear(times, values[:, k]) for k in range(size)]
