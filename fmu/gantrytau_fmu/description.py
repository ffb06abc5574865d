"""What an FMU shows to the outside: its variables, how they depend on each other, and what it can do.

One set of records, written and read: `export_fmu` makes them of a model, and the XML files of them; `read_fmu` makes them
of the files. FMI 3.0.2, sections 2.2 and 2.4; FMI 2.0.4, section 2.2.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import prod
from typing import Literal

from gantrytau.describing.record import Record

Interfaces = Literal["model-exchange", "co-simulation"]
Value = float | int | bool | str | tuple[float | int | bool | str, ...]
C_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


@dataclass(frozen=True)
class FmuVariable(Record):
    """A variable of an FMU, with what its declared type adds; causality, variability, initial: in the standard's words.

    name: in the structured naming convention; reference: its value reference; start: None if it has none, a tuple for
    arrays; unit: "" if none is named, "1" if it has none, which a file does not tell apart; type: Float64, Int32,
    Boolean, ... (FMI 2: Real, Integer, Boolean, String, Enumeration); shape: () for scalars, by the start values of the
    sizes; derivative: the name of the state whose derivative it is; display: the unit in which tools show it, "" if its
    declaration names none.
    """

    name: str
    reference: int
    causality: str
    variability: str
    initial: str | None = None
    start: Value | None = None
    unit: str = ""
    description: str = ""
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    type: str = "Float64"
    shape: tuple[int, ...] = ()
    derivative: str | None = None
    display: str = ""

    @property
    def real(self) -> bool:
        """Whether it is a number of double precision."""
        return self.type in ("Float64", "Real")

    @property
    def integer(self) -> bool:
        """Whether it is a whole number of 32 bits."""
        return self.type in ("Int32", "Integer")


@dataclass(frozen=True)
class Unknown:
    """An entry of the model structure: what it depends on directly, None where nothing is said, and how.

    kinds: "dependent", "constant", "fixed", "tunable" or "discrete", one for each; None: "dependent" all of them.
    """

    name: str
    dependencies: tuple[str, ...] | None = None
    kinds: tuple[str, ...] | None = None


@dataclass(frozen=True)
class ModelStructure(Record):
    """What is to be computed, and of what; indicators: names of event indicators, None in FMI 2, which counts them."""

    outputs: tuple[Unknown, ...] = ()
    derivatives: tuple[Unknown, ...] = ()
    initial_unknowns: tuple[Unknown, ...] = ()
    indicators: tuple[str | None, ...] = ()


@dataclass(frozen=True)
class FmuInterface(Record):
    """A way to run an FMU: kind, the identifier in the names of its binaries, and its capabilities by name.

    Directional derivatives of FMI 3 stand under its name and under that of FMI 2, so that one name is there for both.
    What is written, besides those that are said here, is what the C runtime can do.
    """

    kind: str  # model-exchange, co-simulation or scheduled-execution
    identifier: str
    capabilities: Mapping[str, bool | int | float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class DefaultExperiment:
    """The default experiment, s; step: of Co-Simulation. None for what a file does not say."""

    start: float | None = 0.0
    stop: float | None = 1.0
    tolerance: float | None = 1e-6
    step: float | None = 0.004


@dataclass(frozen=True)
class FmuTerminal(Record):
    """Variables that belong together, by the name that each has in the terminal; inner ones are `name.inner`."""

    name: str
    members: dict[str, str]
    kind: str = ""
    description: str = ""


@dataclass(frozen=True)
class AboutFmu(Record):
    """What people say of an FMU: what it is, who made it, whose it is, on which terms, and which version this is."""

    description: str = ""
    author: str = ""
    copyright: str = ""
    license: str = ""
    version: str = ""


@dataclass(frozen=True, kw_only=True)
class FmuDescription(AboutFmu):
    """All that the files of an FMU say.

    fmi: version of the standard, "2.0" or "3.0"; token: GUID or instantiation token; platforms: by the names of FMI 3,
    e.g. "x86_64-linux", for which there is a binary for each interface; sources: files to be compiled, () if it has
    none; generated: date and time, ISO 8601 in UTC.
    """

    fmi: str = "3.0"
    name: str
    token: str
    interfaces: tuple[FmuInterface, ...]
    variables: tuple[FmuVariable, ...] = field(repr=False)
    structure: ModelStructure = field(default_factory=ModelStructure, repr=False)
    experiment: DefaultExperiment = field(default_factory=DefaultExperiment)
    terminals: tuple[FmuTerminal, ...] = ()
    platforms: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    tool: str = "gantrytau"
    generated: str = ""

    @property
    def identifier(self) -> str:
        """The name of its binaries, of the first interface."""
        return self.interfaces[0].identifier

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self._named("input")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what can be set before a simulation, and is no input or start value."""
        return self._named("parameter", "structuralParameter")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(unknown.name for unknown in self.structure.outputs)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in the order of their derivatives."""
        rates = (self.by_name[unknown.name] for unknown in self.structure.derivatives)
        return tuple(rate.derivative for rate in rates if rate.derivative is not None)

    @property
    def dependencies(self) -> dict[str, tuple[str, ...] | None]:
        """For each output and derivative what it depends on directly, None where the FMU does not say."""
        listed = (*self.structure.outputs, *self.structure.derivatives)
        return {unknown.name: unknown.dependencies for unknown in listed}

    @property
    def indicators(self) -> int:
        """Number of event indicators, of those that are arrays all elements."""
        return sum(
            1 if name is None else prod(self.by_name[name].shape) for name in self.structure.indicators
        )

    @cached_property
    def by_name(self) -> dict[str, FmuVariable]:
        """The variables by their names."""
        return {variable.name: variable for variable in self.variables}

    def has(self, kind: Interfaces) -> bool:
        """Whether there is an interface of a kind."""
        return any(each.kind == kind for each in self.interfaces)

    def _named(self, *causalities: str) -> tuple[str, ...]:
        return tuple(variable.name for variable in self.variables if variable.causality in causalities)
