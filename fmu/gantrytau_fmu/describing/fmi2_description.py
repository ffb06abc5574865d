"""What is particular to a model description of FMI 2.0: nested elements, indices that count from 1.

FMI 2.0.4, sections 2.2, 3.3 and 4.3.
"""

from collections.abc import Mapping
from dataclasses import replace

from gantrytau_fmu.describing.unit_definitions import DeclaredType
from gantrytau_fmu.describing.variable_attributes import named, numbers
from gantrytau_fmu.describing.xml_text import Attribute, element, parent
from gantrytau_fmu.description import FmuDescription, FmuVariable, ModelStructure, Unknown

TYPES = {"Float64": "Real", "Int32": "Integer"}
COMMON: dict[str, Attribute] = {
    "needsExecutionTool": False,
    "canBeInstantiatedOnlyOncePerProcess": False,
    "canNotUseMemoryManagementFunctions": True,  # memory comes from the C library, never from the callbacks
    "canGetAndSetFMUstate": True,
    "canSerializeFMUstate": True,
    "providesDirectionalDerivative": True,
}
CAPABILITIES: dict[str, dict[str, Attribute]] = {
    "model-exchange": {**COMMON, "completedIntegratorStepNotNeeded": True},
    "co-simulation": {
        **COMMON,
        "canHandleVariableCommunicationStepSize": True,
        "canInterpolateInputs": False,
        "maxOutputDerivativeOrder": 0,
        "canRunAsynchronuously": False,
    },
}


def in_fmi_2(fmu: FmuDescription) -> FmuDescription:
    """A description in the words of FMI 2: other types and capabilities, indicators only counted, no terminals."""
    needed = "needsCompletedIntegratorStep"
    return replace(
        fmu,
        fmi="2.0",
        variables=tuple(replace(v, type=TYPES.get(v.type, v.type)) for v in fmu.variables),
        structure=replace(fmu.structure, indicators=(None,) * fmu.indicators),
        interfaces=tuple(
            replace(each, capabilities={"completedIntegratorStepNotNeeded": not each.capabilities[needed]})
            if needed in each.capabilities
            else each
            for each in fmu.interfaces
        ),
        terminals=(),
    )


def root_attributes(fmu: FmuDescription) -> dict[str, Attribute]:
    """The attributes of the root that only FMI 2 has."""
    return {"guid": fmu.token, "numberOfEventIndicators": fmu.indicators}


def sources_of(fmu: FmuDescription) -> str:
    """The files that a compiler is given, inside each interface."""
    names = [name.removeprefix("sources/") for name in fmu.sources]
    return parent("SourceFiles", [element("File", {"name": name}) for name in names])


def type_definition(declared: DeclaredType) -> str:
    """`SimpleType` of the variables of one unit."""
    real = {"quantity": declared.quantity, "unit": declared.unit, "displayUnit": declared.display}
    return element("SimpleType", {"name": declared.name}, element("Real", real).strip())


def variable(told: FmuVariable, declared: DeclaredType | None, state: int | None, reinit: bool) -> str:
    """`ScalarVariable` with its `Real` or `Integer`; state: reference, if this is a derivative; reinit: by events."""
    if told.integer:
        return element("ScalarVariable", named(told), element("Integer", numbers(told)).strip())
    value: dict[str, Attribute] = {
        "declaredType": declared and declared.name,
        "unit": declared and declared.unit,
        "displayUnit": (declared and told.display) or None,
        **numbers(told),
        "derivative": None if state is None else state + 1,
        "reinit": reinit or None,
    }
    return element("ScalarVariable", named(told), element("Real", value).strip())


def model_structure(lists: ModelStructure, references: Mapping[str | None, int]) -> str:
    """`ModelStructure`; it is there even when it is empty."""
    inside = "".join(
        parent(name, [_unknown(unknown, references) for unknown in unknowns])
        for name, unknowns in (
            ("Outputs", lists.outputs),
            ("Derivatives", lists.derivatives),
            ("InitialUnknowns", lists.initial_unknowns),
        )
    )
    return element("ModelStructure", {}, inside and "\n" + inside)


def _unknown(unknown: Unknown, references: Mapping[str | None, int]) -> str:
    known = unknown.dependencies
    places = None if known is None else " ".join([str(references[name] + 1) for name in known])
    kinds = None if unknown.kinds is None else " ".join(unknown.kinds)
    index = references[unknown.name] + 1
    return element("Unknown", {"index": index, "dependencies": places, "dependenciesKind": kinds})
