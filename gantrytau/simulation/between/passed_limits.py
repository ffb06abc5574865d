"""Limits of variables, `min` and `max`: which a run passes, when and how far, or the end of the run there."""

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.flattening.flat_model import FlatModel, When
from gantrytau.results.passages import PASSED, passages
from gantrytau.results.result import Result

SHOWN = 4  # names in a warning


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
            words = _words(dae, name, side, dae.number(limit))
            whens.append(When(beyond > margin, (), (), words, name, dae.name, 0, words=words, initially=True))
        dae.made[key] = translate_flat(replace(dae.flat, whens=tuple(whens)), dae.request)
    return dae.made[key]


def passed(dae: Translated, result: Result) -> str:
    """Warning of the limits passed by the variables of a result, "" if it keeps all."""
    found = passages(result)
    if not found:
        return ""
    told = [
        f"{_words(dae, one.name, one.side, one.limit)} at t = {one.time:.5g} s and comes to {one.worst:.6g}"
        f"{_unit(dae, one.name)}"
        for one in found[:SHOWN]
    ]
    rest = f", and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return f"{'; '.join(told)}{rest}. limits='stop' ends the run there, an EndStop holds it back"


def _words(dae: Translated, name: str, side: str, limit: float) -> str:
    return f"{name} passes its {side} of {limit:.6g}{_unit(dae, name)}"


def _unit(dae: Translated, name: str) -> str:
    unit = dae.flat.unit(name)
    return "" if unit in (None, "1") else f" {unit}"
