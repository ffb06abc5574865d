"""Numbers of a record: what a field says of them, and that they are held and checked as it says."""

import dataclasses
from collections.abc import Iterable
from typing import Any

import numpy as np

from gantrytau.border.checks import array, number
from gantrytau.border.refusal import Given, ModelError

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Pair = tuple[float, float]

REMEDY = "correct the value in the TOML file or in dataclasses.replace"
ROUNDING = 1e-5  # ten times what six decimals leave of a rotation matrix


def quantity(unit: str, description: str, **limits: Any) -> dict[str, Any]:
    """What a field says about its number, or about each number of its array.

    limits: shape of an array; positive: each number must be above 0; least: the smallest number allowed;
    nonzero: not all may be 0; optional: None is allowed; directed: each number may be a pair,
    at positive and at negative speed.
    """
    usual = dict(shape=(), positive=False, least=None, nonzero=False, optional=False, directed=False)
    return dict(unit=unit, description=description) | usual | limits


def hold_records(record: Any, path: str, name: str, kind: type, *, count: int | None = None) -> None:
    """Check a sequence of records of one kind, and hold it as a tuple."""
    value = getattr(record, name)
    items = tuple(value) if isinstance(value, Iterable) else (value,)
    if not all(isinstance(item, kind) for item in items) or len(items) != (count or len(items)):
        found = ", ".join(type(item).__name__ for item in items) or "nothing"
        many = f"{count} " if count else ""
        raise ModelError(f"{path}.{name}: found {found}; expected {many}{kind.__name__} records; {REMEDY}")
    object.__setattr__(record, name, items)


def hold_numbers(record: Any, path: str) -> None:
    """Check the quantities of a record, and hold them as floats and tuples of floats."""
    for item in quantities_of(type(record)):
        value, about = getattr(record, item.name), item.metadata
        if value is None and about["optional"]:
            continue
        bounds: dict[str, Any] = dict(above=0.0) if about["positive"] else dict(least=about["least"])
        if about["shape"]:
            shapes = [about["shape"], (*about["shape"], 2)][: 1 + about["directed"]]
            found = array(path, item.name, value, *shapes, unit=about["unit"], **bounds)
            if about["nonzero"] and not found.any():
                raise ModelError("expected the axis of a guideway", place=path, found=Given(item.name, value))
            value = tuple(map(tuple, found.tolist())) if found.ndim > 1 else tuple(found.tolist())
        else:
            value = number(path, item.name, value, unit=about["unit"], **bounds)
        object.__setattr__(record, item.name, value)


def quantities_of(record: type) -> list[dataclasses.Field]:
    """The fields of a record that are numbers with a unit."""
    return [item for item in dataclasses.fields(record) if "unit" in item.metadata]


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
