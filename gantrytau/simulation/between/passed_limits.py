"""Limits of variables, `min` and `max`: which a run passes, when and how far, or the end of the run there."""

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.flattening.flat_model import FlatModel, When
from gantrytau.results.result import Result

PASSED = 1e-6  # of a limit, or of the largest value where it is 0: less is the give of an end stop
SHOWN = 4  # names in a warning
HALVINGS = 40  # of the time between two rows


def limited(flat: FlatModel) -> list[tuple[str, str, ca.SX, ca.SX]]:
    """Variables with limits, element by element: name, "min" or "max", symbol, limit in symbols of parameters."""
    return [
        (name, side, symbol, limit)
        for variable in flat.variables
        for side, limits in (("min", variable.min), ("max", variable.max))
        if limits is not None
        for name, symbol, limit in zip(variable.elements, variable.symbol.elements(), limits, strict=True)
        if not (limit.is_constant() and not np.isfinite(float(limit)))
    ]


def stopping(dae: Translated) -> Translated:
    """The model with a run that ends where a variable passes its limit."""
    found = limited(dae.flat)
    if not found:
        return dae
    key = "ends at limits"
    if key not in dae.made:
        whens = list(dae.flat.whens)
        for name, side, symbol, limit in found:
            beyond = limit - symbol if side == "min" else symbol - limit
            margin = PASSED * ca.fmax(ca.fabs(limit), ca.fabs(symbol))
            words = _words(dae, name, side, limit)
            whens.append(When(beyond > margin, (), (), words, name, dae.name, 0, words=words, initially=True))
        dae.made[key] = translate_flat(replace(dae.flat, whens=tuple(whens)), dae.request)
    return dae.made[key]


def passed(dae: Translated, result: Result) -> str:
    """Warning of the limits passed by the variables of a result, "" if it keeps all."""
    told: list[tuple[float, str]] = []
    for name, side, _, limit in limited(dae.flat):
        if name not in result.names:
            continue
        bound, values = dae.number(limit), result[name]
        beyond = bound - values if side == "min" else values - bound
        rows = np.flatnonzero(beyond > PASSED * max(abs(bound), float(np.max(np.abs(values), initial=0.0))))
        if rows.size:
            worst, when = float(values[np.argmax(beyond)]), _when(result, name, bound, int(rows[0]))
            words = f"{_words(dae, name, side, limit)} at t = {when:.5g} s and comes to {worst:.6g}{_unit(dae, name)}"
            told.append((when, words))
    if not told:
        return ""
    rest = f", and {len(told) - SHOWN} more" if len(told) > SHOWN else ""
    first = "; ".join(words for _, words in sorted(told)[:SHOWN])
    return f"{first}{rest}. limits='stop' ends the run there, an EndStop holds it back"


def _words(dae: Translated, name: str, side: str, limit: ca.SX) -> str:
    return f"{name} passes its {side} of {dae.number(limit):.6g}{_unit(dae, name)}"


def _unit(dae: Translated, name: str) -> str:
    unit = dae.flat.unit(name)
    return "" if unit in (None, "1") else f" {unit}"


def _when(result: Result, name: str, bound: float, row: int) -> float:
    """When a limit is passed before a row of a result, s."""
    t = result.time
    if row == 0 or t[row - 1] == t[row]:
        return float(t[row])
    low, high = float(t[row - 1]), float(t[row])
    sign = np.sign(result[name][row] - bound)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if sign * (result.at(middle, name) - bound) > 0 else (middle, high)
    return high
