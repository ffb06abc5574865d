"""What is particular to a model description of FMI 3.0: one element for a variable, value references in the structure.

FMI 3.0.2, sections 2.4, 3.3 and 4.3.
"""

from collections.abc import Sequence
from functools import lru_cache

from gantrytau_fmu.describing.interface_checks import initial_of, limit
from gantrytau_fmu.describing.structure import Row, Structure
from gantrytau_fmu.describing.unit_definitions import DeclaredType
from gantrytau_fmu.describing.xml_text import Attribute, element
from gantrytau_fmu.description import Interface, Variable


def root_attributes(interface: Interface) -> dict[str, Attribute]:
    """The attributes of the root that only FMI 3 has."""
    return {"instantiationToken": interface.token}


def interface_types(interface: Interface, compiled: Sequence[str]) -> str:
    """`ModelExchange` and `CoSimulation`; the source files stand in sources/buildDescription.xml."""
    common: dict[str, Attribute] = {
        "modelIdentifier": interface.identifier,
        "needsExecutionTool": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canGetAndSetFMUState": True,
        "canSerializeFMUState": True,
        "providesDirectionalDerivatives": True,
        "providesAdjointDerivatives": True,
    }
    simulation = {**common, "canHandleVariableCommunicationStepSize": True, "hasEventMode": False}
    text = ""
    if "model-exchange" in interface.interfaces:
        text += element("ModelExchange", {**common, "needsCompletedIntegratorStep": interface.watches})
    if "co-simulation" in interface.interfaces:
        text += element("CoSimulation", simulation)
    return text


def type_definition(declared: DeclaredType) -> str:
    """`Float64Type` of the variables of one unit."""
    return element(
        "Float64Type",
        {
            "name": declared.name,
            "quantity": declared.quantity,
            "unit": declared.unit,
            "displayUnit": declared.display,
        },
    )


def variable(told: Variable, declared: DeclaredType | None, reinit: bool) -> str:
    """`Float64` or `Int32`; reinit: a state that events may set."""
    initial = initial_of(told)
    start = told.start if initial in ("exact", "approx") else None
    attributes: dict[str, Attribute] = {
        "name": told.name,
        "valueReference": told.reference,
        "description": told.description or None,
        "causality": told.causality,
        "variability": told.variability,
        "initial": None if told.causality in ("input", "independent") else initial,
    }
    if told.type == "integer":
        for name, value in (("min", limit(told.min)), ("max", limit(told.max)), ("start", start)):
            attributes[name] = None if value is None else int(value)
        return element("Int32", attributes)
    attributes["declaredType"] = declared and declared.name
    attributes["unit"] = declared and declared.unit
    for name, value in (("min", told.min), ("max", told.max), ("nominal", told.nominal), ("start", start)):
        value = limit(value)
        attributes[name] = None if value is None else float(value)
    attributes["derivative"] = told.derivative
    attributes["reinit"] = reinit or None
    return element("Float64", attributes)


def model_structure(interface: Interface, lists: Structure) -> str:
    """`ModelStructure`; it is there even when it is empty."""
    inside = "".join(
        _unknown(name, row)
        for name, rows in (
            ("Output", lists.outputs),
            ("ContinuousStateDerivative", lists.derivatives),
            ("InitialUnknown", lists.initial_unknowns),
            ("EventIndicator", [Row(place) for place in interface.indicators]),
        )
        for row in rows
    )
    return element("ModelStructure", {}, inside and "\n" + inside)


def _unknown(name: str, row: Row) -> str:
    places = None if row.dependencies is None else _listed(row.dependencies)
    kinds = None if row.kinds is None else " ".join(row.kinds)
    return element(name, {"valueReference": row.reference, "dependencies": places, "dependenciesKind": kinds})


@lru_cache(maxsize=16)  # the same long list stands at every unknown that may depend on all
def _listed(places: tuple[int, ...]) -> str:
    return " ".join(map(str, places))
