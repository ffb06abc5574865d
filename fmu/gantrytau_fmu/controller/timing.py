"""What became of the samples of a run: how late they were, and what each client gave."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.results.result import Result
from gantrytau_fmu.controller.channels import Values

PERCENTILES = (50, 99, 100)


@dataclass(frozen=True)
class ClientCounts:
    """Of one client, in samples: answers that were taken; samples with those of before, as nothing new was there (held);
    answers that were too old or older than one taken (stale), or not finite, out of range, of another shape or of a sample
    to come (refused); messages that never became answers (dropped). failure: why it is not asked any more, "" while it is;
    reason: why an answer was refused or dropped for its values, the last time, "" if none was.
    """

    taken: int = 0
    held: int = 0
    stale: int = 0
    refused: int = 0
    dropped: int = 0
    failure: str = ""
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Timing(Record):
    """Of a run. lateness: s by which each sample began late, (samples,), empty with a virtual clock, which is never late;
    missed: samples that began a period late or more; limited, refused, unreachable: samples in which references met a
    limit, were not finite, or were out of reach of the kinematics; wall: s that the run took.
    """

    clock: str
    period: float
    samples: int
    wall: float
    lateness: Values
    missed: int
    limited: int = 0
    refused: int = 0
    unreachable: int = 0
    clients: Mapping[str, ClientCounts] = field(default_factory=dict)

    def percentile(self, part: float) -> float:
        """Lateness in s that so many per cent of the samples stay below; 0 with a virtual clock."""
        return float(np.percentile(self.lateness, part)) if self.lateness.size else 0.0

    def as_record(self) -> dict[str, Any]:
        """For programs."""
        return {
            "clock": self.clock,
            "period": self.period,
            "samples": self.samples,
            "wall": self.wall,
            "lateness": {f"p{part}": self.percentile(part) for part in PERCENTILES},
            "missed": self.missed,
            **self.counts(),
        }

    def counts(self) -> dict[str, Any]:
        """What does not depend on the machine's speed where the clock is virtual."""
        return {
            "references": {"limited": self.limited, "refused": self.refused, "unreachable": self.unreachable},
            "clients": {name: dict(vars(counts)) for name, counts in self.clients.items()},
        }

    def __str__(self) -> str:
        late = " / ".join(f"{1e6 * self.percentile(part):.0f}" for part in PERCENTILES)
        lines = [f"{self.samples} samples of {self.period:g} s in {self.wall:.3g} s, {self.clock} clock"]
        if self.lateness.size:
            lines.append(f"late by {late} us (50, 99, 100 %), {self.missed} missed")
        lines.append(
            f"references: {self.limited} limited, {self.refused} not finite, {self.unreachable} out of reach"
        )
        for name, c in self.clients.items():
            lines.append(
                f"{name}: {c.taken} taken, {c.held} held, {c.stale} stale, {c.refused} refused, {c.dropped} dropped"
                + (f"; refused last: {c.reason}" if c.reason else "")
                + (f"; {c.failure}" if c.failure else "")
            )
        return "\n".join(lines)


class ControlledResult(Result):
    """A `Result` of a controller, a row for each sample, with `.timing`."""

    def __init__(self, *arguments: Any, timing: Any = None, **options: Any):
        super().__init__(*arguments, **options)
        self._timing = timing

    @property
    def timing(self) -> Timing:
        """How late samples were, and what became of answers."""
        return self._timing

    def select(self, names: Sequence[str]) -> Self:
        """Only the named variables, with the timing of the whole."""
        found = super().select(names)
        found._timing = self._timing
        return found
