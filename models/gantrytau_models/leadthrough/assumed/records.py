"""Surfaces and people as frozen records, read from leadthrough/*.toml: `surfaces.METAL`, `operators.SKILLED`."""

import functools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau.border.schema import read_toml
from gantrytau.describing.record import Record
from gantrytau_models.quantities import hold_numbers, quantities_of, quantity

_FOLDER = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class SurfaceRecord(Record):
    """A surface that a tool is led along; z = slope x + ripple, in axes of the tool. No value is printed."""

    name: str
    stiffness: float = field(metadata=quantity("N/m", "stiffness against the tool", positive=True))
    tilt: float = field(metadata=quantity("rad", "angle against the x axis of the tool"))
    ripple: float = field(metadata=quantity("m", "amplitude of its ripple", least=0.0))
    ripple_length: float = field(metadata=quantity("m", "length of a ripple along x", positive=True))
    rolling: float = field(metadata=quantity("1", "rolling resistance over normal force", least=0.0))

    def __post_init__(self):
        hold_numbers(self, f"surface {self.name}")


@dataclass(frozen=True, kw_only=True)
class OperatorRecord(Record):
    """How somebody leads a tool along a surface. No value is printed."""

    name: str
    speed: float = field(metadata=quantity("m/s", "speed to and fro along x", least=0.0))
    stroke_time: float = field(metadata=quantity("s", "time of one way", positive=True))
    approach: float = field(metadata=quantity("m/s", "largest speed to and from the surface", positive=True))
    eye_gain: float = field(metadata=quantity("1/s", "speed for an error of the height", least=0.0))
    misjudgement: float = field(metadata=quantity("m", "standard deviation of the height as seen", least=0.0))
    misjudgement_time: float = field(metadata=quantity("s", "how long a misjudgement lasts", positive=True))
    depth: float = field(metadata=quantity("m", "intended depth below the surface"))
    arm: float = field(metadata=quantity("N.s/m", "force for an error of the velocity", least=0.0))
    muscle_time: float = field(metadata=quantity("s", "time constant of the force", positive=True))
    tremor: float = field(metadata=quantity("N", "standard deviation of the tremor", least=0.0))
    tremor_frequency: float = field(metadata=quantity("Hz", "frequency of the tremor", positive=True))
    force_noise: float = field(
        metadata=quantity("1", "standard deviation of the force over itself", least=0.0)
    )
    press: float = field(metadata=quantity("N", "force by which contact is helped", least=0.0))
    pull: float = field(metadata=quantity("N", "force that ends the contact", least=0.0))
    spread: float = field(
        metadata=quantity("1", "largest deviation from run to run, of speed, depth and arm", least=0.0)
    )

    def __post_init__(self):
        hold_numbers(self, f"operator {self.name}")


@functools.cache
def read(file: str, name: str) -> Any:
    """A record of surfaces.toml or operators.toml; ModelError for a unit that is not that of the record."""
    record = {"surfaces": SurfaceRecord, "operators": OperatorRecord}[file]
    table = read_toml(_FOLDER / f"{file}.toml")[name]
    values = {}
    for item in quantities_of(record):
        entry = table[item.name]
        if entry["unit"] != item.metadata["unit"]:
            raise ModelError(
                f"{file}.{name}.{item.name}: found the unit '{entry['unit']}', expected '{item.metadata['unit']}'; convert "
                "the value"
            )
        values[item.name] = entry["value"]
    return record(name=name, **values)
