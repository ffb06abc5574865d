"""The nominal links of a robot: joints and lengths by the names in its model, with the values of its parameters."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gantrytau import Model, ModelError, flatten
from gantrytau.border import Given
from gantrytau.compiler.parameters import parameter_table
from gantrytau.describing.record import Record
from gantrytau.flattening.instantiation import instantiate
from gantrytau.language.self_description.rods import RodArm, Rods, SingleRod, rods_of

_PARTS = re.compile(r"(\w+)|\[(\d+)\]")


@dataclass(frozen=True)
class NominalRods(Record):
    """A robot, what it says of its rods, and the values of their parameters by name, numbers and vectors."""

    robot: Model
    rods: Rods
    values: Mapping[str, np.ndarray] = field(repr=False)

    @property
    def name(self) -> str:
        """Class of the robot."""
        return type(self.robot).__name__

    @property
    def arms(self) -> Sequence[RodArm]:
        """Its arms, by name."""
        return self.rods.arms

    @property
    def turns(self) -> bool:
        """Whether its plate can turn."""
        return self.rods.turns

    @property
    def turntables(self) -> int:
        """How many turntables there are."""
        return len(self.rods.turntables)

    def vector(self, name: str | None) -> np.ndarray:
        """A vector, zero where there is none."""
        return np.zeros(3) if name is None else self.values[name]

    def base(self, arm: RodArm) -> np.ndarray:
        """Offset of an arm, added to the joints of its rods on the cart, (3,) in m."""
        return self.vector(arm.offset) if arm.rods[0].offset is not None else np.zeros(3)

    def joint(self, arm: RodArm, rod: SingleRod) -> np.ndarray:
        """The joint of a rod on its cart at q = 0, (3,) in m; of arms without turntables."""
        return self.vector(arm.offset) + self.vector(rod.offset)


def read_nominal(robot: Any) -> NominalRods:
    """The nominal rods of a model instance; ModelError for what is none, or says nothing of rods."""
    if not isinstance(robot, Model):
        raise ModelError(
            f"found {robot!r} as robot, expected a model instance such as GantryTau(prototypes.L1)",
            place="calibrate",
        )
    rods = rods_of(robot)
    if rods is None or not rods.arms:
        raise ModelError(
            f"found {type(robot).__name__} that does not say what its rods are, expected a robot such as "
            "GantryTau(prototypes.L1); name what is to be found, ",
            Given("parameters", ["upper.r"]),
            ", of any other robot, or give the model a method rods() that returns Rods([RodArm(...), ...])",
            place="calibrate",
        )
    values = _written(robot, rods.parameters) or _declared(robot, rods) or _flattened(robot, rods)
    return NominalRods(robot, rods, values)


def _written(robot: Model, names: Iterable[str]) -> dict[str, np.ndarray] | None:
    """The parameters where the robot's own modifications give them all as plain numbers.

    Nothing else can override these, so that nothing has to be instantiated; None for all other robots.
    """
    found: dict[str, np.ndarray] = {}
    for name in names:
        value: Any = robot.modifications
        for key, index in _PARTS.findall(name):
            if key and isinstance(value, Mapping):
                value = value.get(key)
            elif index and isinstance(value, list) and int(index) < len(value):
                value = value[int(index)]
            else:
                return None
        number = _plain(value)
        if number is None:
            return None
        found[name] = number
    return found


def _plain(value: Any) -> np.ndarray | None:
    if not isinstance(value, (int, float, list, tuple, np.ndarray)):
        return None
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        return None


def _declared(robot: Model, rods: Rods) -> dict[str, np.ndarray] | None:
    """Plain numbers as they are declared, five times as quick as flattening the whole model; None for formulas."""
    wanted, found = set(rods.parameters), {}
    for placed in instantiate(robot).quantities:
        if placed.name in wanted:
            leaf = placed.attributes.get("value")
            value = None if leaf is None else _plain(leaf.value)
            if value is None:
                return None
            found[placed.name] = value
    return found if len(found) == len(wanted) else None


def _flattened(robot: Model, rods: Rods) -> dict[str, np.ndarray]:
    flat = flatten(robot)
    numbers = parameter_table(flat).values
    known = {p.name: p for p in flat.parameters}
    rods.check(type(robot).__name__, [*known, *(v.name for v in flat.variables), *rods.joints])
    return {
        name: np.array([numbers[n] for n in known[name].elements]).reshape(known[name].shape, order="F")
        for name in rods.parameters
    }


def with_numbers(robot: Model, values: Mapping[str, Any]) -> Model:
    """The robot with other numbers for parameters by name, such as `arms[0].links[1].length`."""
    return robot.modified(modifications_of(robot, values))


def modifications_of(robot: Model, values: Mapping[str, Any]) -> Any:
    """Numbers by name as nested modifications of the robot."""
    tree: dict[Any, Any] = {}
    for name, value in values.items():
        *way, last = [key or int(index) for key, index in _PARTS.findall(name)]
        branch = tree
        for part in way:
            branch = branch.setdefault(part, {})
        branch[last] = float(value) if np.ndim(value) == 0 else [float(x) for x in value]
    return _as_modifications(tree, robot.modifications)


def _as_modifications(tree: Any, old: Any) -> Any:
    """Nested modifications; what has numbers for keys becomes a list, as long as what was there."""
    if not isinstance(tree, dict):
        return tree
    if tree and all(isinstance(key, int) for key in tree):
        length = max(len(old) if isinstance(old, list) else 0, 1 + max(tree))
        items = [old[k] if isinstance(old, list) and k < len(old) else None for k in range(length)]
        return [_as_modifications(tree.get(k, {}), items[k]) for k in range(length)]
    inner = old if isinstance(old, Mapping) else {}
    return {key: _as_modifications(value, inner.get(key)) for key, value in tree.items()}
