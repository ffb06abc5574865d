"""Systems of FMUs in one file: System Structure and Parameterization 1.0, written."""

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.building.archive import check_target, write_archive
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.component import Component, Scalar, numeric, read_component
from gantrytau_fmu.systems.connected_system import (
    KILOGRAM_FIRST,
    ConnectedSystem,
    SignalLink,
    SystemConnection,
    build_system,
    unit_of,
)
from gantrytau_fmu.systems.master import check_times
from gantrytau_fmu.systems.ssp.read_ssp import FMU_TYPE, STEP, STRUCTURE

SPACES = "http://ssp-standard.org/SSP1/SystemStructure"
TYPES = {"real": "Real", "integer": "Integer", "boolean": "Boolean", "text": "String"}


def write_ssp(
    path: str | os.PathLike[str],
    components: Mapping[str, str | os.PathLike[str]],
    connections: Sequence[SystemConnection | tuple[str, str]],
    *,
    stop: float,
    step: float,
    start: Mapping[str, Any] | None = None,
    begin: float = 0.0,
) -> Path:
    """Write a system of FMUs as an .ssp file that other tools run too; its path.

    components, connections, start: as for `cosimulate`; stop, begin: the default experiment, s; step: noted in it as
    an annotation. The file is complete when it appears. Raises ModelError for a system that does not fit, as
    `cosimulate`, for arrays of FMI 3, which SSP 1.0 cannot connect, and where the file cannot be written.
    """
    begin, stop, step = (
        number("write_ssp", name, value, unit="s")
        for name, value in (("begin", begin), ("stop", stop), ("step", step))
    )
    check_times("write_ssp", begin, stop, step)
    path = Path(path)
    check_target(path, ".ssp")
    files = {name: Path(file) for name, file in components.items()}
    with tempfile.TemporaryDirectory(prefix="ssp-", ignore_cleanup_errors=True) as folder:
        parts = {
            name: read_component(name, file, unpack(file, Path(folder) / str(count)))
            for count, (name, file) in enumerate(files.items())
        }
    system = build_system(parts, connections, start or {}, {}, (begin, stop))
    _check(path, system)
    sources = _sources(files)
    members = {STRUCTURE: _structure(path.stem, system, sources, begin, stop, step).encode()}
    members |= {sources[name]: file.read_bytes() for name, file in files.items()}
    return write_archive(path, members, suffix=".ssp", first=STRUCTURE)


def _check(path: Path, system: ConnectedSystem) -> None:
    for name, component in system.components.items():
        if not name.replace("_", "a").isalnum():
            raise ModelError(
                f"{path}: component '{name}': expected a name of letters, digits and _, as other tools need; rename it"
            )
        arrays = [
            scalar.name for scalar in component.scalars.values() if scalar.size > 1 and _shown(scalar, {})
        ]
        if arrays:
            raise ModelError(
                f"{path}: {name}.{arrays[0]} belongs to an array of FMI 3, which SSP 1.0 cannot connect; "
                "export the FMU with scalar variables"
            )


def _sources(files: Mapping[str, Path]) -> dict[str, str]:
    """The member of each component's file; components of one file share it."""
    found: dict[str, str] = {}
    members: dict[str, Path] = {}
    for name, file in files.items():
        member = f"resources/{file.stem}.fmu"
        if members.get(member.lower(), file) != file:  # another file of that name
            member = f"resources/{file.stem}_{name}.fmu"
        members[member.lower()] = file
        found[name] = member
    return found


def _structure(
    name: str, system: ConnectedSystem, sources: Mapping[str, str], begin: float, stop: float, step: float
) -> str:
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<ssd:SystemStructureDescription xmlns:ssd="{SPACES}Description" xmlns:ssc="{SPACES}Common" '
        f'xmlns:ssv="{SPACES}ParameterValues" version="1.0" name={quoteattr(name)} generationTool="gantrytau">',
        f"<ssd:System name={quoteattr(name)}>",
        "<ssd:Elements>",
    ]
    for owner, component in system.components.items():
        lines += _component(component, sources[owner], system.start[owner])
    lines.append("</ssd:Elements>")
    if system.links:
        lines += ["<ssd:Connections>", *map(_connection, system.links), "</ssd:Connections>"]
    lines.append("</ssd:System>")
    lines += _units(system)
    lines += [
        f'<ssd:DefaultExperiment startTime="{begin!r}" stopTime="{stop!r}"><ssd:Annotations>'
        f'<ssc:Annotation type="{STEP}"><step xmlns="" size="{step!r}"/></ssc:Annotation>'
        "</ssd:Annotations></ssd:DefaultExperiment>",
        "</ssd:SystemStructureDescription>",
    ]
    return "\n".join(lines) + "\n"


