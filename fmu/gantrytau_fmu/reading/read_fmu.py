"""What an FMU is, read from its files alone: nothing of it is loaded or run."""

import importlib
import os
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.description import (
    C_NAME,
    DefaultExperiment,
    FmuInterface,
    FmuTerminal,
    FmuVariable,
    ModelStructure,
    Unknown,
    Value,
)
from gantrytau_fmu.reading.fmu_file import FmuFile
from gantrytau_fmu.reading.libraries import HEAD, platforms_of
from gantrytau_fmu.reading.safety import DESCRIPTION, located, open_archive

BUILD = "sources/buildDescription.xml"
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
_SHOWN = 3  # problems of a model description that a message lists
_DIRECTIONAL = "providesDirectionalDerivatives"  # of FMI 3
_UNNEEDED = "completedIntegratorStepNotNeeded"  # of FMI 2
_KINDS = {
    "modelExchange": "model-exchange",
    "coSimulation": "co-simulation",
    "scheduledExecution": "scheduled-execution",
}


@dataclass(frozen=True)
class FmuTexts:
    """What of an archive describes it: its XML files, checked and of a known version, and the names of all.

    libraries: the first bytes of what stands in the folders of binaries, by name.
    """

    path: Path
    fmi: str  # "2.0" or "3.0"
    description: bytes
    build: bytes | None
    terminals: bytes | None
    names: tuple[str, ...]
    libraries: Mapping[str, bytes]
    size: int
    unpacked: int

    def packed(self) -> BytesIO:
        """The model description as an archive of its own: what FMPy reads has passed our checks."""
        packed = BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr(DESCRIPTION, self.description)
            if self.build is not None:
                archive.writestr(BUILD, self.build)
        packed.seek(0)
        return packed


def read_fmu(path: str | os.PathLike[str]) -> FmuFile:
    """Describe an FMU of FMI 2.0 or 3.0 without loading its binaries.

    Raises ModelError for an archive that is damaged or unsafe (see `safety.open_archive`), for FMI 1.0 and other
    versions, for a model description that breaks its schema or contradicts itself, and for names that no tool can use.
    """
    with located(path):
        return _described(read_files(path))


def _described(files: FmuTexts) -> FmuFile:
    """The description in files that keep to their schema; ModelError for others."""
    if problems := schema_problems(files):
        more = f"\n  ... and {len(problems) - _SHOWN} more" if len(problems) > _SHOWN else ""
        listed = "".join(f"\n  {problem}" for problem in problems[:_SHOWN])
        raise ModelError(
            f"found a {DESCRIPTION} that breaks the schema of FMI {files.fmi}, expected a valid one; "
            f"ask its author for another export{listed}{more}"
        )
    return describe(files, model_of(files))


def read_files(path: str | os.PathLike[str]) -> FmuTexts:
    """The XML files of an FMU, its version known; ModelError for an unsafe archive or another version."""
    with open_archive(path) as archive:
        description = archive.xml(DESCRIPTION)
        build, terminals = (
            archive.xml(name) if name in archive.names else None for name in (BUILD, TERMINALS)
        )
        names, unpacked = archive.names, archive.size
        libraries = {
            name: next(iter(archive.chunks(name)), b"")[:HEAD]
            for name in names
            if name.startswith("binaries/") and name.count("/") == 2 and not name.endswith("/")
        }
    path = Path(path)
    fmi = _version(description)
    return FmuTexts(path, fmi, description, build, terminals, names, libraries, path.stat().st_size, unpacked)


def _version(description: bytes) -> str:
    """2.0 or 3.0; ModelError for all else."""
    root = ElementTree.fromstring(description)
    if root.tag != "fmiModelDescription":
        raise ModelError(
            f"{DESCRIPTION} begins with '{root.tag}', expected fmiModelDescription; check the file"
        )
    version = root.get("fmiVersion", "")
    if version == "2.0" or re.fullmatch(r"3\.0([.-].*)?", version):
        return version[:3]
    remedy = "export it again as FMI 2.0 or 3.0" if version.startswith("1.") else "use one of these versions"
    raise ModelError(f"found FMI version '{version}', expected 2.0 or 3.0; {remedy}")


