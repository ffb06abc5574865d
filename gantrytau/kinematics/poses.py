"""Poses and joints as arrays: one or many in, checked, and answered in the shape that was asked."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.border.checks import array
from gantrytau.border.refusal import Given, ModelError

NOT_ROTATION = 1e-6  # of an element of R.T R - I


@dataclass(frozen=True)
class Poses:
    """Positions r (N, 3) in m and orientations R (N, 3, 3), or None; one: asked for one pose without a first axis."""

    r: np.ndarray
    R: np.ndarray | None
    one: bool


def vectors(value: object, size: int, name: str, place: str) -> tuple[np.ndarray, bool]:
    """(N, size) of (size,) or (N, size), and whether it was one; infinite numbers as NaN."""
    # arrays as they are wanted are not copied: there may be millions of rows
    ready = (
        isinstance(value, np.ndarray) and value.dtype == float and value.ndim == 2 and value.shape[1] == size
    )
    found: Any = value if ready else array(place, name, value, (size,), (None, size), finite=False)
    with np.errstate(invalid="ignore", over="ignore"):
        if not np.isfinite(found.sum()):
            found = np.where(np.isinf(found), np.nan, found)
    return (found[None], True) if found.ndim == 1 else (found, False)


def poses(r: object, R: object, place: str) -> Poses:
    """Positions and orientations, one orientation for all if it is (3, 3); ModelError for what they cannot be."""
    positions, one = vectors(r, 3, "r", place)
    if R is None:
        return Poses(positions, None, one)
    turns = rotations(place, "R", R, len(positions), finite=False)
    return Poses(positions, np.broadcast_to(turns, (len(positions), 3, 3)), one)


def rotations(place: str, name: str, value: object, count: int, *, finite: bool = True) -> np.ndarray:
    """Rotation matrices, (3, 3) or one for each of so many rows, (count, 3, 3); ModelError for what is none."""
    found = array(place, name, value, (3, 3), (count, 3, 3), finite=finite)
    each = found.reshape(-1, 3, 3)
    with np.errstate(invalid="ignore"):
        gap = np.abs(np.swapaxes(each, 1, 2) @ each - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero((gap > NOT_ROTATION) | (np.linalg.det(each) < 0))
    if wrong.size:
        raise ModelError(
            f"found no rotation in row {wrong[0]} of {name}, expected R.T @ R = I and det R = 1; orthonormalise it",
            place=place,
            argument=name,
        )
    return found


def mounting_axes(place: str, name: str, value: object, *shapes: tuple[int, ...]) -> np.ndarray:
    """Directions of ball joints in one of the shapes, none of them zero."""
    axes = array(place, name, value, *shapes)
    if not (np.linalg.norm(axes, axis=-1) > 0).all():
        raise ModelError("expected directions, none of them zero", place=place, found=Given(name, value))
    return axes


def answered(one: bool, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """The arrays, without their first axis if one was asked for."""
    return tuple(array[0] if one else array for array in arrays)


def real(value: object) -> float:
    """A number as a float; NaN for what is none."""
    found = floats(value)
    return float(found) if found.shape == () else np.nan


def floats(value: object) -> np.ndarray:
    """Numbers as an array of floats; one NaN for what are none, so that no shape but () fits."""
    try:
        array = np.asarray(value)
        return np.array(np.nan) if np.iscomplexobj(array) else np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)


def shown(value: object) -> str:
    """A value in one line of a message."""
    return str(value.tolist()) if isinstance(value, np.ndarray) else repr(value)
