"""Parameters of real Gantry-Tau robots as frozen records: `prototypes.L1`, `.GT_A`, `.D1`, `.F1`.

`names()` lists all. The numbers stand in parameters/*.toml, each with its unit and its source; a record is
read when it is first named. `dataclasses.replace(prototypes.L1, plate_mass=12.0)` gives a variant; sequences
may be lists, so that one link of an arm is replaced like this:
```python
arms = list(prototypes.L1.arms)
links = list(arms[1].links)
links[0] = replace(links[0], length=links[0].length + 1e-4)
arms[1] = replace(arms[1], links=links)
longer = replace(prototypes.L1, arms=arms)
```
Two kinds of robot: `Prototype` has three carts; `RotatingPrototype`, the F1, has three rotations on them as well.
"""

import dataclasses
import functools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.schema import read_toml
from gantrytau.describing.record import Record
from gantrytau_models.quantities import (
    REMEDY,
    ROUNDING,
    Matrix,
    Pair,
    Vector,
    check_inertia,
    check_rotation,
    hold_numbers,
    hold_records,
    quantities_of,
    quantity,
)

Quaternion = tuple[float, float, float, float]

_FOLDER = Path(__file__).parent / "parameters"
_NO_ROTATION: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class UnknownPrototype(ModelError, AttributeError):
    """There is no prototype of this name."""


class DoubtfulPrototype(UserWarning):
    """A prototype as it is printed, although the print is known to be wrong."""


def _vector(unit: str, description: str, **limits: Any) -> dict[str, Any]:
    return quantity(unit, description, shape=(3,), **limits)


def _matrix(unit: str, description: str) -> dict[str, Any]:
    return quantity(unit, description, shape=(3, 3))


_DIRECTION = _vector("1", "axis of the guideway; its length is the transmission factor", nonzero=True)


@dataclass(frozen=True, kw_only=True)
class _AnyLink:
    """What all links between a cart and a plate that can turn have."""

    plate_offset: Vector = field(metadata=_vector("m", "joint on the plate B_ij^0, plate frame"))
    length: float = field(metadata=quantity("m", "distance of its two ball joints", positive=True))
    mass: float = field(metadata=quantity("kg", "mass of this one link", least=0.0))

    def __post_init__(self):
        hold_numbers(self, type(self).__name__)


@dataclass(frozen=True, kw_only=True)
class Link(_AnyLink):
    """One link of a robot whose plate can turn: from a joint on its cart to a joint on the plate (4.14).

    direction: as identified for this joint alone, where a source prints it (D1, Table 5.9). Joints of one cart
    then differ in direction because the cart turns a little on its way; a model whose carts are rigid and
    only slide takes the direction of the arm, as it does for None.
    """

    offset: Vector = field(metadata=_vector("m", "joint on the cart A_ij at s = 0, world frame"))
    direction: Vector | None = field(
        default=None, metadata=_vector("1", "direction of its joint on the cart", nonzero=True, optional=True)
    )


@dataclass(frozen=True)
class Arm:
    """One guideway with its cart, and the links between that cart and the plate.

    Position of the cart: offset + s * direction. Vectors are resolved in the world frame. Length and offset
    take the links as a single one, for the robot whose plate keeps its orientation; `links` has them one by
    one, for the robot whose plate can turn. Neither follows when the other is replaced.
    """

    length: float = field(metadata=quantity("m", "length of the link between cart and tool", positive=True))
    offset: Vector = field(
        metadata=_vector("m", "cart at s = 0, less the place of the joint on the plate (4.7)")
    )
    direction: Vector = field(metadata=_DIRECTION)
    links: tuple[Link, ...] = ()

    def __post_init__(self):
        hold_numbers(self, "Arm")
        hold_records(self, "Arm", "links", Link)


@dataclass(frozen=True, kw_only=True)
class _Robot(Record):
    """What all Gantry-Tau robots have. Friction is a number for each cart, or a pair: at positive and at negative speed."""

    name: str
    plate_mass: float = field(metadata=quantity("kg", "mass of the plate and tool", positive=True))
    plate_inertia: Matrix = field(metadata=_matrix("kg.m2", "inertia about the centre of mass, plate axes"))
    plate_centre: Vector = field(
        default=(0.0, 0.0, 0.0), metadata=_vector("m", "centre of mass from the tool point, plate frame")
    )
    plate_rotation: Matrix = field(
        default=_NO_ROTATION,
        metadata=_matrix("1", "nominal orientation, plate to world; a search starts here"),
    )
    cart_masses: Vector = field(metadata=_vector("kg", "mass of each cart and its drive", positive=True))
    coulomb: Vector | tuple[Pair, Pair, Pair] = field(
        metadata=_vector("N", "Coulomb friction of each cart", least=0.0, directed=True)
    )
    viscous: Vector | tuple[Pair, Pair, Pair] = field(
        metadata=_vector("kg/s", "viscous friction of each cart", least=0.0, directed=True)
    )
    source: str
    assumed: tuple[str, ...] = ()  # what the source does not print for this robot
    fitted: str = ""  # which numbers are fitted to printed results, and what that makes of these results

    def __post_init__(self):
        hold_numbers(self, self.name)
        check_inertia(f"{self.name}.plate_inertia", self.plate_inertia)
        check_rotation(f"{self.name}.plate_rotation", self.plate_rotation)

    def friction_by_direction(self) -> bool:
        """Whether friction is told as pairs, at positive and at negative speed."""
        return any(isinstance(one, tuple) for one in (*self.coulomb, *self.viscous))


