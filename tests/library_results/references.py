"""Reference results in folders: for each example its signals, the settings of its simulation, and its trajectories."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from gantrytau.modelica import read_tree, tree

SIGNALS, SETTINGS = "comparisonSignals.txt", "creation.txt"
SETTING = re.compile(r"^(StartTime|StopTime|Interval|Tolerance)\s*=\s*([-+.\deE]+)", re.MULTILINE)
POINTER = b"version https://git-lfs"  # the beginning of a file that stands for a large one
LONGEST_RANGE = 20_001  # points
POINTS = 501  # at least


@dataclass(frozen=True)
class Reference:
    """The folder of an example below the root of all results; its path is the name of the example."""

    root: Path
    name: str

    @property
    def folder(self) -> Path:
        """Where its files are."""
        return self.root.joinpath(*self.name.split("."))

    @property
    def package(self) -> str:
        """The package in whose row of the table the example is counted."""
        before = self.name.partition(".Examples.")[0].split(".")
        return ".".join(before[: {"Modelica": 3, "ModelicaTest": 2}.get(before[0], 1)])

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Names of the variables that are compared."""
        lines = (self.folder / SIGNALS).read_text(encoding="utf-8-sig").splitlines()
        return tuple(name for line in lines if (name := line.strip()) and name != "time")

    @cached_property
    def settings(self) -> dict[str, float]:
        """Start, stop, interval and tolerance of the reference, by their names in the annotation `experiment`."""
        path = self.folder / SETTINGS
        text = path.read_text(encoding="utf-8-sig", errors="replace") if path.is_file() else ""
        return {name: float(value) for name, value in SETTING.findall(text)}

    @property
    def points(self) -> int:
        """Number of output times: those of the reference within limits."""
        said = self.settings
        span, interval = said.get("StopTime", 0.0) - said.get("StartTime", 0.0), said.get("Interval", 0.0)
        count = round(span / interval) + 1 if interval > 0 else POINTS
        return min(max(count, POINTS), LONGEST_RANGE)

    @property
    def missing(self) -> str:
        """Why there are no trajectories; "" where there are."""
        path = self._trajectories
        if not path.is_file():
            return f"no file {path.name}"
        with path.open("rb") as file:
            return f"{path.name} is a pointer to a large file" if file.read(len(POINTER)) == POINTER else ""

    @property
    def _trajectories(self) -> Path:
        return self.folder / f"{self.folder.name}.csv"

    @cached_property
    def trajectories(self) -> dict[str, np.ndarray]:
        """Name -> values at the times of the file, `time` among them."""
        with self._trajectories.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file)
            names = [{"Time": "time"}.get(name.strip(), name.strip()) for name in next(rows)]
            values = np.array([[float(cell) for cell in row[: len(names)]] for row in rows if row])
        return dict(zip(names, values.T, strict=True))


@dataclass(frozen=True)
class Example(Reference):
    """An example of a library without reference results; root: the folder of the library."""


def examples(library: Path, package: str) -> list[Reference]:
    """The models of a package in a folder of libraries whose annotation `experiment` says when they end."""
    found = []
    for path in sorted((library / package).rglob("*.mo")):
        read = read_tree(path)
        for one in read.classes:
            found += [Example(library, name) for name in _experiments(one, read.within or "")]
    return found


def _experiments(one: tree.ClassDefinition, around: str) -> Iterator[str]:
    """The full names of a class and of the classes in it that are models with an `experiment`."""
    name = f"{around}.{one.name}".lstrip(".")
    said = [a.name for a in one.annotation or () if isinstance(a, tree.Argument)]
    if one.kind in ("model", "block") and "partial" not in one.prefixes and "experiment" in said:
        yield name
    for section in one.body.sections if isinstance(one.body, tree.Composition) else ():
        for item in section.items:
            if isinstance(item, tree.ClassDefinition):
                yield from _experiments(item, name)


def references(root: Path, only: str = "") -> list[Reference]:
    """The examples with a list of signals, in order of their names; only: the name of an example or of a package."""
    found = (
        Reference(root, ".".join(path.parent.relative_to(root).parts))
        for path in sorted(root.glob(f"**/{SIGNALS}"))
    )
    return [one for one in found if not only or f"{one.name}.".startswith(f"{only.rstrip('.')}.")]
