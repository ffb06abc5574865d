"""Parameters of real Gantry-Tau robots as frozen records: `prototypes.L1`, `.D1`, `.GT_A`.

The numbers stand in parameters/*.toml, each with its unit and its source; a record is read when it is first
named. `dataclasses.replace(prototypes.L1, plate_mass=12.0)` gives a variant.
"""

import dataclasses
import functools
import math
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gantrytau.errors import ModelError, did_you_mean

Vector = tuple[float, float, float]

_FOLDER = Path(__file__).parent / "parameters"
_REMEDY = "correct the value in the TOML file or in dataclasses.replace"


class UnknownPrototype(ModelError, AttributeError):
    """There is no prototype of this name."""


def _quantity(
    unit: str, description: str, *, positive: bool = False, least: float = -math.inf
) -> dict[str, Any]:
    """What a field says about its number, or about each of its three.

    positive: each number must be above 0; least: the smallest number allowed.
    """
    return {"unit": unit, "description": description, "positive": positive, "least": least}


@dataclass(frozen=True)
class Arm:
    """One guideway with its cart, and the links between that cart and the plate, taken as a single link.

    Position of the cart: offset + s * direction. Vectors are resolved in the world frame.
    """

    length: float = field(metadata=_quantity("m", "length of the link between cart and tool", positive=True))
    offset: Vector = field(
        metadata=_quantity("m", "cart at s = 0, less the place of the joint on the plate (4.7)")
    )
    direction: Vector = field(
        metadata=_quantity("1", "axis of the guideway; its length is the transmission factor")
    )

    def __post_init__(self):
        _hold_numbers(self, "Arm", vectors=("offset", "direction"))
        if not any(self.direction):
            raise ModelError(f"Arm.direction: found (0, 0, 0), expected the axis of a guideway; {_REMEDY}")


@dataclass(frozen=True)
class Prototype:
    """Geometry, masses and friction of a Gantry-Tau robot with three arms."""

    name: str
    arms: tuple[Arm, Arm, Arm]
    plate_mass: float = field(metadata=_quantity("kg", "mass of the plate and tool", positive=True))
    cart_masses: Vector = field(metadata=_quantity("kg", "mass of each cart and its drive", positive=True))
    link_masses: Vector = field(metadata=_quantity("kg", "mass of the links of each arm together", least=0.0))
    coulomb: Vector = field(metadata=_quantity("N", "Coulomb friction of each cart", least=0.0))
    viscous: Vector = field(metadata=_quantity("kg/s", "viscous friction of each cart", least=0.0))
    source: str
    assumed: tuple[str, ...] = ()  # fields that the source does not print for this robot

    def __post_init__(self):
        arms = tuple(self.arms)
        if len(arms) != 3 or not all(isinstance(arm, Arm) for arm in arms):
            found = ", ".join(type(arm).__name__ for arm in arms) or "nothing"
            raise ModelError(f"{self.name}.arms: found {found}; expected three Arm records; {_REMEDY}")
        object.__setattr__(self, "arms", arms)
        _hold_numbers(self, self.name, vectors=("cart_masses", "link_masses", "coulomb", "viscous"))


def _hold_numbers(record: Any, path: str, *, vectors: tuple[str, ...]) -> None:
    """Check the quantities of a record, and hold them as floats and tuples of three floats."""
    for item in dataclasses.fields(record):
        if "unit" not in item.metadata:
            continue
        place, value = f"{path}.{item.name}", getattr(record, item.name)
        if item.name not in vectors:
            checked: Any = _number(place, value, item)
        else:
            if isinstance(value, str) or not isinstance(value, Iterable) or len(elements := list(value)) != 3:
                raise ModelError(
                    f"{place}: found {value!r}, expected three numbers in {_unit(item)}; {_REMEDY}"
                )
            checked = tuple(_number(f"{place}[{k}]", element, item) for k, element in enumerate(elements))
        object.__setattr__(record, item.name, checked)


def _number(place: str, value: Any, item: dataclasses.Field) -> float:
    """A finite number within the bounds of its field."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    positive, least = item.metadata["positive"], item.metadata["least"]
    if math.isfinite(number) and number >= least and (number > 0 or not positive):
        return number
    bound = " above 0" if positive else "" if least == -math.inf else f" of at least {least:g}"
    raise ModelError(f"{place}: found {value!r}, expected a finite number{bound} in {_unit(item)}; {_REMEDY}")


def _unit(item: dataclasses.Field) -> str:
    unit = item.metadata["unit"]
    return "no unit" if unit == "1" else unit


@functools.cache
def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((_FOLDER / f"{name}.toml").read_text(encoding="utf-8"))


def _entry(name: str, keys: tuple[str | int, ...], unit: str) -> Any:
    """The value of one entry of a file in the unit that the record expects."""
    entry: Any = _table(name)
    for key in keys:
        entry = entry[key]
    if entry["unit"] != unit:
        place = ".".join(map(str, (name, *keys)))
        raise ModelError(f"{place}: found the unit '{entry['unit']}', expected '{unit}'; convert the value")
    return _entry(entry["same_as"], keys, unit) if "same_as" in entry else entry["value"]


def _quantities(name: str, record: type, *keys: str | int) -> dict[str, Any]:
    """The values of the quantities of a record, from the file of a prototype."""
    items = (item for item in dataclasses.fields(record) if "unit" in item.metadata)
    return {item.name: _entry(name, (*keys, item.name), item.metadata["unit"]) for item in items}


@functools.cache
def _read(name: str) -> Prototype:
    table = _table(name)
    arms = [Arm(**_quantities(name, Arm, "arms", k)) for k in range(len(table["arms"]))]
    return Prototype(
        name=name,
        arms=arms,  # pyright: ignore[reportArgumentType]  # the record checks that there are three
        source=table["source"],
        assumed=tuple(table.get("assumed", ())),
        **_quantities(name, Prototype),
    )


def _names() -> list[str]:
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def __getattr__(name: str) -> Prototype:
    if name.startswith("_"):
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    if name not in _names():
        raise UnknownPrototype(
            f"prototypes: there is no '{name}', expected one of {', '.join(_names())}"
            f"{did_you_mean(name, _names())}"
        )
    return _read(name)


def __dir__() -> list[str]:
    return [*globals(), *_names()]
