"""The XML files of an FMU that say what it is: modelDescription.xml and sources/buildDescription.xml.

One record, `Interface`, is written for FMI 2.0 or 3.0; what differs between them stands in `description_2` and
`description_3`.
"""

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Literal

from gantrytau_fmu.describing import fmi2_description as description_2
from gantrytau_fmu.describing import fmi3_description as description_3
from gantrytau_fmu.describing.interface_checks import check_interface
from gantrytau_fmu.describing.structure import structure
from gantrytau_fmu.describing.unit_definitions import declared_types, unit_definitions
from gantrytau_fmu.describing.xml_text import HEAD, Attribute, element, parent
from gantrytau_fmu.description import Interface

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

Version = Literal["2.0", "3.0"]


def model_description(interface: Interface, fmi: Version, sources: Sequence[str] = ()) -> bytes:
    """modelDescription.xml, UTF-8.

    sources: names of the files in sources/, if the FMU carries them. Raises ModelError for an interface that no valid
    FMU can have, such as a name that is there twice.
    """
    check_interface(interface, fmi)
    version = description_2 if fmi == "2.0" else description_3
    types = declared_types(interface.variables)
    lists = structure(interface, fmi)
    reset = set(lists.states) if interface.indicators and "model-exchange" in interface.interfaces else set()
    children = [
        version.interface_types(interface, (COMPILED,) if sources else ()),
        unit_definitions(types.values()),
        parent("TypeDefinitions", map(version.type_definition, types.values())),
        _log_categories(),
        _default_experiment(interface),
        parent(
            "ModelVariables",
            [
                version.variable(
                    told, types.get(told.unit) if told.type == "real" else None, told.reference in reset
                )
                for told in interface.variables
            ],
        ),
        version.model_structure(interface, lists),
    ]
    text = HEAD + parent(
        "fmiModelDescription", children, _root(interface, fmi) | version.root_attributes(interface)
    )
    return text.encode()


def _root(interface: Interface, fmi: Version) -> dict[str, Attribute]:
    return {
        "fmiVersion": fmi,
        "modelName": interface.name,
        "description": interface.description or None,
        "author": interface.author or None,
        "version": interface.version or None,
        "copyright": interface.copyright or None,
        "license": interface.license or None,
        "generationTool": interface.tool or None,
        "generationDateAndTime": interface.generated or None,
        "variableNamingConvention": "structured",
    }


def _log_categories() -> str:
    named = [{"name": name, "description": text} for name, text in LOG_CATEGORIES.items()]
    return parent("LogCategories", [element("Category", attributes) for attributes in named])


def _default_experiment(interface: Interface) -> str:
    told = interface.experiment
    return element(
        "DefaultExperiment",
        {
            "startTime": float(told.start),
            "stopTime": float(told.stop),
            "tolerance": float(told.tolerance),
            "stepSize": float(told.step),
        },
    )


def build_description(
    interface: Interface, fmi: Version, sources: Sequence[str], language: str = "C99"
) -> bytes:
    """sources/buildDescription.xml of FMI 3.0: what to compile, for importers that build the FMU themselves.

    sources: names of the files in sources/; their folders are told as include directories. The first configuration
    is for every platform; Windows has no separate mathematics library to link.
    """
    folders = sorted({PurePosixPath(name).parent.as_posix() for name in (COMPILED, *sources)})
    files = parent(
        "SourceFileSet",
        [
            element("SourceFile", {"name": COMPILED}),
            *(element("IncludeDirectory", {"name": folder}) for folder in folders),
        ],
        {"name": "fmu", "language": language},
    )
    library = element("Library", {"name": "m", "external": True, "description": "mathematics library of C"})
    identifier = {"modelIdentifier": interface.identifier}
    configurations = [
        parent("BuildConfiguration", [files, library], identifier),
        *(
            parent("BuildConfiguration", [files], identifier | {"platform": platform})
            for platform in WITHOUT_MATH_LIBRARY
        ),
    ]
    return (HEAD + parent("fmiBuildDescription", configurations, {"fmiVersion": fmi})).encode()
