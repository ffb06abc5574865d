"""What a check found, and in which order it is told."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from gantrytau.describing.record import Record

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class FmuFinding(Record):
    """Something that a check found: an "error", a "warning" (it may work elsewhere) or a "note"; path: of what file."""

    severity: Severity
    message: str
    path: str = field(default="", compare=False)

    def __str__(self) -> str:
        return (
            f"{self.path}: {self.severity}: {self.message}"
            if self.path
            else f"{self.severity}: {self.message}"
        )


def fault(message: str) -> FmuFinding:
    """An error."""
    return FmuFinding("error", message)


def errors_first(findings: Iterable[FmuFinding]) -> list[FmuFinding]:
    """The same, errors before warnings before notes."""
    order = ("error", "warning", "note")
    return sorted(findings, key=lambda finding: order.index(finding.severity))
