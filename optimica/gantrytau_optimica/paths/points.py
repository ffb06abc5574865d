"""Points of paths as users give them: checked, and their corners."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gantrytau import ModelError

Array = NDArray[np.float64]
SHARP = np.pi / 3  # rad: where points turn by more, a spline through them would swing out


def checked_points(name: str, points: Any, fewest: int = 2, why: str = "") -> Array:
    """Points as an array (n, 3) or (n, 2). ModelError for another shape, too few, or what is not finite."""
    try:
        found = np.array(points, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(
            f"{name}: found {_short(points)}, expected points (n, 3) or (n, 2), numbers in m"
        ) from None
    if found.ndim != 2 or found.shape[1] not in (2, 3):
        transposed = found.ndim == 2 and found.shape[0] in (2, 3)
        advice = "; give the transposed array" if transposed else ""
        raise ModelError(
            f"{name}: found an array of shape {found.shape}, expected points (n, 3) or (n, 2), in m{advice}"
        )
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if bad.size:
        more = f" and {bad.size - 1} more" if bad.size > 1 else ""
        raise ModelError(
            f"{name}: points[{bad[0]}] = {words(found[bad[0]])}{more}, expected finite numbers; leave out such points"
        )
    if len(found) < fewest:
        raise ModelError(f"{name}: found {len(found)} points, expected at least {fewest}{why}")
    return found


def check_different(name: str, points: Array) -> None:
    """ModelError where a point repeats the one before it, or the way goes nowhere."""
    same = np.flatnonzero(np.all(points[1:] == points[:-1], axis=1))
    if same.size == len(points) - 1:
        raise ModelError(
            f"{name}: found one place {words(points[0])} only, expected at least two different points"
        )
    if same.size:
        more = f" and {same.size - 1} more" if same.size > 1 else ""
        raise ModelError(
            f"{name}: points[{same[0] + 1}] repeats points[{same[0]}] = {words(points[same[0]])}{more}, expected points "
            "that differ from the one before; remove it, or give a recording to Path.recorded"
        )


def closed_points(name: str, points: Array, *others: Any) -> Array:
    """The points of a closed path, the first of them repeated at its end. others: settings that contradict."""
    if any(other is not None for other in others):
        raise ModelError(
            f"{name}: found closed=True with blend or a direction at an end, expected neither, as a smooth closed path "
            "has no end and no corner; leave them out, or closed=True"
        )
    found = points if np.array_equal(points[0], points[-1]) else np.vstack([points, points[:1]])
    if len(found) < 4:
        raise ModelError(
            f"{name}: found {len(found) - 1} different points of a closed path, expected at least three"
        )
    return found


def direction(name: str, value: Any, dimension: int) -> Array | None:
    """A direction at an end as a unit vector, or None if there is none."""
    if value is None:
        return None
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (dimension,) or not np.all(np.isfinite(found)) or not np.any(found):
        raise ModelError(
            f"{name}: found the direction {_short(value)}, expected {dimension} finite numbers that are not all zero"
        )
    return found / np.linalg.norm(found)


def positive(name: str, which: str, value: Any) -> float:
    """A distance in m. ModelError if it is not above zero."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < np.inf:
        raise ModelError(f"{name}: {which}={value!r}, expected a distance above 0, in m, such as 0.001")
    return float(value)


def coordinates(found: Any) -> ca.SX:
    """What a user's function of a symbol returned, as a column."""
    if isinstance(found, (ca.SX, ca.DM)):
        return ca.densify(ca.vec(ca.SX(found)))
    return ca.densify(ca.vertcat(*(ca.SX(x) for x in np.ravel(np.array(found, dtype=object)).tolist())))


def corner_error(name: str, points: Array, angles: Array, limit: float, advice: str) -> ModelError:
    """The sharpest corner of a polyline, and what can be done. angles: at points 1 to n - 2, or to the last if closed."""
    sharp = np.flatnonzero(angles > limit)
    row = int(np.argmax(angles)) + 1
    others = f", the sharpest of {sharp.size} corners" if sharp.size > 1 else ""
    smooth = f"of at most {np.degrees(limit):.0f} deg" if limit > 0.01 else "straight on"
    return ModelError(
        f"{name}: at points[{row % (len(points) - 1)}] = {words(points[row])} the way turns by "
        f"{np.degrees(angles[row - 1]):.3g} deg{others}, expected turns {smooth}, as no robot can turn on the spot at "
        f"speed; {advice}, or end the path at the corner and go on with another"
    )


def turns(points: Array) -> Array:
    """The angle in rad by which a polyline turns at each of its inner points, (n - 2,)."""
    chords = np.diff(points, axis=0)
    directions = chords / np.linalg.norm(chords, axis=1)[:, None]
    # an arc cosine would lose half of the digits of a small angle
    apart = np.linalg.norm(directions[1:] - directions[:-1], axis=1)
    return 2 * np.arcsin(np.clip(apart / 2, 0.0, 1.0))


def words(place: Array) -> str:
    """A place for a message: (1, 2, 0.5) m."""
    return f"({', '.join(f'{x:.6g}' for x in place)}) m"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
