"""Linear systems on file: their names and matrices as JSON, as arrays of NumPy, or as a table."""

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.whole_files import replacing

MATRICES = ("A", "B", "C", "D")


class Saved(Protocol):
    """Content of a saved system."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @property
    def inputs(self) -> tuple[str, ...]: ...
    @property
    def outputs(self) -> tuple[str, ...]: ...
    @property
    def states(self) -> tuple[str, ...]: ...
    @property
    def period(self) -> float | None: ...
    @property
    def title(self) -> str: ...
    @property
    def poles(self) -> np.ndarray: ...
    @property
    def damping(self) -> np.ndarray: ...
    @property
    def eigenfrequencies(self) -> np.ndarray: ...
    def unit(self, name: str) -> str: ...


def record(system: Saved) -> dict[str, Any]:
    """Names, units, matrices (lists of rows) and poles as plain values; Hz and the damping ratio with each pole."""
    names = (*system.states, *system.inputs, *system.outputs)
    poles = zip(system.poles, system.eigenfrequencies, system.damping, strict=True)
    return {
        "title": system.title,
        "period": system.period,
        "states": list(system.states),
        "inputs": list(system.inputs),
        "outputs": list(system.outputs),
        "units": {name: system.unit(name) for name in names},
        **{name: getattr(system, name).tolist() for name in MATRICES},
        "poles": [
            dict(real=float(p.real), imaginary=float(p.imag), hertz=float(f), damping=float(d))
            for p, f, d in poles
        ],
    }


def save_system(system: Saved, path: str | os.PathLike[str]) -> Path:
    """Write a system in the format that the suffix of `path` names; see `LinearSystem.save`."""
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        words = f"found the suffix '{path.suffix}', expected one of {', '.join(_WRITERS)}"
        raise ModelError(words, place=str(path), argument="path")
    with replacing(path) as partial:
        writer(system, partial)
    return path


def _write_json(system: Saved, path: Path) -> None:
    path.write_text(json.dumps(record(system), indent=2) + "\n", encoding="utf-8")


def _write_npz(system: Saved, path: Path) -> None:
    """Arrays by name; the period is not a number where there is none."""
    arrays: dict[str, Any] = {name: getattr(system, name) for name in MATRICES}
    arrays |= {name: np.array(getattr(system, name), dtype=str) for name in ("states", "inputs", "outputs")}
    with path.open("wb") as file:
        np.savez(file, period=np.nan if system.period is None else system.period, **arrays)


def _write_csv(system: Saved, path: Path) -> None:
    """[A B; C D] with the names of its columns above and of its rows before them."""
    after = "der({})" if system.period is None else "{} a sample later"
    rows = [*(after.format(name) for name in system.states), *system.outputs]
    matrix = np.block([[system.A, system.B], [system.C, system.D]])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["", *system.states, *system.inputs])
        writer.writerows([name, *row] for name, row in zip(rows, matrix.tolist(), strict=True))


_WRITERS: dict[str, Callable[[Saved, Path], None]] = {
    ".json": _write_json,
    ".npz": _write_npz,
    ".csv": _write_csv,
}
