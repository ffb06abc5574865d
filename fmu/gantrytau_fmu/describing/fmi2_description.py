"""What is particular to a model description of FMI 2.0: nested elements, indices that count from 1.

FMI 2.0.4, sections 2.2, 3.3 and 4.3.
"""

from collections.abc import Sequence

from gantrytau_fmu.describing.interface_checks import initial_of, limit
from gantrytau_fmu.describing.structure import Row, Structure
from gantrytau_fmu.describing.unit_definitions import DeclaredType
from gantrytau_fmu.describing.xml_text import Attribute, element, parent
from gantrytau_fmu.description import Interface, Variable


def root_attributes(interface: Interface) -> dict[str, Attribute]:
    """The attributes of the root that only FMI 2 has."""
    return {"guid": interface.token, "numberOfEventIndicators": len(interface.indicators)}


def interface_types(interface: Interface, compiled: Sequence[str]) -> str:
    """`ModelExchange` and `CoSimulation`; compiled: the source files that a compiler is given."""
    common: dict[str, Attribute] = {
        "modelIdentifier": interface.identifier,
        "needsExecutionTool": False,
        "canBeInstantiatedOnlyOncePerProcess": False,
        "canNotUseMemoryManagementFunctions": True,  # memory comes from the C library, never from the callbacks
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": True,
    }
    exchange = {**common, "completedIntegratorStepNotNeeded": not interface.watches}
    simulation = {
        **common,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": False,
        "maxOutputDerivativeOrder": 0,
        "canRunAsynchronuously": False,
    }
    files = parent("SourceFiles", [element("File", {"name": name}) for name in compiled])
    text = ""
    if "model-exchange" in interface.interfaces:
        text += element("ModelExchange", exchange, files and "\n" + files)
    if "co-simulation" in interface.interfaces:
        text += element("CoSimulation", simulation, files and "\n" + files)
    return text


def type_definition(declared: DeclaredType) -> str:
    """`SimpleType` of the variables of one unit."""
    real = {"quantity": declared.quantity, "unit": declared.unit, "displayUnit": declared.display}
    return element("SimpleType", {"name": declared.name}, element("Real", real).strip())


def variable(told: Variable, declared: DeclaredType | None, reinit: bool) -> str:
    """`ScalarVariable` with its `Real` or `Integer`; reinit: a state that events may set."""
    initial = initial_of(told)
    attributes: dict[str, Attribute] = {
        "name": told.name,
        "valueReference": told.reference,
        "description": told.description or None,
        "causality": told.causality,
        "variability": told.variability,
        "initial": None if told.causality in ("input", "independent") else initial,
    }
    start = told.start if initial in ("exact", "approx") else None
    value: dict[str, Attribute]
    if told.type == "integer":
        value = {
            name: None if x is None else int(x)
            for name, x in (("min", limit(told.min)), ("max", limit(told.max)))
        }
        value["start"] = None if start is None else int(start)
        return element("ScalarVariable", attributes, element("Integer", value).strip())
    value = {
        "declaredType": declared and declared.name,
        "unit": declared and declared.unit,
        "min": _real(told.min),
        "max": _real(told.max),
        "nominal": _real(told.nominal),
        "start": _real(start),
        "derivative": None if told.derivative is None else told.derivative + 1,
        "reinit": reinit or None,
    }
    return element("ScalarVariable", attributes, element("Real", value).strip())


def _real(value: float | int | None) -> float | None:
    value = limit(value)
    return None if value is None else float(value)


def model_structure(interface: Interface, lists: Structure) -> str:
    """`ModelStructure`; it is there even when it is empty."""
    inside = "".join(
        parent(name, map(_unknown, rows))
        for name, rows in (
            ("Outputs", lists.outputs),
            ("Derivatives", lists.derivatives),
            ("InitialUnknowns", lists.initial_unknowns),
        )
    )
    return element("ModelStructure", {}, inside and "\n" + inside)


def _unknown(row: Row) -> str:
    places = None if row.dependencies is None else " ".join([str(place + 1) for place in row.dependencies])
    kinds = None if row.kinds is None else " ".join(row.kinds)
    return element("Unknown", {"index": row.reference + 1, "dependencies": places, "dependenciesKind": kinds})
