"""An FMU as a file: what is written in it, and how it prints itself."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau_fmu.description import FmuDescription, FmuInterface, FmuVariable, Value

SHOWN = 12  # variables of a kind that the printed table lists
_KINDS = {
    "model-exchange": "Model Exchange",
    "co-simulation": "Co-Simulation",
    "scheduled-execution": "Scheduled Execution",
}


@dataclass(frozen=True, kw_only=True)
class FmuFile(FmuDescription):
    """An FMU as `read_fmu` finds it; prints itself as a short table. size, unpacked: bytes."""

    path: Path
    size: int
    unpacked: int

    def variable(self, name: str) -> FmuVariable:
        """A variable by name; ModelError if there is none of this name."""
        found = self.by_name.get(name)
        if found is None:
            raise ModelError(
                f"{self.path.name}: {self.name} has no variable '{name}'{did_you_mean(name, self.by_name)}"
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
        names = ("inputs", "outputs", "parameters", "states", "dependencies", "indicators")
        found: dict[str, Any] = (
            asdict(self) | {name: getattr(self, name) for name in names} | {"path": str(self.path)}
        )
        del found["structure"]  # it is in them
        return found | {"interfaces": {each.pop("kind"): each for each in found["interfaces"]}}

    def __str__(self) -> str:
        """What it is, how it runs, and the first of its inputs, outputs and parameters."""
        return self.table()

    def table(self, shown: int | None = SHOWN) -> str:
        """The same with the first `shown` variables of each kind, None: all of them."""
        return "\n".join([*_headlines(self), *_tables(self, shown)])


def _headlines(fmu: FmuFile) -> list[str]:
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


def _tables(fmu: FmuFile, shown: int | None) -> list[str]:
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
