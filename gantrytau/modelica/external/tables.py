"""External functions of tables, by their names in C (Modelica.Blocks.Types), on the tables of the language."""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.functions import if_else, mod
from gantrytau.language.tables.hermite import curve, surface
from gantrytau.language.tables.tables import only_within, table
from gantrytau.modelica.external.table_files import table_of_file

OUTSIDE: Mapping[str, Any] = {
    "HoldLastPoint": "hold",
    "LastTwoPoints": "linear",
    "NoExtrapolation": "error",
    "Periodic": "hold",  # of what is brought back into the period
}
CUBIC = {
    "ContinuousDerivative": "akima",
    "MonotoneContinuousDerivative1": "fritsch-butland",
    "MonotoneContinuousDerivative2": "steffen",
    "ModifiedContinuousDerivative": "modified akima",
}
CONSTANT = "ConstantSegments"
NEVER = 1e60  # Modelica.Constants.inf


def _numbers(held: Mapping[str, Any]) -> np.ndarray:
    """The matrix of a table, from the model or from its file."""
    name, file = held["tableName"], held["fileName"]
    if file.strip() not in ("NoName", ""):
        return table_of_file(file, name, held["delimiter"], int(held["nHeaderLines"]))
    if name.strip() not in ("NoName", ""):
        raise ModelError(f"found the table '{name}' without a file, expected fileName or a matrix")
    found = np.array(held["table"], float)
    if not found.size:
        raise ModelError("found a table without numbers, expected a matrix")
    return found


def _value(held: Mapping[str, Any], column: int, x: Any, *_: Any) -> Any:
    """A column of a table at x, zero before its start."""
    numbers, wanted = _numbers(held), int(held["columns"][column - 1])
    if not 1 <= wanted <= numbers.shape[1]:
        raise ModelError(f"found column {wanted} of a table, expected 1 to {numbers.shape[1]}")
    start = held.get("startTime", 0.0)
    found = _looked_up(
        ca.SX(x) - held.get("shiftTime", 0.0), numbers[:, 0], numbers[:, wanted - 1], *_modes(held)
    )
    found = if_else(ca.SX(x) >= start, found, 0.0) if start > 0 else found
    return float(found) if found.is_constant() else found


def _modes(held: Mapping[str, Any]) -> tuple[str, str]:
    return held["smoothness"].literal, held["extrapolation"].literal


def _looked_up(at: ca.SX, xs: np.ndarray, ys: np.ndarray, smoothness: str, beyond: str) -> ca.SX:
    """The value of a curve through points; of one point its value."""
    if xs.size == 1:
        return ca.SX(ys[0])
    at, outside = _in_period(at, xs, beyond), OUTSIDE[beyond]
    if smoothness in CUBIC and xs.size > 2:
        _check_rise(np.diff(xs) > 0, xs)
        found = curve(at, xs, ys, CUBIC[smoothness], outside)
        return only_within(found, at, xs) if outside == "error" else found
    _check_rise(np.diff(xs) >= 0, xs)
    steps = np.diff(xs)
    rises = np.diff(ys) * ((steps == 0) | (smoothness == CONSTANT))
    smooth, kept = ys - np.append(0, np.cumsum(rises)), np.append(True, steps > 0)
    lines = smoothness != CONSTANT and bool(steps[0] and steps[-1])
    found = ca.SX(ys[0])
    if np.ptp(smooth) or outside == "error":
        found = table(
            at, xs[kept], smooth[kept], outside="hold" if outside == "linear" and not lines else outside
        )
    for place, rise in zip(xs[1:], rises, strict=True):
        found += if_else(at >= place, rise, 0.0) if rise else 0
    if (
        outside == "linear" and not lines
    ):  # on through the two points at either end, if they are at two places
        below, above = (float((ys[k + 1] - ys[k]) / steps[k]) if steps[k] else 0.0 for k in (0, xs.size - 2))
        found += if_else(at < xs[0], below * (at - xs[0]), 0.0) + if_else(
            at > xs[-1], above * (at - xs[-1]), 0.0
        )
    return found