@dataclass(frozen=True, kw_only=True)
class Prototype(_Robot):
    """Geometry, masses and friction of a Gantry-Tau robot with three arms.

    The three-link robot takes `link_masses`, the six-link robot `arms[i].links[j].mass` and what is said of
    the orientation of the plate.
    """

    arms: tuple[Arm, Arm, Arm]
    link_masses: Vector = field(metadata=_vector("kg", "mass of the links of each arm together", least=0.0))

    def __post_init__(self):
        hold_records(self, self.name, "arms", Arm, count=3)
        super().__post_init__()


@dataclass(frozen=True, kw_only=True)
class FlexiblePrototype(Prototype):
    """A robot with three arms whose frame sways and whose arms give way; in a point of its workspace."""

    frame_mass: float = field(metadata=quantity("kg", "mass of the frame that sways along x", positive=True))
    frame_stiffness: float = field(metadata=quantity("N/m", "stiffness of its feet along x", positive=True))
    frame_damping: float = field(metadata=quantity("N.s/m", "damping of its feet along x", least=0.0))
    arm_stiffness: Vector = field(
        metadata=_vector("N/m", "stiffness of each arm along its link", positive=True)
    )
    arm_damping: Vector = field(metadata=_vector("N.s/m", "damping of each arm along its link", least=0.0))
    lever: Vector = field(
        metadata=_vector("1", "deflection of the wrist for a unit of that of the plate, along each axis")
    )


@dataclass(frozen=True, kw_only=True)
class RotatingLink(_AnyLink):
    """One link of an F1: from a joint on the outermost turntable of its arm (or its cart) to one on the plate."""

    cart_offset: Vector = field(metadata=_vector("m", "joint A_bj, frame of the turntable or cart (4.16)"))


@dataclass(frozen=True)
class Turntable:
    """A joint support plate that a motor turns: frame H = [R(orientation) R(axis, angle), offset] (4.21), (4.23).

    Offset and orientation are resolved in the frame of the cart (world axes) or of the turntable before. The
    rotation of a scalar-first quaternion (w, r) is R = I + 2 w [r]x + 2 [r]x^2, as the thesis computes.
    """

    offset: Vector = field(metadata=_vector("m", "origin of its frame in the frame that carries it"))
    orientation: Quaternion = field(
        metadata=quantity("1", "quaternion of its frame at angle 0, scalar first", shape=(4,))
    )
    axis: Vector = field(metadata=_vector("1", "unit vector of the axis of rotation, its own frame"))
    mass: float = field(metadata=quantity("kg", "mass, centred in the origin of its frame", positive=True))
    inertia: Matrix = field(metadata=_matrix("kg.m2", "inertia about the origin of its frame, own axes"))

    def __post_init__(self):
        hold_numbers(self, "Turntable")
        check_inertia("Turntable.inertia", self.inertia)
        if abs(math.hypot(*self.axis) - 1.0) > ROUNDING:
            raise ModelError(f"Turntable.axis: found {self.axis}, expected a unit vector; {REMEDY}")


@dataclass(frozen=True)
class RotatingArm:
    """One guideway with its cart at offset + s * direction (world frame), turntables on it, and links."""

    offset: Vector = field(metadata=_vector("m", "origin of the cart frame at s = 0, A_i^0, world frame"))
    direction: Vector = field(metadata=_DIRECTION)
    turntables: tuple[Turntable, ...]
    links: tuple[RotatingLink, ...]

    def __post_init__(self):
        hold_numbers(self, "RotatingArm")
        hold_records(self, "RotatingArm", "turntables", Turntable)
        hold_records(self, "RotatingArm", "links", RotatingLink)


