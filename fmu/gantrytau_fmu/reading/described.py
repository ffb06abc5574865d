"""The record of an FMU as its files describe it, and how it prints itself."""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from gantrytau.errors import ModelError, did_you_mean
from gantrytau_fmu.description import Causality, Initial, Variability

Value = float | int | bool | str | tuple[float | int | bool | str, ...]
SHOWN = 12  # variables of a kind that the printed table lists
_KINDS = {
    "model-exchange": "Model Exchange",
    "co-simulation": "Co-Simulation",
    "scheduled-execution": "Scheduled Execution",
}


@dataclass(frozen=True)
class FmuVariable:
    """A variable as the model description declares it, with what its declared type adds.

    type: Float64, Int32, Boolean, ... (FMI 2: Real, Integer, Boolean, String, Enumeration); start: None if it
    has none, a tuple for arrays; unit: "" if none is named; shape: () for scalars, by the start values of the
    sizes; derivative: the name of the state whose derivative it is.
    """

    name: str
    reference: int
    type: str
    causality: Causality | str
    variability: Variability | str
    initial: Initial | str | None
    start: Value | None
    unit: str
    description: str
    min: float | None
    max: float | None
    nominal: float | None
    shape: tuple[int, ...]
    derivative: str | None


@dataclass(frozen=True)
class FmuInterface:
    """A way to run an FMU: kind, the identifier in the names of its binaries, and its capabilities by name.

    Directional derivatives of FMI 3 stand under its name and under that of FMI 2, so that one name is there for both.
    """

    kind: str  # model-exchange, co-simulation or scheduled-execution
    identifier: str
    capabilities: dict[str, bool | int | float | None]


@dataclass(frozen=True)
class FmuExperiment:
    """The default experiment, s; None for what is not said."""

    start: float | None = None
    stop: float | None = None
    tolerance: float | None = None
    step: float | None = None


@dataclass(frozen=True)
class FmuTerminal:
    """Variables that belong together, by the name that each has in the terminal; inner ones are `name.inner`."""

    name: str
    kind: str
    description: str
    members: dict[str, str]


