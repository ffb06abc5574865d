"""Description of a translated model: its states, inputs and blocks, and all names with their numbers at the start."""

from collections.abc import Mapping

import numpy as np

from gantrytau.border.units import scale
from gantrytau.compiler.translated import Translated
from gantrytau.describing.described import Description, Listing
from gantrytau.describing.short_values import array_words, number
from gantrytau.flattening.flat_model import FlatParameter, FlatVariable
from gantrytau.language.symbols import split_derivative

LONG = 6  # elements of a vector that is spoken
ROUNDED = 15  # digits behind the point: what is smaller is rounding


def dae_described(dae: Translated, name: str = "") -> Description:
    """Description of a translated model, or of one variable or parameter; ModelError for unknown names."""
    if name:
        return _of_quantity(dae, name)
    flat = dae.flat
    facts = [
        ("states", ", ".join(dae.states) or "none"),
        ("inputs", ", ".join(dae.inputs) or "none"),
        ("found by iteration", ", ".join(dae.algebraics) or "nothing, all blocks have closed forms"),
    ]
    columns, start = ("name", "value", "unit", "description"), _start(dae)
    parameters = [_row(dae.parameter_values, p) for p in flat.parameters]
    ordered = sorted(flat.variables, key=lambda v: v.name.count("."))  # what is deep in components comes last
    outputs = [_row(start, v) for v in ordered if v.kind == "output"]
    variables = [_row(start, v) for v in ordered if v.kind != "output"]
    heads = ("name", "start", "unit", "description")
    tables = (
        Listing.of("Parameters", columns, parameters),
        Listing.of("Outputs", heads, outputs),
        Listing.of("Variables", heads, variables),
    )
    kind = f"translated model, {len(dae.variables)} variables in {len(dae.blocks)} blocks"
    return Description(dae.name, kind, "", tuple(facts), tables)


def _row(values: Mapping[str, float], quantity: FlatVariable) -> tuple[str, ...]:
    shape = f"[{', '.join(map(str, quantity.shape))}]" if quantity.shape else ""
    unit = quantity.display or quantity.unit
    told = _words(_shown(quantity, _numbers(values, quantity)))
    return f"{quantity.name}{shape}", told, "" if unit in (None, "1") else str(unit), quantity.description


def _shown(quantity: FlatVariable, values: np.ndarray) -> np.ndarray:
    """Values in the unit in which they are shown."""
    return np.asarray(scale(quantity.display).written(values)) if quantity.display else values


def _numbers(values: Mapping[str, float], quantity: FlatVariable) -> np.ndarray:
    """Values of a parameter, or of a variable at the start, in its shape; NaN where it has none."""
    found = np.array([values.get(n, np.nan) for n in quantity.elements], dtype=float)
    return found.reshape(quantity.shape, order="F")


def _start(dae: Translated) -> dict[str, float]:
    """Consistent values of the unknowns at the start, those of what equals them included; parameters are numbers."""
    found = dict(dae.start)
    for name in dae.variables:
        alias = dae.root(name)
        if alias is not None and alias.offset.is_constant() and (not alias.symbol or alias.symbol in found):
            found[name] = float(alias.offset) + alias.factor * (found[alias.symbol] if alias.symbol else 0.0)
    return found


def _words(values: np.ndarray) -> str:
    if np.all(np.isnan(values)) or values.size > LONG:
        return ""
    return array_words(np.round(values, ROUNDED))


def _of_quantity(dae: Translated, name: str) -> Description:
    flat = dae.flat
    flat.expand(name)  # an unknown name raises
    base, order = split_derivative(name)
    quantity = flat.vectors.get(base) or next(v for v in flat.vectors.values() if base in v.elements)
    kind = "parameter" if isinstance(quantity, FlatParameter) else "variable"
    facts = [("unit", quantity.display or quantity.unit or "1")]
    if quantity.shape and base == quantity.name:
        facts.append(("shape", str(quantity.shape)))
    if order:
        facts = [("derivative of", base)]
    elements = [n for n in quantity.elements if base in (n, quantity.name)]
    numbers = _start(dae) | dict(dae.parameter_values)
    told = [number(float(_shown(quantity, np.array(numbers[n])))) for n in elements if n in numbers]
    if told and not order and len(told) <= LONG:
        facts.append(("value" if kind == "parameter" else "start", ", ".join(told)))
    for role, names in (("state", dae.states), ("input", dae.inputs), ("output", dae.outputs)):
        if set(names) & ({name} if order else set(elements)):
            facts.append(("role", role))
    if quantity.owner:
        facts.append(("of", quantity.owner))
    return Description(name, f"{kind} of {dae.name}", quantity.description, tuple(facts))
