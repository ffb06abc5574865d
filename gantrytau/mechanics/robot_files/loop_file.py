"""Additions to a URDF file: how loops are closed, which joints are driven, where the joints start."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.schema import read_toml
from gantrytau.mechanics.robot_files.robot_description import (
    LOOP_KINDS,
    LoopJoint,
    Placement,
    RobotDescription,
)

KEYS = ("name", "kind", "link_a", "origin_a", "link_b", "origin_b", "axis", "axis_b")


@dataclass(frozen=True)
class Closure:
    """Loops, joints that are driven (None: whatever the URDF file says), and starts of joints, m or rad."""

    loops: tuple[LoopJoint, ...] = ()
    driven: tuple[str, ...] | None = None
    start: tuple[tuple[str, float], ...] = ()


def read_closure(loops: str | os.PathLike[str] | Mapping[str, Any] | None, tree: RobotDescription) -> Closure:
    """The loop file of a tree, or the same as a dict; ModelError for what is no such thing."""
    if loops is None:
        return Closure()
    if isinstance(loops, Mapping):
        reader, content = _LoopReader("loops", tree), dict(loops)
    elif isinstance(loops, (str, os.PathLike)):
        reader = _LoopReader(str(loops), tree)
        content = read_toml(Path(loops))
    else:
        raise ModelError(
            f"loops: found {type(loops).__name__}, expected a TOML file, or its content as a dict",
            argument="loops",
        )
    reader.keys(content, ("loop", "driven", "start"), "the file")
    joints = tuple(reader.loop(entry, k) for k, entry in enumerate(reader.tables(content.get("loop", []))))
    names = [joint.name for joint in joints]
    if twice := {name for name in names if names.count(name) > 1}:
        raise reader.refusal(f"two loops of the name '{min(twice)}'", "different names")
    return Closure(joints, reader.driven(content.get("driven")), reader.start(content.get("start", {})))


@dataclass(frozen=True)
class _LoopReader:
    file: str
    tree: RobotDescription

    def loop(self, entry: Mapping[str, Any], k: int) -> LoopJoint:
        where = f"loop[{k}]"
        self.keys(entry, KEYS, where)
        name = entry.get("name", f"loop_{k + 1}")
        if not isinstance(name, str) or not name.isidentifier():
            raise self.refusal(f"{where}.name = {name!r}", "a name of letters, digits and underscores")
        kind = entry.get("kind", "spherical")
        self._one_of(kind, LOOP_KINDS, f"{where}.kind")
        links = [link.name for link in self.tree.links]
        for key in ("link_a", "link_b"):
            if key not in entry:
                raise self.refusal(f"{where} without {key}", "the names of the links that it joins")
            self._one_of(entry[key], links, f"{where}.{key}")
        if entry["link_a"] == entry["link_b"]:
            raise self.refusal(f"{where} from {entry['link_a']} to itself", "two links")
        axis, axis_b = (self._direction(entry.get(key, usual), f"{where}.{key}") for key, usual in AXES)
        origin_a, origin_b = (
            self._origin(entry.get(key, {}), f"{where}.{key}") for key in ("origin_a", "origin_b")
        )
        return LoopJoint(name, kind, entry["link_a"], entry["link_b"], origin_a, origin_b, axis, axis_b)

    def driven(self, names: Any) -> tuple[str, ...] | None:
        if names is None:
            return None
        if not isinstance(names, (list, tuple)):
            raise self.refusal(f"driven = {names!r}", 'a list of joints, driven = ["q1", "q2"]')
        for name in names:
            self._one_of(name, self.tree.moving, "driven")
        return tuple(names)

    def start(self, values: Any) -> tuple[tuple[str, float], ...]:
        if not isinstance(values, Mapping):
            raise self.refusal(f"start = {values!r}", "a table of joints and their coordinates in m and rad")
        for name, value in values.items():
            self._one_of(name, self.tree.moving, "start")
            self._numbers([value], 1, f"start.{name}")
        return tuple((name, float(value)) for name, value in values.items())

    def tables(self, entries: Any) -> list[Mapping[str, Any]]:
        if not isinstance(entries, (list, tuple)) or not all(isinstance(x, Mapping) for x in entries):
            raise self.refusal(f"loop = {entries!r}", "tables, each under [[loop]]")
        return list(entries)

    def keys(self, content: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
        for key in content:
            if key not in known:
                raise self.refusal(f"'{key}' in {where}", f"{', '.join(known)}{did_you_mean(key, known)}")

    def _origin(self, value: Any, where: str) -> Placement:
        if not isinstance(value, Mapping):
            raise self.refusal(f"{where} = {value!r}", "{ xyz = [x, y, z], rpy = [r, p, y] }")
        self.keys(value, ("xyz", "rpy"), where)
        xyz, rpy = (self._numbers(value.get(key, [0.0] * 3), 3, f"{where}.{key}") for key in ("xyz", "rpy"))
        return Placement(xyz, rpy)

    def _direction(self, value: Any, where: str) -> tuple[float, ...]:
        found = self._numbers(value, 3, where)
        if not np.linalg.norm(found) > 0:
            raise self.refusal(f"{where} = {list(found)}", "a direction")
        return found

    def _numbers(self, value: Any, count: int, where: str) -> tuple[float, ...]:
        good = isinstance(value, (list, tuple)) and len(value) == count
        if not good or not all(isinstance(x, (int, float)) and np.isfinite(x) for x in value):
            raise self.refusal(f"{where} = {value!r}", f"{count} finite number{'s' if count > 1 else ''}")
        return tuple(float(x) for x in value)

    def _one_of(self, name: Any, names: Any, where: str) -> None:
        if name not in names:
            raise self.refusal(f"{where} = {name!r}", f"one that is there{did_you_mean(str(name), names)}")

    def refusal(self, found: str, expected: str) -> ModelError:
        return ModelError(f"{self.file}: found {found}, expected {expected}", argument="loops")


AXES = (("axis", (0.0, 0.0, 1.0)), ("axis_b", (0.0, 1.0, 0.0)))  # unless given