def _component(component: Component, source: str, start: Mapping[str, float | str]) -> list[str]:
    shown = [scalar for scalar in component.scalars.values() if _shown(scalar, start)]
    lines = [
        f'<ssd:Component name={quoteattr(component.name)} type="{FMU_TYPE}" source={quoteattr(source)} '
        'implementation="CoSimulation">'
    ]
    if shown:
        lines += ["<ssd:Connectors>", *map(_connector, shown), "</ssd:Connectors>"]
    if start:
        values = [_value(component.scalars[name], value) for name, value in start.items()]
        lines += [
            "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>",
            '<ssv:ParameterSet version="1.0" name="start"><ssv:Parameters>',
            *values,
            "</ssv:Parameters></ssv:ParameterSet>",
            "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>",
        ]
    return [*lines, "</ssd:Component>"]


def _shown(scalar: Scalar, start: Mapping[str, float | str]) -> bool:
    """Whether a variable becomes a connector: inputs, outputs, and parameters with a value."""
    parameter = scalar.causality == "parameter" and scalar.name in start
    return (scalar.causality in ("input", "output") and numeric(scalar)) or parameter


def _connector(scalar: Scalar) -> str:
    unit = f" unit={quoteattr(scalar.unit)}" if scalar.kind == "real" and scalar.unit not in ("", "1") else ""
    return (
        f'<ssd:Connector name={quoteattr(scalar.name)} kind="{scalar.causality}">'
        f"<ssc:{TYPES[scalar.kind]}{unit}/></ssd:Connector>"
    )


def _value(scalar: Scalar, value: float | str) -> str:
    text = {"integer": lambda: str(round(float(value))), "boolean": lambda: "true" if value else "false"}
    words = text.get(scalar.kind, lambda: str(value) if isinstance(value, str) else repr(float(value)))()
    inner = f"<ssv:{TYPES[scalar.kind]} value={quoteattr(words)}/>"
    return f"<ssv:Parameter name={quoteattr(scalar.name)}>{inner}</ssv:Parameter>"


def _connection(link: SignalLink) -> str:
    ends = zip(
        ("startElement", "startConnector", "endElement", "endConnector"),
        (*link.source, *link.target),
        strict=True,
    )
    head = "<ssd:Connection " + " ".join(f"{key}={quoteattr(name)}" for key, name in ends)
    if (link.factor, link.offset) == (1.0, 0.0):
        return head + "/>"
    return (
        f'{head} suppressUnitConversion="true">'
        f'<ssc:LinearTransformation factor="{link.factor!r}" offset="{link.offset!r}"/></ssd:Connection>'
    )


def _units(system: ConnectedSystem) -> list[str]:
    """Definitions of the units of all connectors."""
    found: dict[str, str] = {}
    for component in system.components.values():
        for scalar in component.scalars.values():
            if not _shown(scalar, system.start[component.name]) or scalar.unit in ("", "1", *found):
                continue
            unit = unit_of(component, scalar.unit)
            powers = (
                {base: power for base, power in zip(KILOGRAM_FIRST, unit[0], strict=True) if power}
                if unit
                else {}
            )
            text = "".join(f' {base}="{power}"' for base, power in powers.items())
            text += f' factor="{unit[1]!r}" offset="{unit[2]!r}"' if unit and unit[1:] != (1.0, 0.0) else ""
            found[scalar.unit] = f"<ssc:Unit name={quoteattr(scalar.unit)}><ssc:BaseUnit{text}/></ssc:Unit>"
    return ["<ssd:Units>", *found.values(), "</ssd:Units>"] if found else []
