"""Numbers of a record: what a field says of them, and that they are held and checked as it says."""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

REMEDY = "correct the value in the TOML file or in dataclasses.replace"
COUNTS = {3: "three", 4: "four"}
ROUNDING = 1e-5  # ten times what six decimals leave of a rotation matrix


def quantity(unit: str, description: str, **limits: Any) -> dict[str, Any]:
    """What a field says about its number, or about each number of its array.

    limits: shape of an array; positive: each number must be above 0; least: the smallest number allowed;
    nonzero: not all may be 0; optional: None is allowed.
    """
    usual = dict(shape=(), positive=False, least=-math.inf, nonzero=False, optional=False)
    return dict(unit=unit, description=description) | usual | limits


def hold_records(record: Any, path: str, name: str, kind: type, *, count: int | None = None) -> None:
    """Check a sequence of records of one kind, and hold it as a tuple."""
    value = getattr(record, name)
    items = tuple(value) if isinstance(value, Iterable) else (value,)
    if not all(isinstance(item, kind) for item in items) or len(items) != (count or len(items)):
        found = ", ".join(type(item).__name__ for item in items) or "nothing"
        number = f"{COUNTS[count]} " if count else ""
        raise ModelError(f"{path}.{name}: found {found}; expected {number}{kind.__name__} records; {REMEDY}")
    object.__setattr__(record, name, items)


def hold_numbers(record: Any, path: str) -> None:
    """Check the quantities of a record, and hold them as floats and tuples of floats."""
    for item in quantities_of(type(record)):
        value = getattr(record, item.name)
        if not (value is None and item.metadata["optional"]):
            held = _numbers(f"{path}.{item.name}", value, item, item.metadata["shape"])
            object.__setattr__(record, item.name, held)


def quantities_of(record: type) -> list[dataclasses.Field]:
    """The fields of a record that are numbers with a unit."""
    return [item for item in dataclasses.fields(record) if "unit" in item.metadata]


def _numbers(place: str, value: Any, item: dataclasses.Field, shape: Sequence[int]) -> Any:
    """A number, or nested tuples of numbers of this shape, within the bounds of the field."""
    if not shape:
        return _number(place, value, item)
    if isinstance(value, str) or not isinstance(value, Iterable) or len(elements := list(value)) != shape[0]:
        rows = "rows of three numbers" if len(shape) > 1 else "numbers"
        raise ModelError(
            f"{place}: found {value!r}, expected {COUNTS[shape[0]]} {rows} in {_unit(item)}; {REMEDY}"
        )
    held = tuple(_numbers(f"{place}[{k}]", element, item, shape[1:]) for k, element in enumerate(elements))
    if item.metadata["nonzero"] and not any(held):
        raise ModelError(f"{place}: found {value!r}, expected the axis of a guideway; {REMEDY}")
    return held


def _number(place: str, value: Any, item: dataclasses.Field) -> float:
    """A finite number within the bounds of its field."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    positive, least = item.metadata["positive"], item.metadata["least"]
    if math.isfinite(number) and number >= least and (number > 0 or not positive):
        return number
    bound = " above 0" if positive else "" if least == -math.inf else f" of at least {least:g}"
    raise ModelError(f"{place}: found {value!r}, expected a finite number{bound} in {_unit(item)}; {REMEDY}")


def _unit(item: dataclasses.Field) -> str:
    unit = item.metadata["unit"]
    return "no unit" if unit == "1" else unit


def check_rotation(place: str, rotation: Matrix) -> None:
    """Refuse what is no rotation matrix, but for rounding of six decimals."""
    matrix = np.array(rotation)
    if np.abs(matrix.T @ matrix - np.eye(3)).max() > ROUNDING or np.linalg.det(matrix) < 0:
        raise ModelError(f"{place}: found {rotation}, expected a rotation matrix; {REMEDY}")


def check_inertia(place: str, inertia: Matrix) -> None:
    """Refuse what no rigid body has: each principal moment is at most the sum of the other two."""
    matrix = np.array(inertia)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * np.abs(matrix).max()):
        raise ModelError(f"{place}: found {inertia}, expected a symmetric matrix in kg.m2; {REMEDY}")
    moments = np.linalg.eigvalsh(matrix)
    shown = ", ".join(f"{moment:.4g}" for moment in moments)
    if moments[0] <= 0.0:
        raise ModelError(f"{place}: found principal moments {shown} kg.m2, expected all above 0; {REMEDY}")
    if moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise ModelError(
            f"{place}: found principal moments {shown} kg.m2, expected none above the sum of the others; {REMEDY}"
        )
