"""The nominal geometry of a robot, read by the names of its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError, flatten
from gantrytau.compiler.parameters import parameter_table
from gantrytau.flattening.instantiation import instantiate


@dataclass(frozen=True)
class LinkGeometry:
    """A link: name, such as "arms[1].links[0]"; length, m; offset, joint on the cart at q = 0, (3,); plate_offset (3,)."""

    name: str
    length: float
    offset: np.ndarray
    plate_offset: np.ndarray


@dataclass(frozen=True)
class ArmGeometry:
    """A guideway with its links. base: what the model adds to the offsets of its links, (3,) in m."""

    direction: np.ndarray
    links: tuple[LinkGeometry, ...]
    base: np.ndarray


@dataclass(frozen=True)
class Geometry:
    """Arms of a robot. kind: "three" (one link on each, the plate keeps its orientation), "six" or "turning".

    values: parameters of arms and turntables by name.
    """

    robot: Model
    kind: Literal["three", "six", "turning"]
    arms: tuple[ArmGeometry, ...]
    turntables: int = 0
    values: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """Class of the robot."""
        return type(self.robot).__name__


def read_geometry(robot: Any) -> Geometry:
    """The geometry of a model instance with `arms[i].length`, `.offset`, `.direction`, or `arms[i].links[j]` of these.

    Raises ModelError for anything else.
    """
    if not isinstance(robot, Model):
        raise ModelError(
            f"calibrate: found {robot!r} as robot, expected a model instance such as GantryTau(prototypes.L1)"
        )
    values = _written(robot) or _values(robot)
    count = _count(values, "arms[{}].direction")
    three = "arms[0].length" in values
    if not count or not (three or "arms[0].links[0].length" in values):
        raise ModelError(
            f"calibrate: found {type(robot).__name__} without parameters arms[i].length, .offset and .direction, or "
            "arms[i].links[j] of these; expected a Gantry-Tau such as GantryTau(prototypes.L1)"
        )
    turntables = _count(values, "turntables[{}].axis")
    arms = tuple(_three_link_arm(values, i) if three else _arm(values, i) for i in range(count))
    return Geometry(robot, "three" if three else "turning" if turntables else "six", arms, turntables, values)


def _three_link_arm(values: dict[str, Any], i: int) -> ArmGeometry:
    name = f"arms[{i}]"
    link = LinkGeometry(name, float(values[f"{name}.length"]), values[f"{name}.offset"], np.zeros(3))
    return ArmGeometry(values[f"{name}.direction"], (link,), np.zeros(3))


def _arm(values: dict[str, Any], i: int) -> ArmGeometry:
    base = values.get(f"arms[{i}].offset", np.zeros(3))
    links = []
    for j in range(_count(values, f"arms[{i}].links[{{}}].length")):
        name = f"arms[{i}].links[{j}]"
        links.append(
            LinkGeometry(
                name,
                float(values[f"{name}.length"]),
                base + values[f"{name}.offset"],
                values[f"{name}.plate_offset"],
            )
        )
    return ArmGeometry(values[f"arms[{i}].direction"], tuple(links), base)


def _count(values: dict[str, Any], pattern: str) -> int:
    count = 0
    while pattern.format(count) in values:
        count += 1
    return count


def _written(robot: Model) -> dict[str, Any] | None:
    """The parameters of a three-link robot where its own modifications give them all as plain numbers.

    Nothing else can override these, so that nothing has to be instantiated; None for all other robots.
    """
    arms = robot.modifications.get("arms")
    if not isinstance(arms, list) or "turntables" in robot.modifications:
        return None
    found: dict[str, Any] = {}
    for i, arm in enumerate(arms):
        for name, shape in (("length", ()), ("offset", (3,)), ("direction", (3,))):
            value = arm.get(name) if isinstance(arm, Mapping) and "links" not in arm else None
            if not isinstance(value, (int, float, list, tuple, np.ndarray)) or np.shape(value) != shape:
                return None
            try:
                found[f"arms[{i}].{name}"] = np.array(value, dtype=float)
            except (TypeError, ValueError):
                return None
    return found


def _values(robot: Model) -> dict[str, Any]:
    """Numbers of the parameters of arms and turntables by name, vectors whole.

    Plain numbers are read as they are declared, five times as quick as flattening the whole model.
    """
    found: dict[str, Any] = {}
    for placed in instantiate(robot).quantities:
        if placed.name.startswith(("arms[", "turntables[")) and placed.declaration.kind == "parameter":
            leaf = placed.attributes.get("value")
            try:
                found[placed.name] = np.asarray(leaf.value, dtype=float) if leaf is not None else None
            except (TypeError, ValueError):
                found[placed.name] = None
    needed = ("length", "offset", "direction", "plate_offset", "axis")
    if all(found[n] is not None for n in found if n.rsplit(".", 1)[-1] in needed):
        return found
    flat = flatten(robot)
    table = parameter_table(flat)
    return {
        p.name: np.array([table.values[n] for n in p.elements]).reshape(p.shape, order="F")
        for p in flat.parameters
    }
