"""An FMU as a part of a system: its scalars by name, how outputs follow inputs, what it can do."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Literal

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.results.series import split_element
from gantrytau_fmu.reading.read_fmu import refuse_names
from gantrytau_fmu.reading.safety import located

KINDS = {"Real": "real", "Float64": "real", "Float32": "real", "Boolean": "boolean", "String": "text"}
SETTABLE = ("parameter", "structuralParameter", "input", "output", "local")
INTEGERS = re.compile(r"U?Int\d+|Integer|Enumeration")


@dataclass(frozen=True)
class Scalar:
    """A scalar variable, or one element of an array of FMI 3.

    kind: "real", "integer", "boolean", "text", or the type's name if it can only be left alone; type: as FMI names
    it; place: in the array of that reference, which has `size` elements; start: as in the file, None without;
    min, max: limits, None without.
    """

    name: str
    kind: str
    type: str
    reference: int
    causality: str
    variability: str
    initial: str | None = None
    place: int = 0
    size: int = 1
    unit: str = ""
    description: str = ""
    start: str | None = None
    min: float | None = None
    max: float | None = None

    @property
    def has_start(self) -> bool:
        """Whether its value can be chosen before initialisation."""
        calculated = self.initial == "calculated" or (
            self.causality in ("output", "local") and not self.start
        )
        return self.variability != "constant" and self.causality in SETTABLE and not calculated


@dataclass(frozen=True)
class Component:
    """An unpacked FMU with Co-Simulation, under its name in a system; "" for one that is alone.

    file: what the user named; folder: where it is unpacked; version: 2 or 3; library: the binary for this platform;
    feedthrough: output -> the inputs it depends on within one instant; units: name -> exponents of kg, m, s, A, K,
    mol, cd and the factor and offset to the SI; step: of the default experiment, like stop, or None.
    """

    name: str
    file: str
    folder: str
    version: int
    token: str
    identifier: str
    library: str
    scalars: Mapping[str, Scalar]
    feedthrough: Mapping[str, frozenset[str]] = field(default_factory=dict)
    units: Mapping[str, tuple[tuple[int, ...], float, float]] = field(default_factory=dict)
    can_save: bool = False
    variable_step: bool = False
    only_once: bool = False
    categories: tuple[str, ...] = ()
    stop: float | None = None
    step: float | None = None

    @property
    def title(self) -> str:
        """The name of the component in messages: that in the system, or its file if it runs alone."""
        return self.name or Path(self.file).name

    def expand(self, name: str, causality: str = "") -> tuple[str, ...]:
        """The scalars that a name stands for: itself, or the elements of a vector in their order; ModelError if none.

        causality: what the message proposes, if only such variables are of use.
        """
        if name in self.scalars:
            return (name,)
        found = []
        for scalar in self.scalars:
            element = split_element(scalar)
            if element and element[0] == name:
                found.append((element[1], scalar))
        if not found:
            raise ModelError(f"{self.title} has no variable '{name}'{self._proposed(name, causality)}")
        return tuple(scalar for _, scalar in sorted(found))

    def of(self, *causalities: str) -> tuple[str, ...]:
        """The names of the scalars with one of these causalities that are numbers, in the order of the file."""
        return tuple(
            name
            for name, scalar in self.scalars.items()
            if scalar.causality in causalities and numeric(scalar)
        )

    def sampled(self, name: str) -> bool:
        """Whether a variable is real, changes only at events, and is found by the component itself."""
        scalar = self.scalars[name]
        return (scalar.variability, scalar.kind) == ("discrete", "real") and scalar.causality in (
            "output",
            "local",
        )

    def _proposed(self, name: str, causality: str) -> str:
        """The end of a message on an unknown name: what it may have meant, or the names that there are."""
        scalars = [scalar for scalar, known in self.scalars.items() if causality in ("", known.causality)]
        if not scalars:
            return f"; it has no {causality or 'variable'}"
        vectors = [element[0] for scalar in scalars if (element := split_element(scalar))]
        proposed = did_you_mean(name, dict.fromkeys([*scalars, *vectors]))
        return proposed.replace("; there is", f"; its {causality}s are") if causality else proposed


def dotted(owner: str, name: str) -> str:
    """A variable by its name in a system: 'component.variable', of a component without a name its own."""
    return f"{owner}.{name}" if owner else name


def numeric(scalar: Scalar) -> bool:
    """Whether a variable has a number as its value."""
    return scalar.kind in ("real", "integer", "boolean")


def read_component(
    name: str,
    file: str | Path,
    folder: Path,
    kind: Literal["co-simulation", "model-exchange"] = "co-simulation",
    loadable: bool = True,
) -> Component:
    """The FMU unpacked in `folder` as a component; ModelError for one that does not have the wanted interface.

    name: in the system; file: as the user named it, for messages; loadable: whether it needs a binary for this platform.
    """
    description = _description(file, folder)
    interface = description.coSimulation if kind == "co-simulation" else description.modelExchange
    if interface is None:
        other = "without --me" if kind == "model-exchange" else "with --me, which integrates Model Exchange"
        raise ModelError(
            f"{_titled(name, file)} has no interface for {kind}, expected one; export it with that, "
            f"or run it alone with `gantrytau fmu run` {other}"
        )
    version = description.fmiMajorVersion
    scalars = {
        scalar.name: scalar for variable in description.modelVariables for scalar in _scalars(variable)
    }
    experiment = description.defaultExperiment
    return Component(
        name=name,
        file=str(file),
        folder=str(folder),
        version=version,
        token=description.guid,
        identifier=interface.modelIdentifier,
        library=_library(name, file, folder, version, interface.modelIdentifier) if loadable else "",
        scalars=scalars,
        feedthrough=_feedthrough(description, scalars),
        units={unit.name: _base(unit.baseUnit) for unit in description.unitDefinitions if unit.baseUnit},
        can_save=bool(interface.canGetAndSetFMUstate),
        variable_step=bool(getattr(interface, "canHandleVariableCommunicationStepSize", True)),
        only_once=bool(interface.canBeInstantiatedOnlyOncePerProcess),
        categories=tuple(category.name for category in description.logCategories),
        stop=_number(experiment and experiment.stopTime),
        step=_number(experiment and experiment.stepSize),
    )


def _description(file: str | Path, folder: Path) -> Any:
    """FMPy's model description, its complaints as ModelError."""
    from fmpy import read_model_description

    try:
        description = read_model_description(str(folder))
    except Exception as error:  # FMPy raises bare exceptions
        lines = [line for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
        raise ModelError(
            f"{file}: the model description cannot be used: {' '.join(lines[:3])}; "
            "`gantrytau fmu check` lists what is wrong"
        ) from error
    if description.fmiMajorVersion not in (2, 3):
        raise ModelError(
            f"{file}: found FMI {description.fmiVersion}, expected 2.0 or 3.0; export it again from its tool"
        )
    with located(file):
        refuse_names(description)
    return description


def _scalars(variable: Any) -> list[Scalar]:
    """The scalars of a variable: itself, or the elements of an array, row by row, counted from 0."""
    kind = "integer" if INTEGERS.fullmatch(variable.type) else KINDS.get(variable.type, str(variable.type))
    shape = tuple(int(size) for size in variable.shape or ()) if variable.dimensions else ()
    places = list(product(*(range(size) for size in shape)))
    starts = (variable.start or "").split() if shape else [variable.start]
    declared = variable.declaredType
    unit = variable.unit or (declared.unit if declared else None) or ""
    least, greatest = (
        _number(own if own is not None or declared is None else getattr(declared, side, None))
        for side, own in (("min", variable.min), ("max", variable.max))
    )
    return [
        Scalar(
            name=variable.name + (f"[{','.join(map(str, index))}]" if shape else ""),
            kind=kind,
            type=variable.type,
            reference=variable.valueReference,
            causality=variable.causality or "local",
            variability=variable.variability or "continuous",
            initial=variable.initial,
            place=place,
            size=len(places),
            unit=unit,
            description=variable.description or "",
            start=starts[place] if place < len(starts) else (starts[0] if starts else None),
            min=least,
            max=greatest,
        )
        for place, index in enumerate(places)
    ]


def _feedthrough(description: Any, scalars: Mapping[str, Scalar]) -> dict[str, frozenset[str]]:
    """Output -> inputs it depends on directly; all of them where the file says nothing of dependencies."""
    by_reference: dict[int, list[str]] = {}
    for name, scalar in scalars.items():
        by_reference.setdefault(scalar.reference, []).append(name)
    inputs = frozenset(name for name, scalar in scalars.items() if scalar.causality == "input")
    found: dict[str, frozenset[str]] = {
        name: inputs for name, scalar in scalars.items() if scalar.causality == "output"
    }
    for unknown in description.outputs:
        if unknown.dependencies is None or unknown.variable is None:
            continue
        references = {variable.valueReference for variable in unknown.dependencies}
        direct = frozenset(name for name in inputs if scalars[name].reference in references)
        found.update((name, direct) for name in by_reference.get(unknown.variable.valueReference, ()))
    return found


def _base(base: Any) -> tuple[tuple[int, ...], float, float]:
    powers = tuple(int(getattr(base, letter) or 0) for letter in ("kg", "m", "s", "A", "K", "mol", "cd"))
    return powers, float(base.factor), float(base.offset)  # the radian is of dimension one


def _library(name: str, file: str | Path, folder: Path, version: int, identifier: str) -> str:
    """The binary for this platform; ModelError if the file has none."""
    from fmpy import architecture, platform, platform_tuple, sharedLibraryExtension

    folders = [platform_tuple] if version == 3 else [platform_tuple, platform]
    if architecture == "aarch64" and platform.startswith(("linux", "win")):
        folders = [platform_tuple]  # FMPy's name for it is that of x86-64
    for place in folders:
        library = folder / "binaries" / place / (identifier + sharedLibraryExtension)
        if library.is_file():
            return str(library)
    binaries = folder / "binaries"
    there = sorted(entry.name for entry in binaries.iterdir()) if binaries.is_dir() else []
    raise ModelError(
        f"{_titled(name, file)} has binaries for {', '.join(there) or 'no platform'}, expected {folders[0]}; "
        "export it for this platform, or compile its sources"
    )


def _titled(name: str, file: str | Path) -> str:
    return f"{name}: {file}" if name else str(file)


def _number(text: Any) -> float | None:
    return None if text is None or text == "" else float(text)
