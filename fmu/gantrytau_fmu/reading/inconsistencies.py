"""Checks of a model description against itself and against the archive, beyond the schemas and FMPy's validation.

FMI 2.0.4, sections 2.2 and 2.3; FMI 3.0.2, sections 2.4 and 2.5.
"""

import math
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

from gantrytau_fmu.building.platforms import ALIASES, native
from gantrytau_fmu.description import FmuVariable
from gantrytau_fmu.reading.fmu_file import FmuFile
from gantrytau_fmu.reading.fmu_findings import FmuFinding, fault
from gantrytau_fmu.reading.libraries import misplaced
from gantrytau_fmu.reading.read_fmu import FmuTexts


def inconsistencies(fmu: FmuFile, files: FmuTexts, model: Any) -> Iterator[FmuFinding]:
    """What an FMU says and does not keep. model: FMPy's ModelDescription."""
    yield from _header(fmu)
    for variable in fmu.variables:
        yield from _values(variable)
    yield from _units(fmu, model)
    yield from _structure(fmu, files, model)
    yield from _indicators(fmu, model)
    yield from _members(fmu)
    yield from _binaries(fmu, files)


def _header(fmu: FmuFile) -> Iterator[FmuFinding]:
    """Names and numbers of the FMU as a whole."""
    if not fmu.token:
        yield fault("the GUID or instantiation token is empty, expected one to tell versions apart")
    for interface in fmu.interfaces:
        if interface.capabilities.get("needsExecutionTool"):
            yield FmuFinding(
                "note", f"{interface.kind} needs the tool {fmu.tool or 'that made it'} on this machine"
            )
    if not fmu.interfaces:
        yield fault("it has no interface, expected Model Exchange or Co-Simulation")
    experiment = fmu.experiment
    if None not in (experiment.start, experiment.stop) and experiment.stop <= experiment.start:  # type: ignore[operator]
        yield FmuFinding(
            "warning",
            f"default experiment: stop {experiment.stop:g} s is not after start {experiment.start:g} s",
        )
    for word, value in (("tolerance", experiment.tolerance), ("step", experiment.step)):
        if value is not None and not 0 < value < math.inf:
            yield fault(f"default experiment: {word} {value:g}, expected a positive number")


def _values(variable: FmuVariable) -> Iterator[FmuFinding]:
    """Start value, limits and nominal value of a variable."""
    name, least, greatest = variable.name, variable.min, variable.max
    if least is not None and greatest is not None and not least <= greatest:
        yield fault(f"{name}: min {least:g} is above max {greatest:g}")
    if variable.nominal is not None and not 0 < variable.nominal < math.inf:
        yield fault(f"{name}: nominal {variable.nominal:g}, expected a positive number")
    starts = variable.start if isinstance(variable.start, tuple) else (variable.start,)
    count = math.prod(variable.shape)
    if (
        variable.shape
        and variable.start is not None
        and isinstance(variable.start, tuple)
        and len(starts) not in (1, count)
    ):
        yield fault(f"{name}: found {len(starts)} start values, expected {count} or one for all")
    numbers = [value for value in starts if isinstance(value, (int, float)) and not isinstance(value, bool)]
    for value in numbers:
        if not math.isfinite(value):
            yield fault(f"{name}: start {value:g}, expected a finite number")
        elif (least is not None and value < least) or (greatest is not None and value > greatest):
            low, high = ("" if limit is None else f"{limit:.9g}" for limit in (least, greatest))
            yield fault(f"{name}: start {value:.9g} is outside of its limits [{low}, {high}]")
        else:
            continue
        break  # one of an array is enough


def _units(fmu: FmuFile, model: Any) -> Iterator[FmuFinding]:
    """Units that are used and not defined; rates whose unit is not that of their state per second."""
    powers = {unit.name: _powers(unit.baseUnit) for unit in model.unitDefinitions}
    missing: dict[str, str] = {}
    for variable in fmu.variables:
        if variable.unit and variable.unit not in powers:
            missing.setdefault(variable.unit, variable.name)
        if variable.derivative is not None:
            state = fmu.variable(variable.derivative)
            rate, of_state = powers.get(variable.unit), powers.get(state.unit)
            if rate and of_state and rate != of_state | {"s": of_state["s"] - 1}:
                yield FmuFinding(
                    "warning",
                    f"{variable.name} in {variable.unit} is the rate of {state.name}, "
                    f"expected {state.unit} per s",
                )
    for variable in model.modelVariables:
        own = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
        if variable.displayUnit is not None and own is None:
            yield fault(f"{variable.name}: it has the display unit '{variable.displayUnit}' and no unit")
    for unit, name in missing.items():
        yield fault(f"{name}: its unit '{unit}' is not among the UnitDefinitions")