def _check_rise(rises: np.ndarray, xs: np.ndarray) -> None:
    if not rises.all():
        k = int(np.argmin(rises))
        raise ModelError(f"found {xs[k]:.17g} and then {xs[k + 1]:.17g} in a table, expected rising numbers")


def _in_period(at: ca.SX, xs: np.ndarray, beyond: str) -> ca.SX:
    return xs[0] + mod(at - xs[0], xs[-1] - xs[0]) if beyond == "Periodic" and xs.size > 1 else at


def _of_two(held: Mapping[str, Any], *arguments: Any) -> Any:
    """A table of two arguments."""
    numbers, (smoothness, beyond) = _numbers(held), _modes(held)
    axes, z = (numbers[1:, 0], numbers[0, 1:]), numbers[1:, 1:]
    for axis in axes:
        _check_rise(np.diff(axis) > 0, axis)
    if smoothness in CUBIC and smoothness != "ContinuousDerivative":
        raise ModelError(
            f"found {smoothness} of a table of two arguments, expected ContinuousDerivative or segments"
        )
    at = [ca.SX(one) for one in arguments]
    if 1 in z.shape:
        k = int(z.shape[0] == 1)
        found = _looked_up(at[k], axes[k], z.ravel(), smoothness, beyond)
        return float(found) if found.is_constant() else found
    u, v = (_in_period(one, axis, beyond) for one, axis in zip(at, axes, strict=True))
    outside = OUTSIDE[beyond]
    if smoothness in CUBIC and max(z.shape) > 2:
        found = surface((u, v), *axes, z, outside)
    elif smoothness == CONSTANT:
        rows, columns = (ca.vertcat(*_steps(one, axis)) for one, axis in zip((u, v), axes, strict=True))
        found = ca.dot(rows, ca.DM(z) @ columns)
        if outside == "linear":
            ends = [ca.logic_or(x < a[0], x > a[-1]) for x, a in zip((u, v), axes, strict=True)]
            found = if_else(ca.logic_or(*ends), table((u, v), axes, z, outside="linear"), found)
    else:
        return table((u, v), axes, z, outside=outside)
    for one, axis in zip((u, v), axes, strict=True) if outside == "error" else ():
        found = only_within(found, one, axis)
    return found


def _steps(at: ca.SX, axis: np.ndarray) -> list[Any]:
    """For each point 1 from it to the next one, else 0."""
    beyond = [ca.SX(1), *(if_else(at >= place, 1.0, 0.0) for place in axis[1:].tolist()), ca.SX(0)]
    return [one - other for one, other in pairwise(beyond)]


def _end(held: Mapping[str, Any], place: int) -> float:
    return float(_numbers(held)[place, 0])


def _ends(held: Mapping[str, Any], place: int) -> np.ndarray:
    """The ends of both arguments; place: 1 for the least ones, -1 for the greatest ones."""
    numbers = _numbers(held)
    return np.array([numbers[place, 0], numbers[0, place]], dtype=object)


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    f"ModelicaStandardTables_{name}": function
    for name, function in {
        "CombiTable1D_getValue": _value,
        "CombiTimeTable_getValue": _value,
        "CombiTable2D_getValue": _of_two,
        "CombiTable1D_minimumAbscissa": partial(_end, place=0),
        "CombiTable1D_maximumAbscissa": partial(_end, place=-1),
        "CombiTimeTable_minimumTime": partial(_end, place=0),
        "CombiTimeTable_maximumTime": partial(_end, place=-1),
        "CombiTable2D_minimumAbscissa": partial(_ends, place=1),
        "CombiTable2D_maximumAbscissa": partial(_ends, place=-1),
        "CombiTimeTable_nextTimeEvent": lambda *_: NEVER,
    }.items()
}
