"""What is particular to a model description of FMI 3.0: one element for a variable, value references in the structure.

FMI 3.0.2, sections 2.4, 3.3 and 4.3.
"""

from collections.abc import Mapping

from gantrytau_fmu.describing.unit_definitions import DeclaredType
from gantrytau_fmu.describing.variable_attributes import named, numbers
from gantrytau_fmu.describing.xml_text import Attribute, element
from gantrytau_fmu.description import FmuDescription, FmuVariable, ModelStructure, Unknown

COMMON: dict[str, Attribute] = {
    "needsExecutionTool": False,
    "canBeInstantiatedOnlyOncePerProcess": False,
    "canGetAndSetFMUState": True,
    "canSerializeFMUState": True,
    "providesDirectionalDerivatives": True,
    "providesAdjointDerivatives": True,
}
CAPABILITIES: dict[str, dict[str, Attribute]] = {
    "model-exchange": {**COMMON, "needsCompletedIntegratorStep": False},
    "co-simulation": {**COMMON, "canHandleVariableCommunicationStepSize": True, "hasEventMode": False},
}


def root_attributes(fmu: FmuDescription) -> dict[str, Attribute]:
    """The attributes of the root that only FMI 3 has."""
    return {"instantiationToken": fmu.token}


def sources_of(fmu: FmuDescription) -> str:
    """Nothing: the source files stand in sources/buildDescription.xml."""
    return ""


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


def variable(told: FmuVariable, declared: DeclaredType | None, state: int | None, reinit: bool) -> str:
    """`Float64` or `Int32`; state: reference, if this is a derivative; reinit: whether events may set it."""
    if told.integer:
        return element("Int32", named(told) | numbers(told))
    attributes: dict[str, Attribute] = {
        **named(told),
        "declaredType": declared and declared.name,
        "unit": declared and declared.unit,
        "displayUnit": (declared and told.display) or None,
        **numbers(told),
        "derivative": state,
        "reinit": reinit or None,
    }
    return element("Float64", attributes)


def model_structure(lists: ModelStructure, references: Mapping[str | None, int]) -> str:
    """`ModelStructure`; it is there even when it is empty."""
    inside = "".join(
        _unknown(name, unknown, references)
        for name, unknowns in (
            ("Output", lists.outputs),
            ("ContinuousStateDerivative", lists.derivatives),
            ("InitialUnknown", lists.initial_unknowns),
        )
        for unknown in unknowns
    )
    inside += "".join(element("EventIndicator", {"valueReference": references[n]}) for n in lists.indicators)
    return element("ModelStructure", {}, inside and "\n" + inside)


def _unknown(name: str, unknown: Unknown, references: Mapping[str | None, int]) -> str:
    known = unknown.dependencies
    places = None if known is None else " ".join([str(references[name]) for name in known])
    kinds = None if unknown.kinds is None else " ".join(unknown.kinds)
    attributes = {
        "valueReference": references[unknown.name],
        "dependencies": places,
        "dependenciesKind": kinds,
    }
    return element(name, attributes)
