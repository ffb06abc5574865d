"""The XML files of an FMU that say what it is: modelDescription.xml and sources/buildDescription.xml.

One record, `FmuDescription`, is written for FMI 2.0 or 3.0; what differs between them stands in `fmi2_description` and
`fmi3_description`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple
from pathlib import PurePosixPath

from gantrytau_fmu.describing import fmi2_description, fmi3_description
from gantrytau_fmu.describing.description_checks import check_description
from gantrytau_fmu.describing.model_structure import written_structure
from gantrytau_fmu.describing.unit_definitions import declared_types, unit_definitions
from gantrytau_fmu.describing.xml_text import HEAD, Attribute, element, parent
from gantrytau_fmu.description import FmuDescription

COMPILED = "fmu.c"  # the only translation unit; it includes the others
# the categories of the C runtime (core.h), in its order
LOG_CATEGORIES = {
    "logEvents": "time and state events",
    "logCalls": "calls of the FMI functions",
    "logStatusWarning": "what may be wrong",
    "logStatusError": "why a call failed",
}
WITHOUT_MATH_LIBRARY = (
    "x86_64-windows",
    "aarch64-windows",
)  # there the C runtime holds the functions of math.h

TAGS = {"model-exchange": "ModelExchange", "co-simulation": "CoSimulation"}


def model_description(fmu: FmuDescription) -> bytes:
    """modelDescription.xml, UTF-8. Raises ModelError for what no valid FMU can have, as a name that is there twice."""
    check_description(fmu)
    version = fmi2_description if fmu.fmi == "2.0" else fmi3_description
    types = declared_types(fmu.variables)
    lists = written_structure(fmu)
    reset = set(fmu.states) if fmu.indicators and fmu.has("model-exchange") else set()
    references: dict[str | None, int] = {v.name: v.reference for v in fmu.variables}
    variables = [
        version.variable(
            v, types.get(v.unit) if v.real else None, references.get(v.derivative), v.name in reset
        )
        for v in fmu.variables
    ]
    children = [
        *_interfaces(fmu, version.CAPABILITIES, version.sources_of(fmu)),
        unit_definitions(types.values()),
        parent("TypeDefinitions", map(version.type_definition, types.values())),
        _log_categories(),
        _default_experiment(fmu),
        parent("ModelVariables", variables),
        version.model_structure(lists, references),
    ]
    text = HEAD + parent("fmiModelDescription", children, _root(fmu) | version.root_attributes(fmu))
    return text.encode()


def _interfaces(
    fmu: FmuDescription, capabilities: Mapping[str, Mapping[str, Attribute]], inside: str
) -> Iterator[str]:
    """`ModelExchange` and `CoSimulation`: what the runtime can do, unless the description says something else."""
    for kind, tag in TAGS.items():
        for each in (each for each in fmu.interfaces if each.kind == kind):
            told = {name: each.capabilities.get(name, value) for name, value in capabilities[kind].items()}
            yield element(tag, {"modelIdentifier": each.identifier, **told}, inside and "\n" + inside)


def _root(fmu: FmuDescription) -> dict[str, Attribute]:
    return {
        "fmiVersion": fmu.fmi,
        "modelName": fmu.name,
        "description": fmu.description or None,
        "author": fmu.author or None,
        "version": fmu.version or None,
        "copyright": fmu.copyright or None,
        "license": fmu.license or None,
        "generationTool": fmu.tool or None,
        "generationDateAndTime": fmu.generated or None,
        "variableNamingConvention": "structured",
    }


def _log_categories() -> str:
    named = [{"name": name, "description": text} for name, text in LOG_CATEGORIES.items()]
    return parent("LogCategories", [element("Category", attributes) for attributes in named])


def _default_experiment(fmu: FmuDescription) -> str:
    names = ("startTime", "stopTime", "tolerance", "stepSize")
    return element("DefaultExperiment", dict(zip(names, map(float, astuple(fmu.experiment)), strict=True)))


def build_description(fmu: FmuDescription, names: Sequence[str], language: str = "C99") -> bytes:
    """sources/buildDescription.xml of FMI 3.0: what to compile, for importers that build the FMU themselves.

    names: of the files in sources/; their folders are told as include directories. The first configuration
    is for every platform; Windows has no separate mathematics library to link.
    """
    folders = sorted({PurePosixPath(name).parent.as_posix() for name in (COMPILED, *names)})
    files = parent(
        "SourceFileSet",
        [
            element("SourceFile", {"name": COMPILED}),
            *(element("IncludeDirectory", {"name": folder}) for folder in folders),
        ],
        {"name": "fmu", "language": language},
    )
    library = element("Library", {"name": "m", "external": True, "description": "mathematics library of C"})
    identifier = {"modelIdentifier": fmu.identifier}
    configurations = [
        parent("BuildConfiguration", [files, library], identifier),
        *(
            parent("BuildConfiguration", [files], identifier | {"platform": platform})
            for platform in WITHOUT_MATH_LIBRARY
        ),
    ]
    return (HEAD + parent("fmiBuildDescription", configurations, {"fmiVersion": fmu.fmi})).encode()
