"""A system of FMUs (.ssp) as its file describes it, and what is wrong with it, without loading a binary."""

import os
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau_fmu.reading.fmu_file import SHOWN
from gantrytau_fmu.reading.fmu_findings import FmuFinding, errors_first
from gantrytau_fmu.reading.read_fmu import read_fmu
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.checking.check_fmu import TIMEOUT, check_fmu
from gantrytau_fmu.systems.component import Component, read_component
from gantrytau_fmu.systems.connected_system import ConnectedSystem, build_system, unconnected
from gantrytau_fmu.systems.ssp.read_ssp import SystemStructure, matching, read_ssp, structure_of


@dataclass(frozen=True)
class SystemPart:
    """A component of a system: its name there, the file in the archive, and what that is; inputs, outputs: how many."""

    name: str
    file: str
    fmi: str
    model: str
    platforms: tuple[str, ...]
    inputs: int
    outputs: int


@dataclass(frozen=True)
class SystemDescription(Record):
    """A system as `read_system` finds it; prints itself.

    wires: (output, input), factor and offset on the way left out; unconnected: inputs that nothing drives and no
    value is given for -> the start value that they keep; start: the values that the file gives; begin, stop, step:
    its experiment, s, None for what is not said.
    """

    path: Path
    components: tuple[SystemPart, ...]
    wires: tuple[tuple[str, str], ...]
    unconnected: dict[str, str]
    start: dict[str, float | str]
    begin: float | None
    stop: float | None
    step: float | None

    def as_dict(self) -> dict[str, Any]:
        """All of it as numbers, texts, lists and dictionaries, for JSON."""
        return asdict(self) | {"path": str(self.path)}

    def table(self, shown: int | None = SHOWN) -> str:
        """Its components, experiment and the first `shown` of its connections, values and free inputs; None: all."""
        said = (("start", self.begin), ("stop", self.stop), ("step", self.step))
        times = ", ".join(f"{word} {value:g} s" for word, value in said if value is not None)
        lines = [f"{self.path.name}: a system of {len(self.components)} FMUs, run by `gantrytau fmu run`"]
        lines += [f"default experiment: {times}"] if times else []
        lines += ["", "components", *(_part(part) for part in self.components)]
        groups = (
            ("connections", [f"{source} -> {target}" for source, target in self.wires]),
            ("start values", [f"{name} = {_short(value)}" for name, value in self.start.items()]),
            ("inputs that nothing drives", [f"{name} = {value}" for name, value in self.unconnected.items()]),
        )
        for title, found in groups:
            if found:
                lines += ["", title, *(f"  {line}" for line in found[:shown])]
            if shown is not None and len(found) > shown:
                lines.append(f"  ... and {len(found) - shown} more")
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.table()


def read_system(path: str | os.PathLike[str]) -> SystemDescription:
    """Describe a system without loading its binaries; ModelError as `cosimulate`, and as `read_fmu` for its FMUs."""
    with tempfile.TemporaryDirectory(prefix="ssp-", ignore_cleanup_errors=True) as folder:
        structure = read_ssp(path, Path(folder) / "system")
        parts = tuple(
            _described(name, file, Path(folder) / "system") for name, file in structure.components.items()
        )
        system = _system(structure, Path(folder))
    return SystemDescription(
        path=Path(path),
        components=parts,
        wires=tuple((".".join(link.source), ".".join(link.target)) for link in system.links),
        unconnected=unconnected(system),
        start={
            f"{owner}.{name}": value
            for owner, chosen in system.start.items()
            for name, value in chosen.items()
        },
        begin=structure.begin,
        stop=structure.stop,
        step=structure.step,
    )


def check_system(
    path: str | os.PathLike[str], *, run: bool = False, timeout: float = TIMEOUT
) -> list[FmuFinding]:
    """All that is wrong with a system, errors first: with each of its FMUs, and with how they are connected.

    run: also try each FMU, as `check_fmu` does. `FmuFinding.path` names the file in the archive.
    """
    timeout = number("check_system", "timeout", timeout, above=0.0, unit="s")
    with tempfile.TemporaryDirectory(prefix="ssp-", ignore_cleanup_errors=True) as folder:
        return errors_first(_found(Path(path), Path(folder), run, timeout))


def _found(path: Path, folder: Path, run: bool, timeout: float) -> Iterator[FmuFinding]:
    try:
        structure = structure_of(path, folder / "system")
    except ModelError as error:
        yield FmuFinding("error", str(error), str(path))
        return
    whole = True
    for file in dict.fromkeys(structure.components.values()):
        inside = f"{path}: {file.relative_to(folder / 'system').as_posix()}"
        for finding in check_fmu(file, run=run, timeout=timeout):
            whole = whole and finding.severity != "error"
            yield replace(finding, path=inside)
    if not whole:  # what is wrong with them would be told again, in other words
        return
    try:
        system = _system(structure, folder)
    except ModelError as error:
        yield FmuFinding("error", str(error), str(path))
        return
    for name, value in unconnected(system).items():
        yield FmuFinding("note", f"nothing drives {name}, which keeps its value {value}", str(path))


def _described(name: str, file: Path, root: Path) -> SystemPart:
    fmu = read_fmu(file)
    return SystemPart(
        name,
        file.relative_to(root).as_posix(),
        fmu.fmi,
        fmu.name,
        fmu.platforms,
        len(fmu.inputs),
        len(fmu.outputs),
    )


def _system(structure: SystemStructure, folder: Path) -> ConnectedSystem:
    """The components joined; binaries are not looked for."""
    parts: dict[str, Component] = {}
    for count, (name, file) in enumerate(structure.components.items()):
        place = unpack(file, folder / f"fmu{count}")
        parts[name] = read_component(name, file.name, place, loadable=False)
    span = (structure.begin or 0.0, structure.stop or (structure.begin or 0.0) + 1.0)
    return build_system(parts, structure.connections, matching(parts, structure.start), {}, span)


def _part(part: SystemPart) -> str:
    return (
        f"  {part.name}: {part.file}, {part.model}, FMI {part.fmi}, {part.inputs} inputs, {part.outputs} outputs, "
        f"binaries for {', '.join(part.platforms) or 'no platform'}"
    )


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