def _powers(base: Any) -> dict[str, int]:
    """Exponents of the base units; radians count as 1, as they come and go in products. {} if not said."""
    names = ("kg", "m", "s", "A", "K", "mol", "cd")
    return {name: getattr(base, name) for name in names} if base is not None else {}


def _structure(fmu: FmuFile, files: FmuTexts, model: Any) -> Iterator[FmuFinding]:
    """Whether the model structure lists each output and each rate of a state, and nothing else."""
    own = {variable.name for variable in model.modelVariables if variable.alias is None}
    declared = {variable.name for variable in fmu.variables if variable.causality == "output"} & own
    for name in sorted(declared - set(fmu.outputs)):
        yield fault(f"{name}: this output is not listed in the ModelStructure")
    for name in sorted(set(fmu.outputs) - declared):
        yield fault(f"{name}: the ModelStructure lists it as output, but its causality is another")
    for name in sorted({name for name in fmu.outputs if fmu.outputs.count(name) > 1}):
        yield fault(f"{name}: the ModelStructure lists this output more than once")
    yield from _initial_unknowns(model)
    if fmu.fmi == "2.0":
        yield from _indices(files, len(model.modelVariables))


def _initial_unknowns(model: Any) -> Iterator[FmuFinding]:
    """Whether the model structure lists what is to be found at the start; aliases are not listed apart."""
    rates = [unknown.variable for unknown in model.derivatives]
    states = [rate.derivative for rate in rates if rate.derivative is not None]
    found = [variable for variable in model.modelVariables if variable.causality == "output"]
    unknown = {
        id(variable) for variable in (*rates, *states, *found) if variable.initial in ("approx", "calculated")
    }
    listed = {id(entry.variable) for entry in model.initialUnknowns}
    for variable in model.modelVariables:
        if variable.alias is not None or variable.clocks:
            continue
        needed = id(variable) in unknown or variable.causality == "calculatedParameter"
        if needed and id(variable) not in listed:
            yield fault(f"{variable.name}: the ModelStructure does not list it as initial unknown")
        if not needed and id(variable) in listed:
            yield fault(f"{variable.name}: the ModelStructure lists it as initial unknown, but it is none")


def _indices(files: FmuTexts, count: int) -> Iterator[FmuFinding]:
    """FMI 2 counts variables from 1; Python would take 0 for the last one."""
    for unknown in ElementTree.fromstring(files.description).iterfind("ModelStructure/*/Unknown"):
        said = [unknown.get("index", ""), *unknown.get("dependencies", "").split()]
        if wrong := [text for text in said if not 1 <= int(text) <= count]:
            yield fault(f"ModelStructure: found the index {wrong[0]}, expected 1 to {count}")


def _indicators(fmu: FmuFile, model: Any) -> Iterator[FmuFinding]:
    """FMI 3 wants event indicators to be continuous variables that can be read."""
    for unknown in model.eventIndicators:
        variable = fmu.variable(unknown.variable.name)
        if variable.type not in ("Float32", "Float64") or variable.variability != "continuous":
            yield fault(
                f"{variable.name}: this event indicator is {variable.variability} {variable.type}, "
                "expected a continuous number"
            )
        if variable.causality not in ("local", "output"):
            yield fault(f"{variable.name}: this event indicator is {variable.causality}, expected local")


def _members(fmu: FmuFile) -> Iterator[FmuFinding]:
    """Terminals that speak of variables that do not exist."""
    names = {variable.name for variable in fmu.variables}
    for terminal in fmu.terminals:
        for member, name in terminal.members.items():
            if name not in names:
                yield fault(f"terminal {terminal.name}.{member}: there is no variable '{name}' in this FMU")


def _binaries(fmu: FmuFile, files: FmuTexts) -> Iterator[FmuFinding]:
    """What can be run where, and sources that are named and missing."""
    for name in fmu.sources:
        if name not in files.names:
            yield fault(f"{name}: this source file is named but not in the archive")
    here = native().name
    if not fmu.platforms and not fmu.sources:
        yield fault("it has neither binaries for all its interfaces nor sources")
    elif here not in fmu.platforms:
        remedy = "it can be compiled from its sources" if fmu.sources else "ask for an export for it"
        yield FmuFinding("warning", f"it has no binary for this machine ({here}); {remedy}")
    identifiers = {interface.identifier for interface in fmu.interfaces}
    for name, head in files.libraries.items():
        _, folder, file = name.split("/")
        if fmu.fmi == "3.0" and folder in ALIASES:
            yield fault(f"{name}: FMI 3 calls this folder {ALIASES[folder]}")
        if file.rpartition(".")[0] in identifiers and (problem := misplaced(folder, head)):
            yield fault(f"{name}: {problem}")
