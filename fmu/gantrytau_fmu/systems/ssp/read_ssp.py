"""Systems of FMUs in one file: System Structure and Parameterization 1.0, read.

SystemStructure.ssd names components (files beside it), their connectors and connections, and binds parameters.
Nested systems are flattened: 'inner.robot' is the component robot of the system inner. What the start and the end of
a connection are says nothing of its direction, the kinds of the connectors do. What is not supported is refused.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from urllib.parse import unquote
from xml.etree import ElementTree

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.reading.safe_xml import check_xml
from gantrytau_fmu.reading.safety import extract, located
from gantrytau_fmu.systems.component import Component
from gantrytau_fmu.systems.connected_system import SystemConnection, locate

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
STRUCTURE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"
STEP = "org.gantrytau.step"  # annotation of the default experiment: the step in s

Node = tuple[str, str]  # element, "" for the outermost system, and connector


@dataclass(frozen=True)
class SystemStructure:
    """A system as its file describes it: FMU files by component, connections, start values, default times in s.

    Of `cosimulate` components may be models and functions, too.
    """

    components: Mapping[str, Any]
    connections: tuple[SystemConnection | tuple[str, str], ...] = ()
    start: Mapping[str, float | str] = field(default_factory=dict)
    begin: float | None = None
    stop: float | None = None
    step: float | None = None


@dataclass(frozen=True)
class _Wire:
    """What drives a connector: another one, and how its value is transformed on the way."""

    source: Node
    factor: float
    offset: float
    convert: bool


def read_ssp(path: str | os.PathLike[str], folder: Path) -> SystemStructure:
    """Unpack a system into `folder` and read its structure.

    Raises ModelError for an unsafe or damaged archive, XML that is no SSP 1.0, and what is not supported: signal
    dictionaries, mappings of parameters and of enumerations, components that are no FMUs for Co-Simulation.
    """
    if Path(path).suffix.lower() == ".fmu":
        raise ModelError(f"{path} is one FMU, expected a system (.ssp) or {{name: FMU file}}")
    with located(path):
        return structure_of(path, folder)


def structure_of(path: str | os.PathLike[str], folder: Path) -> SystemStructure:
    """As `read_ssp`, but its errors leave it to `located` to name the file."""
    extract(path, folder, needs=STRUCTURE)
    text = (folder / STRUCTURE).read_bytes()
    check_xml(text, STRUCTURE)
    root = ElementTree.fromstring(text)
    system = root.find(f"{SSD}System")
    if root.tag != f"{SSD}SystemStructureDescription" or system is None:
        raise ModelError(f"found <{root.tag}>, expected a SystemStructureDescription of SSP 1 with a System")
    reader = _Reader(folder)
    reader.system(system, "")
    experiment = root.find(f"{SSD}DefaultExperiment")
    attributes = experiment.attrib if experiment is not None else {}
    begin, stop = (
        reader.number("DefaultExperiment", attributes.get(name)) for name in ("startTime", "stopTime")
    )
    return SystemStructure(
        reader.components, reader.connections(), reader.start, begin, stop, reader.step(experiment)
    )


def matching(components: Mapping[str, Component], start: Mapping[str, Any]) -> dict[str, Any]:
    """The values of an SSP that belong to a variable; the standard has the others ignored."""
    found = {}
    for name, value in start.items():
        with suppress(ModelError):
            locate(components, name)
            found[name] = value
    return found


class _Reader:
    """What has been read of a structure."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.components: dict[str, Path] = {}
        self.kinds: dict[Node, str] = {}
        self.systems: set[str] = set()
        self.wires: dict[Node, _Wire] = {}
        self.start: dict[str, float | str] = {}

    def system(self, element: Any, path: str) -> None:
        """A system and all in it; bindings of outer systems come last, as they have precedence."""
        self.systems.add(path)
        self._connectors(element, path)
        for child in element.findall(f"{SSD}Elements/*"):
            inner = _joined(path, child.get("name", ""))
            if inner in self.components or inner in self.systems:
                self.refuse(f"the name '{inner}' stands for two elements")
            if child.tag == f"{SSD}System":
                self.system(child, inner)
            elif child.tag == f"{SSD}Component":
                self._component(child, inner)
            else:
                self.refuse(f"element '{inner}' is a {_tag(child)}")
        if element.find(f"{SSD}SignalDictionaries") is not None:
            self.refuse(f"system '{path}' has SignalDictionaries")
        for connection in element.findall(f"{SSD}Connections/{SSD}Connection"):
            self._connection(connection, path)
        self._bindings(element, path)

    def connections(self) -> tuple[SystemConnection, ...]:
        """From outputs of components to inputs of components, through the connectors of systems."""
        found = []
        for target in self.wires:
            if target[0] in self.systems:
                continue
            wire = self.wires[target]
            source, factor, offset, convert = wire.source, wire.factor, wire.offset, wire.convert
            seen = {target}
            while source[0] in self.systems and source in self.wires and source not in seen:
                seen.add(source)
                wire = self.wires[source]
                factor, offset = factor * wire.factor, factor * wire.offset + offset
                source, convert = wire.source, convert and wire.convert
            if source[0] not in self.systems:
                found.append(SystemConnection(".".join(source), ".".join(target), factor, offset, convert))
        return tuple(found)

    def step(self, experiment: Any) -> float | None:
        """The step that this toolkit notes as an annotation."""
        if experiment is None:
            return None
        for annotation in experiment.iter(f"{SSC}Annotation"):
            if annotation.get("type") == STEP:
                return self.number(STEP, next((child.get("size") for child in annotation), None))
        return None

    def number(self, where: str, text: str | None) -> float | None:
        if text is None:
            return None
        try:
            return float(text)
        except ValueError:
            raise ModelError(f"{where}: found '{text}', expected a number") from None

    def refuse(self, words: str) -> NoReturn:
        raise ModelError(
            f"{words}, which is not supported; expected FMUs, systems, connections and values of "
            "parameters, give the rest as arguments of cosimulate"
        )

    def _component(self, element: Any, path: str) -> None:
        kind, source = element.get("type", FMU_TYPE), unquote(element.get("source", ""))
        if kind != FMU_TYPE:
            self.refuse(f"component '{path}' is of type {kind}")
        if element.get("implementation") == "ModelExchange":
            self.refuse(f"component '{path}' asks for Model Exchange")
        parts = PurePosixPath(source)
        if not source or ":" in source or "#" in source or parts.is_absolute() or ".." in parts.parts:
            self.refuse(f"component '{path}' has the source '{source}', which is no file of this archive")
        file = self.folder / parts
        if not file.is_file():
            raise ModelError(f"component '{path}' names {source}, expected a file of this archive")
        self.components[path] = file
        self._connectors(element, path)
        self._bindings(element, path)

    def _connectors(self, element: Any, path: str) -> None:
        for connector in element.findall(f"{SSD}Connectors/{SSD}Connector"):
            self.kinds[path, connector.get("name", "")] = connector.get("kind", "")

    def _connection(self, element: Any, path: str) -> None:
        start, end = (
            (_joined(path, element.get(f"{side}Element", "")), element.get(f"{side}Connector", ""))
            for side in ("start", "end")
        )
        words = f"connection {'.'.join(start)} -> {'.'.join(end)}"
        factor, offset = 1.0, 0.0
        for child in element:
            if child.tag == f"{SSC}LinearTransformation":
                factor = self.number(words, child.get("factor", "1")) or 0.0
                offset = self.number(words, child.get("offset", "0")) or 0.0
            elif _tag(child) not in ("ConnectionGeometry", "Annotations"):
                self.refuse(f"{words} has a {_tag(child)}")
        if self._gives(end, path) and not self._gives(start, path):
            start, end = end, start
        if end in self.wires:
            raise ModelError(
                f"{'.'.join(end)} is driven by {'.'.join(self.wires[end].source)} and by "
                f"{'.'.join(start)}, expected one of them"
            )
        convert = element.get("suppressUnitConversion", "false") not in ("true", "1")
        self.wires[end] = _Wire(start, factor, offset, convert)

    def _gives(self, node: Node, path: str) -> bool:
        """Whether values come out of a connector into the system at `path`: its own inputs, outputs of its elements."""
        kind = self.kinds.get(node, "")
        return kind in (("input", "parameter") if node[0] == path else ("output", "calculatedParameter"))

    def _bindings(self, element: Any, path: str) -> None:
        for binding in element.findall(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
            where = f"parameter binding of '{path}'"
            if binding.find(f"{SSD}ParameterMapping") is not None:
                self.refuse(f"{where} has a ParameterMapping")
            found = binding.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
            source = binding.get("source")
            if found is None and source:
                found = self._parameter_file(where, source)
            if found is None:
                continue
            for parameter in found.findall(f"{SSV}Parameters/{SSV}Parameter"):
                name = binding.get("prefix", "") + parameter.get("name", "")
                self._parameter(where, _joined(path, name), parameter)

    def _parameter_file(self, where: str, source: str) -> Any:
        parts = PurePosixPath(unquote(source))
        if ":" in source or parts.is_absolute() or ".." in parts.parts or not (self.folder / parts).is_file():
            self.refuse(f"{where} has the source '{source}', which is no file of this archive")
        text = (self.folder / parts).read_bytes()
        check_xml(text, source)
        return ElementTree.fromstring(text)

    def _parameter(self, where: str, name: str, parameter: Any) -> None:
        for child in parameter:
            kind, text = _tag(child), child.get("value", "")
            if kind in ("Real", "Integer"):
                self.start[name] = self.number(f"{where}: {name}", text) or 0.0
            elif kind == "Boolean":
                self.start[name] = 1.0 if text in ("true", "1") else 0.0
            elif kind == "String":
                self.start[name] = text
            elif kind != "Annotations":
                self.refuse(f"{where}: {name} is of type {kind}")


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path and name else path or name


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]
