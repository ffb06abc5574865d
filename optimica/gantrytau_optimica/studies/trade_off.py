"""A family of optima along a weight: what is gained in one quantity for what is lost in another."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.studies.figures import draw, write

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class TradeOff(Record):
    """Optima along a weight. `points` are those found, in the order of `weights` (n,); ["quantity"] is (n,).

    failures: what was said for a weight without optimum; findings: points that are local minima only, and steps of the
    weight that had to be smaller.
    """

    name: str
    weight: str
    weights: np.ndarray
    points: tuple[Optimum, ...]
    quantities: dict[str, np.ndarray]
    failures: dict[float, str]
    findings: tuple[str, ...]
    units: dict[str, str]

    def __repr__(self) -> str:
        lost = f", {len(self.failures)} not found" if self.failures else ""
        return f"<TradeOff {self.name}: {len(self.points)} points along {self.weight}{lost}>"

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, name: str) -> np.ndarray:
        found = {**self.quantities, self.weight: self.weights}
        if name not in found:
            raise ModelError(f"{self.name}: the points have no '{name}'{did_you_mean(name, found)}")
        return found[name]

    def _ipython_key_completions_(self) -> list[str]:
        return [self.weight, *self.quantities]

    @property
    def iterations(self) -> int:
        """Iterations of the solver for the points as they stand."""
        return sum(point.iterations for point in self.points)

    def report(self) -> str:
        """A table of weights and quantities, what was not found, and what to doubt."""
        heads = [self.weight, *(f"{n} [{self.units[n]}]" if n in self.units else n for n in self.quantities)]
        lines = ["  ".join(f"{head:>14}" for head in heads)]
        for k, weight in enumerate(self.weights):
            row = [weight, *(column[k] for column in self.quantities.values())]
            lines.append("  ".join(f"{x:>{max(14, len(h))}.6g}" for x, h in zip(row, heads, strict=True)))
        lines += [f"{self.weight} = {w:g}: {words.splitlines()[0]}" for w, words in self.failures.items()]
        return "\n".join([*lines, *self.findings])

    def plot(self, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The first quantity over the others, each point with its weight; saved to `file` if one is named."""
        title = f"{self.name}: points labelled with their {self.weight}"
        return draw(title, {self.weight: self.weights, **self.quantities}, self.units, file)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write weights and quantities as CSV, one row per point."""
        columns = {self.weight: self.weights, **self.quantities}
        for word in ("objective", "iterations"):
            columns.setdefault(word, np.array([getattr(point, word) for point in self.points]))
        return write(columns, path)