@dataclass(frozen=True, kw_only=True)
class RotatingPrototype(_Robot):
    """A Gantry-Tau robot with six degrees of freedom: three carts and three turntables (4.16)-(4.26).

    Actuator coordinates in the order of the thesis: the three carts, then the turntables in the order of the
    arms (q4 on arm 2, q5 and q6 on arm 3). unit_norm=False allows a table of quaternions that are not unit.
    """

    arms: tuple[RotatingArm, RotatingArm, RotatingArm]
    unit_norm: bool = True

    def __post_init__(self):
        hold_records(self, self.name, "arms", RotatingArm, count=3)
        super().__post_init__()
        for i, arm in enumerate(self.arms):
            for k, turntable in enumerate(arm.turntables):
                norm = math.hypot(*turntable.orientation)
                if self.unit_norm and abs(norm - 1.0) > 1e-9:  # a nanometre on a joint a metre away
                    raise ModelError(
                        f"{self.name}.arms[{i}].turntables[{k}].orientation: found a quaternion of length"
                        f" {norm:.6g}, expected 1; normalise it, or say unit_norm=False"
                    )


@functools.cache
def _table(name: str) -> dict[str, Any]:
    return read_toml(_FOLDER / f"{name}.toml")


def _entry(name: str, keys: Sequence[str | int], unit: str) -> Any:
    """The value of one entry of a file in the unit that the record expects."""
    entry: Any = _table(name)
    for key in keys:
        entry = entry[key]
    if entry["unit"] != unit:
        place = ".".join(map(str, (name, *keys)))
        raise ModelError(f"{place}: found the unit '{entry['unit']}', expected '{unit}'; convert the value")
    return _entry(entry["same_as"], keys, unit) if "same_as" in entry else entry["value"]


def _build(record: type, file: str, *keys: str | int, **others: Any) -> Any:
    """A record from the entries at `keys` of the file of a prototype; others: what stands for missing entries."""
    table: Any = _table(file)
    for key in keys:
        table = table[key]
    for item in quantities_of(record):
        if item.name in table or (item.name not in others and item.default is dataclasses.MISSING):
            others[item.name] = _entry(file, (*keys, item.name), item.metadata["unit"])
    return record(**others)


def _arm(name: str, i: int) -> Arm:
    """An arm with its links; a link without length or offset continues the arm for a plate with R = I (4.7)."""
    arm = _build(Arm, name, "arms", i)
    links = _table(name)["arms"][i]["links"]
    if isinstance(links, dict):
        name = links["same_as"]
        links = _table(name)["arms"][i]["links"]
    built = []
    for j in range(len(links)):
        keys = ("arms", i, "links", j)
        on_plate = _entry(name, (*keys, "plate_offset"), "m")
        offset = tuple(a + b for a, b in zip(arm.offset, on_plate, strict=True))
        built.append(_build(Link, name, *keys, length=arm.length, offset=offset))
    return dataclasses.replace(arm, links=tuple(built))


def _rotating_arm(name: str, i: int) -> RotatingArm:
    table = _table(name)["arms"][i]
    turntables = [
        _build(Turntable, name, "arms", i, "turntables", k) for k in range(len(table.get("turntables", ())))
    ]
    links = [_build(RotatingLink, name, "arms", i, "links", j) for j in range(len(table["links"]))]
    return _build(RotatingArm, name, "arms", i, turntables=turntables, links=links)


@functools.cache
def _read(name: str) -> Prototype | RotatingPrototype:
    table = _table(name)
    kind, read_arm, others = Prototype, _arm, {}
    if "unit_norm" in table:
        kind, read_arm, others = RotatingPrototype, _rotating_arm, {"unit_norm": table["unit_norm"]}
    if "frame_mass" in table:
        kind = FlexiblePrototype
    arms = [read_arm(name, i) for i in range(len(table["arms"]))]
    assumed = tuple(table.get("assumed", ()))
    others |= dict(source=table["source"], assumed=assumed, fitted=table.get("fitted", ""))
    return _build(kind, name, name=name, arms=arms, **others)


def names() -> list[str]:
    """The names of all prototypes, sorted; `getattr(prototypes, name)` reads one."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


D1: Prototype
GT_A: Prototype
L1: Prototype
L1_asymmetric: Prototype
L1_flexible: FlexiblePrototype
F1: RotatingPrototype
F1_ideal: RotatingPrototype
F1_printed: RotatingPrototype


def __getattr__(name: str) -> Prototype | RotatingPrototype:
    if name.startswith("_"):
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    if name not in names():
        raise UnknownPrototype(
            f"prototypes: there is no '{name}', expected one of {', '.join(names())}"
            f"{did_you_mean(name, names())}"
        )
    if "doubt" in _table(name):
        warnings.warn(f"prototypes.{name}: {_table(name)['doubt']}", DoubtfulPrototype, stacklevel=2)
    return _read(name)


def __dir__() -> list[str]:
    return [*globals(), *names()]
