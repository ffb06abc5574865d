"""The attributes of a variable that both versions write alike."""

from gantrytau_fmu.describing.description_checks import initial_of, limit
from gantrytau_fmu.describing.xml_text import Attribute
from gantrytau_fmu.description import FmuVariable


def named(told: FmuVariable) -> dict[str, Attribute]:
    """Who it is, and what kind of variable."""
    return {
        "name": told.name,
        "valueReference": told.reference,
        "description": told.description or None,
        "causality": told.causality,
        "variability": told.variability,
        "initial": None if told.causality in ("input", "independent") else initial_of(told),
    }


def numbers(told: FmuVariable) -> dict[str, Attribute]:
    """Limits, nominal value, and the start if it is chosen and not found, in the type of the variable."""
    chosen = initial_of(told) in ("exact", "approx")
    nominal, start = None if told.integer else told.nominal, told.start if chosen else None
    found = {"min": told.min, "max": told.max, "nominal": nominal, "start": start}
    convert = int if told.integer else float
    return {
        name: None if (number := limit(value)) is None else convert(number) for name, value in found.items()
    }
