"""Poses and joints as arrays: one or many in, checked, and answered in the shape that was asked."""

from dataclasses import dataclass

import numpy as np

from gantrytau.border.refusal import ModelError

NOT_ROTATION = 1e-6  # of an element of R.T R - I


@dataclass(frozen=True)
class Poses:
    """Positions r (N, 3) in m and orientations R (N, 3, 3), or None; one: asked for one pose without a first axis."""

    r: np.ndarray
    R: np.ndarray | None
    one: bool


def vectors(value: object, size: int, name: str, place: str) -> tuple[np.ndarray, bool]:
    """(N, size) of (size,) or (N, size), and whether it was one; infinite numbers as NaN.

    ModelError for any other shape.
    """
    array = _numbers(value, name, place)
    with np.errstate(invalid="ignore", over="ignore"):
        if not np.isfinite(array.sum()):
            array = np.where(np.isinf(array), np.nan, array)
    if array.shape == (size,):
        return array[None], True
    if array.ndim == 2 and array.shape[1] == size:
        return array, False
    raise ModelError(
        f"{place}: found {name} of shape {array.shape}, expected ({size},) or (N, {size}), one row a pose; "
        f"reshape it"
    )


def poses(r: object, R: object, place: str) -> Poses:
    """Positions and orientations, one orientation for all if it is (3, 3); ModelError for what they cannot be."""
    positions, one = vectors(r, 3, "r", place)
    if R is None:
        return Poses(positions, None, one)
    array = _numbers(R, "R", place)
    if array.shape not in ((3, 3), (len(positions), 3, 3)):
        raise ModelError(
            f"{place}: found R of shape {array.shape}, expected (3, 3) or ({len(positions)}, 3, 3), as r has "
            f"{len(positions)} rows; give one orientation, or one for each row"
        )
    array = np.broadcast_to(array, (len(positions), 3, 3))
    with np.errstate(invalid="ignore"):
        gap = np.abs(np.swapaxes(array, 1, 2) @ array - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero((gap > NOT_ROTATION) | (np.linalg.det(array) < 0))
    if wrong.size:
        rows = ", ".join(map(str, wrong[:5])) + (", ..." if wrong.size > 5 else "")
        raise ModelError(
            f"{place}: found matrices R that are no rotations, in rows {rows}, expected R.T @ R = I and det R = 1; "
            "orthonormalise them"
        )
    return Poses(positions, array, one)


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


def _numbers(value: object, name: str, place: str) -> np.ndarray:
    array = floats(value)
    if array.shape == () and np.isnan(array):
        raise ModelError(
            f"{place}: found {name} = {shown(value)}, expected an array of numbers, not complex; give one row a pose"
        )
    return array
