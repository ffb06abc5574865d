"""External functions of tables, by their names in C (Modelica.Blocks.Types), on `table` of the language."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.functions import if_else, mod
from gantrytau.language.tables.tables import table

OUTSIDE: Mapping[str, Any] = {
    "HoldLastPoint": "hold",
    "LastTwoPoints": "linear",
    "NoExtrapolation": "error",
    "Periodic": "linear",
}
NEVER = 1e60  # Modelica.Constants.inf


def external_value(name: str, arguments: Sequence[Any]) -> Any:
    """The value of an external function; ModelError for one that is not known."""
    found = FUNCTIONS.get(name.removeprefix("ModelicaStandardTables_"))
    if found is None:
        raise ModelError(f"found the external function {name}(), which is not supported; write an algorithm")
    return found(*arguments)


def _value(held: Mapping[str, Any], column: int, x: Any, *_: Any) -> Any:
    """A column of a table at x, before its start zero; ModelError for what `table` cannot do."""
    smoothness, beyond = held["smoothness"].literal, held["extrapolation"].literal
    if {held["tableName"], held["fileName"]} - {"NoName", ""}:
        raise ModelError("found a table of a file, which is not supported, expected a matrix in the model")
    if smoothness not in ("LinearSegments", "ConstantSegments") or beyond not in OUTSIDE:
        raise ModelError(
            f"found a table with {smoothness} and {beyond}, which is not supported, expected LinearSegments or "
            "ConstantSegments"
        )
    xs, ys = _ends(held), np.array(held["table"], float)[:, int(held["columns"][column - 1]) - 1]
    at = ca.SX(x) - held.get("shiftTime", 0.0)
    if beyond == "Periodic":
        at = xs[0] + mod(at - xs[0], xs[-1] - xs[0])
    rises = np.diff(ys) * ((np.diff(xs) == 0) | (smoothness == "ConstantSegments"))
    smooth, kept = ys - np.append(0, np.cumsum(rises)), np.append(True, np.diff(xs) > 0)
    found = table(at, xs[kept], smooth[kept], outside=OUTSIDE[beyond]) if np.ptp(smooth) else ca.SX(ys[0])
    for place, rise in zip(xs[1:], rises, strict=True):
        found = found + (if_else(at >= place, rise, 0.0) if rise else 0)
    start = held.get("startTime", 0.0)
    found = if_else(ca.SX(x) >= start, found, 0.0) if start > 0 else found
    return float(found) if found.is_constant() else found


def _ends(held: Mapping[str, Any], place: int | None = None) -> Any:
    """The arguments of a table, or the one of a place."""
    xs = np.array(held["table"], float)[:, 0]
    return xs if place is None else float(xs[place] + held.get("shiftTime", 0.0))


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "CombiTable1D_getValue": _value,
    "CombiTimeTable_getValue": _value,
    "CombiTable1D_minimumAbscissa": partial(_ends, place=0),
    "CombiTable1D_maximumAbscissa": partial(_ends, place=-1),
    "CombiTimeTable_minimumTime": partial(_ends, place=0),
    "CombiTimeTable_maximumTime": partial(_ends, place=-1),
    "CombiTimeTable_nextTimeEvent": lambda *_: NEVER,
}