@dataclass(frozen=True)
class FmuDescription:
    """An FMU as `read_fmu` finds it; prints itself as a short table.

    token: GUID or instantiation token; dependencies: for each output and derivative the names of what it depends
    on directly, None where the FMU does not say; indicators: number of event indicators; platforms: by the names
    of FMI 3, e.g. "x86_64-linux", for which there is a binary for each interface; sources: files to be compiled,
    () if it has none; size, unpacked: bytes.
    """

    path: Path
    fmi: str
    name: str
    token: str
    description: str
    tool: str
    generated: str
    author: str
    version: str
    license: str
    interfaces: tuple[FmuInterface, ...]
    variables: tuple[FmuVariable, ...] = field(repr=False)
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    dependencies: dict[str, tuple[str, ...] | None] = field(repr=False)
    indicators: int
    platforms: tuple[str, ...]
    sources: tuple[str, ...]
    experiment: FmuExperiment
    terminals: tuple[FmuTerminal, ...]
    size: int
    unpacked: int

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self._named("input")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what can be set before a simulation, and is no input or start value."""
        return self._named("parameter", "structuralParameter")

    @property
    def has_sources(self) -> bool:
        """Whether it can be compiled for other platforms."""
        return bool(self.sources)

    def variable(self, name: str) -> FmuVariable:
        """A variable by name; ModelError if there is none of this name."""
        found = self._by_name.get(name)
        if found is None:
            raise ModelError(
                f"{self.path.name}: {self.name} has no variable '{name}'{did_you_mean(name, self._by_name)}"
            )
        return found

    def interface(self, kind: str) -> FmuInterface:
        """The interface of a kind, e.g. "co-simulation"; ModelError if the FMU lacks it."""
        found = next((interface for interface in self.interfaces if interface.kind == kind), None)
        if found is None:
            kinds = ", ".join(interface.kind for interface in self.interfaces)
            raise ModelError(f"{self.path.name}: found only {kinds}, expected {kind}; use an FMU that has it")
        return found

    def as_dict(self) -> dict[str, Any]:
        """All of it as numbers, texts, lists and dictionaries, for JSON."""
        found = asdict(self) | {"path": str(self.path), "inputs": self.inputs, "parameters": self.parameters}
        return found | {"interfaces": {each.pop("kind"): each for each in found["interfaces"]}}

    def __str__(self) -> str:
        """What it is, how it runs, and the first of its inputs, outputs and parameters."""
        return self.table()

    def table(self, shown: int | None = SHOWN) -> str:
        """The same with the first `shown` variables of each kind, None: all of them."""
        return "\n".join([*_headlines(self), *_tables(self, shown)])

    @cached_property
    def _by_name(self) -> dict[str, FmuVariable]:
        return {variable.name: variable for variable in self.variables}

    def _named(self, *causalities: str) -> tuple[str, ...]:
        return tuple(variable.name for variable in self.variables if variable.causality in causalities)


def _headlines(fmu: FmuDescription) -> list[str]:
    """What it is, how and where it runs."""
    kinds = [_KINDS.get(each.kind, each.kind) for each in fmu.interfaces]
    tool = f", from {fmu.tool}" if fmu.tool else ""
    lines = [f"{fmu.name}: FMI {fmu.fmi}, {' and '.join(kinds)}{tool}"]
    if fmu.description:
        lines.append(fmu.description)
    platforms = ", ".join(fmu.platforms) or "none"
    lines.append(f"binaries for {platforms}; {'with' if fmu.sources else 'no'} sources")
    counts = (
        (len(fmu.inputs), "input"),
        (len(fmu.outputs), "output"),
        (len(fmu.parameters), "parameter"),
        (len(fmu.states), "state"),
        (len(fmu.variables), "variable"),
    )
    words = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts)
    lines.append(f"{words}; {fmu.size / 1000:,.0f} kB, {fmu.unpacked / 1000:,.0f} kB unpacked")
    said = [
        f"{word} {value:g}{unit}"
        for word, value, unit in (
            ("start", fmu.experiment.start, " s"),
            ("stop", fmu.experiment.stop, " s"),
            ("step", fmu.experiment.step, " s"),
            ("tolerance", fmu.experiment.tolerance, ""),
        )
        if value is not None
    ]
    if said:
        lines.append(f"default experiment: {', '.join(said)}")
    return lines


def _tables(fmu: FmuDescription, shown: int | None) -> list[str]:
    """The first inputs, outputs and parameters with unit, start value and description."""
    lines: list[str] = []
    for title, names in (("inputs", fmu.inputs), ("outputs", fmu.outputs), ("parameters", fmu.parameters)):
        if not names:
            continue
        lines += ["", title]
        rows = [_row(fmu.variable(name)) for name in names[:shown]]
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        for row in rows:
            cells = [text.ljust(width) for text, width in zip(row, widths, strict=False)]
            lines.append("  ".join(["", *cells, row[3]]).rstrip())
        if shown is not None and len(names) > shown:
            lines.append(f"  ... and {len(names) - shown} more")
    return lines


def _row(variable: FmuVariable) -> tuple[str, str, str, str]:
    """Name with its shape, start value, unit, description."""
    shape = f"[{', '.join(map(str, variable.shape))}]" if variable.shape else ""
    return (f"{variable.name}{shape}", _short(variable.start), variable.unit, variable.description)


def _short(value: Value | None) -> str:
    """A start value in a few letters."""
    if value is None:
        return ""
    if isinstance(value, tuple):
        text = " ".join(_short(item) for item in value[:4])
        return f"{text} ..." if len(value) > 4 else text
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 24 else f"{text[:21]}..."