def schema_problems(files: FmuTexts) -> list[str]:
    """Where the XML files break the official schemas, which FMPy brings along; [] if nowhere."""
    major = files.fmi[0]
    schemas = [(DESCRIPTION, files.description, f"fmi{major}/fmi{major}ModelDescription.xsd")]
    if files.fmi == "3.0":
        schemas.append((BUILD, files.build or b"", "fmi3/fmi3BuildDescription.xsd"))
        schemas.append((TERMINALS, files.terminals or b"", "fmi3/fmi3TerminalsAndIcons.xsd"))
    return [problem for name, text, schema in schemas if text for problem in _breaches(name, text, schema)]


def _breaches(name: str, text: bytes, schema: str) -> Iterator[str]:
    """Where one XML file breaks its schema."""
    import fmpy

    etree: Any = importlib.import_module("lxml.etree")  # has no types
    rules: Any = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / schema))
    try:
        root = etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        yield f"{name}: {error}"
        return
    if not rules.validate(root):
        for entry in rules.error_log:
            yield f"{name}, line {entry.line}: {entry.message}"


def model_of(files: FmuTexts) -> Any:
    """FMPy's `ModelDescription` of an FMU that is valid; ModelError if it contradicts itself."""
    from fmpy.model_description import read_model_description

    with _consistent():
        model = read_model_description(files.packed(), validate=False)  # type: ignore[arg-type]
    refuse_names(model)
    return model


def refuse_names(model: Any) -> None:
    """ModelError for a modelIdentifier that is no name in C, and for variables that cannot be told apart.

    Binaries are looked up, and sources compiled, under the identifier: a path or a command must not be taken for one.
    model: FMPy's ModelDescription. FMI 2.0.4, section 2.2.1; FMI 3.0.2, section 2.4.1.
    """
    for attribute, kind in _KINDS.items():
        interface = getattr(model, attribute)
        if interface is not None and not C_NAME.fullmatch(interface.modelIdentifier or ""):
            raise ModelError(
                f"found the modelIdentifier {interface.modelIdentifier!r} of {kind}, expected a name in C "
                "(letters, digits, '_'); do not run it, and ask its author for another export"
            )
    counts = Counter(variable.name for variable in model.modelVariables)
    twice = [name for name, count in counts.items() if count > 1]
    if twice:
        raise ModelError(
            f"found the variable {twice[0]!r} {counts[twice[0]]} times, expected each name once; "
            "ask its author for another export"
        )


@contextmanager
def _consistent() -> Iterator[None]:
    """Whatever goes wrong when the contents of valid XML are put together, as ModelError."""
    try:
        yield
    except ModelError:
        raise
    except KeyError as error:
        what = f"it names {error}, which it does not define"
    except Exception as error:  # FMPy raises what comes, as AttributeError, TypeError and plain Exception
        what = str(error) or type(error).__name__
    else:
        return
    raise ModelError(
        f"found a {DESCRIPTION} that contradicts itself ({what}), expected a consistent one; "
        "ask its author for another export"
    )


def describe(files: FmuTexts, model: Any) -> FmuFile:
    """FMPy's description as a record; model: its ModelDescription."""
    with _consistent():
        interfaces = tuple(_interfaces(files, model))
        sources = {
            f"sources/{name}"
            for configuration in model.buildConfigurations
            for sources in configuration.sourceFileSets
            for name in sources.sourceFiles
        }
        return FmuFile(
            path=files.path,
            fmi=files.fmi,
            name=model.modelName or "",
            token=model.instantiationToken or "",
            description=model.description or "",
            tool=model.generationTool or "",
            generated=model.generationDateAndTime or "",
            author=model.author or "",
            copyright=model.copyright or "",
            license=model.license or "",
            version=model.version or "",
            interfaces=interfaces,
            variables=tuple(_variable(variable) for variable in model.modelVariables),
            structure=_structure(files, model),
            platforms=_platforms(files.libraries, {interface.identifier for interface in interfaces}),
            sources=tuple(sorted(sources)),
            experiment=_experiment(model.defaultExperiment),
            terminals=tuple(_terminals(files.terminals)),
            size=files.size,
            unpacked=files.unpacked,
        )


def _interfaces(files: FmuTexts, model: Any) -> Iterator[FmuInterface]:
    """The interfaces, with what FMPy overlooks: directional derivatives have a plural in FMI 3, and the name of FMI 2."""
    root = ElementTree.fromstring(files.description)
    for attribute, kind in _KINDS.items():
        interface = getattr(model, attribute)
        if interface is None:
            continue
        capabilities = {
            field.name: getattr(interface, field.name)
            for field in type(interface).__attrs_attrs__
            if field.name != "modelIdentifier"
        }
        element = root.find(attribute[0].upper() + attribute[1:])
        said = (
            {} if element is None else {name: text.strip() in ("true", "1") for name, text in element.items()}
        )
        if files.fmi == "3.0":
            one = said.get(_DIRECTIONAL, False)
            capabilities |= {_DIRECTIONAL: one, _DIRECTIONAL.removesuffix("s"): one}
        elif kind == "model-exchange":
            capabilities[_UNNEEDED] = said.get(_UNNEEDED, False)
        yield FmuInterface(kind, interface.modelIdentifier, capabilities)


