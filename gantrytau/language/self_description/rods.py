"""What a robot on rods says of itself: which of its parameters are lengths, joints and guideways, by name.

A model whose plate hangs on rods between ball joints, their carts on straight guideways, has a method `rods()`:

    def rods(self):
        return Rods([
            RodArm("left", "left.cart.s", "left.axis", "left.start", [SingleRod("left.rod", plate_offset="left.joint")]),
            ...
        ])

Kinematics, calibration and whoever else wants the geometry of links read this, and know no robot by its names.
"""

import inspect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from types import FunctionType
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record


@dataclass(frozen=True)
class SingleRod:
    """A rod: its length; its joint where it hangs, on the cart or the last turntable; its joint on the plate, in plate axes.

    Without a joint it begins at the cart itself, or ends in the tool point, of a plate that keeps its orientation.
    """

    length: str
    offset: str | None = None
    plate_offset: str | None = None

    @property
    def name(self) -> str:
        """The path of the rod: `arms[0].links[1]` of `arms[0].links[1].length`."""
        return self.length.rpartition(".")[0] or self.length


@dataclass(frozen=True)
class RodTurntable:
    """A turntable: its driven angle; its axis, in its own frame; its place and its unit quaternion in what carries it."""

    joint: str
    axis: str
    offset: str
    orientation: str

    @property
    def name(self) -> str:
        """The path of the turntable."""
        return self.offset.rpartition(".")[0]


@dataclass(frozen=True)
class RodArm(Record):
    """An arm: its path; the driven coordinate of its cart; its guideway, cart = offset + s direction; its rods, and the
    turntables that carry them, from the cart outwards.
    """

    name: str
    joint: str
    direction: str
    offset: str | None
    rods: Sequence[SingleRod]
    turntables: Sequence[RodTurntable] = ()

    def __post_init__(self):
        for name in ("rods", "turntables"):
            object.__setattr__(self, name, tuple(getattr(self, name)))


@dataclass(frozen=True)
class Rods(Record):
    """The arms of a robot. given: parameters that follow by convention, which no calibration looks for."""

    arms: Sequence[RodArm]
    given: Sequence[str] = ()

    def __post_init__(self):
        for name in ("arms", "given"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for part in self._parts():
            for field in fields(part):
                value = getattr(part, field.name)
                if not isinstance(value, (str, tuple)) and not (value is None and "offset" in field.name):
                    raise ModelError(
                        f"rods: found {type(part).__name__}.{field.name} = {value!r}, expected the name of a parameter or "
                        "of a coordinate, such as 'arms[0].length'"
                    )

    def _parts(self) -> Iterator[Any]:
        for arm in self.arms:
            if not isinstance(arm, RodArm):
                raise ModelError(f"rods: found {arm!r} among the arms, expected RodArm(...)")
            yield arm
            yield from arm.rods
            yield from arm.turntables

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the driven coordinates, the columns of q: carts, then turntables."""
        return (*(arm.joint for arm in self.arms), *(table.joint for table in self.turntables))

    @property
    def turntables(self) -> tuple[RodTurntable, ...]:
        """Those of all arms, in the order of the arms."""
        return tuple(table for arm in self.arms for table in arm.turntables)

    @property
    def turns(self) -> bool:
        """Whether the plate can turn, as rods end beside the tool point."""
        return any(rod.plate_offset is not None for arm in self.arms for rod in arm.rods)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters."""
        names: list[str | None] = []
        for arm in self.arms:
            names += [arm.offset, arm.direction]
            for rod in arm.rods:
                names += [rod.length, rod.offset, rod.plate_offset]
            for table in arm.turntables:
                names += [table.offset, table.orientation, table.axis]
        return tuple(dict.fromkeys(name for name in names if name is not None))

    def check(self, model: str, known: Iterable[str]) -> None:
        """ModelError for a name that is none of the parameters and coordinates of the model."""
        names = set(known)
        for name in (*self.parameters, *self.joints):
            if name not in names:
                raise ModelError(
                    f"{model}.rods: found '{name}', expected the name of a parameter or a coordinate of "
                    f"{model}{did_you_mean(name, names)} Correct what rods() returns"
                )


def rods_of(model: Any) -> Rods | None:
    """What a model instance says of its rods; None of a model without a method `rods()`."""
    if not isinstance(inspect.getattr_static(type(model), "rods", None), FunctionType):
        return None
    found = model.rods()
    if isinstance(found, Rods):
        return found
    raise ModelError(
        f"{type(model).__name__}.rods: found {found!r}, expected a record of names; return Rods([RodArm(...), ...])"
    )
