"""Points of paths as users give them: checked, and their corners."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau.border.refusal import Given

Array = NDArray[np.float64]
SHARP = np.pi / 3  # rad: where points turn by more, a spline through them would swing out


def checked_points(name: str, points: Any, fewest: int = 2, why: str = "") -> Array:
    """Points as an array (n, 3) or (n, 2). ModelError for another shape, too few, or what is not finite."""
    found = array(name, "points", points, (None, 3), (None, 2), unit="m")
    if len(found) < fewest:
        raise ModelError(
            f"found {len(found)} points, expected at least {fewest}{why}", place=name, argument="points"
        )
    return found


def check_different(name: str, points: Array) -> None:
    """ModelError where a point repeats the one before it."""
    same = np.flatnonzero(np.all(points[1:] == points[:-1], axis=1))
    if same.size:
        more = f" and {same.size - 1} more" if same.size > 1 else ""
        raise ModelError(
            f"points[{same[0] + 1}] repeats points[{same[0]}] = {words(points[same[0]])}{more}, expected points that differ "
            "from the one before; remove it, or give a recording to Path.recorded",
            place=name,
            argument="points",
        )


def closed_points(name: str, points: Array, **others: Any) -> Array:
    """The points of a closed path, the first of them repeated at its end. others: settings that contradict."""
    for which, value in others.items():
        if value is not None:
            why = "expected None, as a smooth closed path has no end and no corner; leave it out, or "
            raise ModelError(why, Given("closed", True), place=name, found=Given(which, value))
    found = points if np.array_equal(points[0], points[-1]) else np.vstack([points, points[:1]])
    if len(found) < 4:
        few = f"found {len(found) - 1} different points of a closed path, expected at least three"
        raise ModelError(few, place=name, argument="points")
    return found


def direction(name: str, which: str, value: Any, dimension: int) -> Array | None:
    """A direction at an end as a unit vector, or None if there is none."""
    if value is None:
        return None
    found = array(name, which, value, (dimension,))
    if not np.any(found):
        raise ModelError("expected a vector that is not zero", place=name, found=Given(which, value))
    return found / np.linalg.norm(found)


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