def _variable(variable: Any) -> FmuVariable:
    """One of FMPy's ModelVariable as a record, with unit and limits of its declared type where it has none."""
    declared = variable.declaredType

    def said(attribute: str) -> Any:
        own = getattr(variable, attribute)
        return getattr(declared, attribute) if own is None and declared is not None else own

    least, greatest, nominal = (
        None if (text := said(attribute)) is None else float(text) for attribute in ("min", "max", "nominal")
    )
    return FmuVariable(
        name=variable.name,
        reference=variable.valueReference,
        type=variable.type,
        causality=variable.causality,
        variability=variable.variability,
        initial=variable.initial,
        start=_value(variable),
        unit=said("unit") or "",
        display=variable.displayUnit or "",
        description=variable.description or (declared.description if declared else None) or "",
        min=least,
        max=greatest,
        nominal=nominal,
        shape=tuple(variable.shape or ()),
        derivative=None if variable.derivative is None else variable.derivative.name,
    )


def _value(variable: Any) -> Value | None:
    """The start value in its own type; a tuple for arrays."""
    if variable.start is None:
        return None
    read: Any = str
    if variable.type in ("Real", "Float32", "Float64"):
        read = float
    elif variable.type == "Boolean":
        read = ("true", "1").__contains__
    elif variable.type in ("Integer", "Enumeration") or "Int" in variable.type:
        read = int
    if variable.dimensions and read is not str:
        return tuple(read(text) for text in variable.start.split())
    return read(variable.start)


def _structure(files: FmuTexts, model: Any) -> ModelStructure:
    """FMPy's lists by names; event indicators have names in FMI 3 only."""
    outputs, derivatives, initial = (
        tuple(map(_unknown, unknowns))
        for unknowns in (model.outputs, model.derivatives, model.initialUnknowns)
    )
    named = tuple(unknown.variable.name for unknown in model.eventIndicators)
    indicators = named if files.fmi == "3.0" else (None,) * model.numberOfEventIndicators
    return ModelStructure(outputs, derivatives, initial, indicators)


def _unknown(unknown: Any) -> Unknown:
    known, kinds = unknown.dependencies, unknown.dependenciesKind
    names = None if known is None else tuple(variable.name for variable in known)
    return Unknown(unknown.variable.name, names, tuple(kinds) if kinds else None)


def _experiment(found: Any) -> DefaultExperiment:
    if found is None:
        return DefaultExperiment(None, None, None, None)
    said = (found.startTime, found.stopTime, found.tolerance, found.stepSize)
    return DefaultExperiment(*(None if text is None else float(text) for text in said))


def _platforms(libraries: Mapping[str, bytes], identifiers: set[str]) -> tuple[str, ...]:
    """The platforms that have a binary for each identifier, by the names of FMI 3."""
    held: dict[str, set[str]] = {}
    for name, head in libraries.items():
        _, folder, file = name.split("/")
        for platform in platforms_of(folder, head):
            suffix = ".dll" if "windows" in platform else ".dylib" if "darwin" in platform else ".so"
            if file.endswith(suffix):
                held.setdefault(platform, set()).add(file.removesuffix(suffix))
    return tuple(sorted(platform for platform, stems in held.items() if identifiers <= stems))


def _terminals(text: bytes | None) -> Iterator[FmuTerminal]:
    if text is None:
        return
    for terminal in ElementTree.fromstring(text).iterfind("Terminals/Terminal"):
        said: Mapping[str, str] = terminal.attrib
        kind, description = said.get("terminalKind", ""), said.get("description", "")
        yield FmuTerminal(said.get("name", ""), dict(_members(terminal)), kind, description)


def _members(terminal: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Name of a member, with the names of inner terminals before it, and its variable."""
    for member in terminal.iterfind("TerminalMemberVariable"):
        variable = member.get("variableName", "")
        yield member.get("memberName") or variable, variable
    for inner in terminal.iterfind("Terminal"):
        for name, variable in _members(inner):
            yield f"{inner.get('name', '')}.{name}", variable
