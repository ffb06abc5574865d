"""Geoms of an MJCF file: what is seen of a body, and its mass where it states none."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.mjcf_elements import Orientation, towards
from gantrytau.mechanics.robot_files.robot_description import Placement, Visual
from gantrytau.mechanics.robot_files.shape_inertia import (
    Lump,
    capsule,
    cuboid,
    cylinder,
    ellipsoid,
    joined,
    mesh_lump,
)
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders
from gantrytau.mechanics.robot_files.xml_file import XmlFile

SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
LUMPS: dict[str, Callable[[tuple[float, ...]], Lump]] = {
    "sphere": lambda size: ellipsoid(size * 3),
    "capsule": lambda size: capsule(*size),
    "cylinder": lambda size: cylinder(*size),
    "box": cuboid,
    "ellipsoid": ellipsoid,
}
FLAT = ("plane", "hfield", "sdf")  # without mass


@dataclass(frozen=True)
class Geoms:
    """always: whether masses are those of geoms even where <inertial> is; groups: those that count for masses; autolimits:
    whether a range is a limit unless it is denied.
    """

    xml: XmlFile
    folders: MeshFolders
    meshes: dict[str, Element]
    directory: str
    always: bool
    never: bool
    groups: tuple[float, ...]
    autolimits: bool
    left_out: list[str] = field(default_factory=list)

    @staticmethod
    def of(xml: XmlFile, folders: MeshFolders) -> "Geoms":
        """What <compiler> and <asset> say."""
        found = {key: value for part in xml.top.iterfind("compiler") for key, value in part.attrib.items()}
        meshes = {_mesh_name(part): part for part in xml.top.iterfind("asset/mesh")}
        inertia = found.get("inertiafromgeom", "auto")
        texts = ("balanceinertia", "boundmass", "boundinertia", "settotalmass")
        left = [f"mujoco/compiler: {key}" for key in texts if key in found]
        groups = tuple(map(float, found.get("inertiagrouprange", "0 5").split()))
        directory = found.get("meshdir", found.get("assetdir", ""))
        limits = found.get("autolimits", "true") == "true"
        return Geoms(
            xml, folders, meshes, directory, inertia == "true", inertia == "false", groups, limits, left
        )

    def lump(self, body: Element, orientation: Orientation) -> Lump | None:
        """Mass and inertia of a body by its geoms; None if they have none."""
        lumps = [] if self.never else list(self._lumps(body, orientation))
        return joined(lumps) if lumps else None

    def _lumps(self, body: Element, orientation: Orientation) -> Iterator[Lump]:
        xml = self.xml
        for part in body.iterfind("geom"):
            kind = self._kind(part)
            low, high = self.groups
            if kind in FLAT or not low <= xml.number(part, "group", 0.0) <= high:
                continue
            if part.get("shellinertia") == "true":
                raise xml.refusal(part, 'shellinertia="true"', "an <inertial> of its body")
            density, mass = xml.number(part, "density", 1000.0), part.get("mass")
            if (density if mass is None else xml.number(part, "mass")) == 0:
                continue
            if kind == "mesh":
                lump = self._mesh(part)
                place = orientation.placement(part)
            else:
                place, size = self._measures(part, kind, orientation)
                lump = LUMPS[kind](size)
            yield lump.times(density if mass is None else xml.number(part, "mass") / lump.m).placed(
                np.array(place.xyz), place.R
            )

    def visuals(self, body: Element, orientation: Orientation) -> tuple[Visual, ...]:
        """Geoms that a viewer draws."""
        return tuple(seen for part in body.iterfind("geom") if (seen := self._visual(part, orientation)))

    def _visual(self, part: Element, orientation: Orientation) -> Visual | None:
        kind = self._kind(part)
        if kind == "mesh":
            file, scale = self._file(part)
            return Visual("mesh", orientation.placement(part), scale, file)
        if kind in (*FLAT, "ellipsoid"):
            return None
        place, size = self._measures(part, kind, orientation)
        if kind == "box":
            return Visual("box", place, tuple(2 * x for x in size))
        return (
            Visual("sphere", place, size)
            if kind == "sphere"
            else Visual("cylinder", place, (size[0], 2 * size[1]))
        )

    def _kind(self, part: Element) -> str:
        return self.xml.known(part, "type", part.get("type", "sphere"), (*SIZES, *FLAT, "mesh"), "shape")

    def _measures(
        self, part: Element, kind: str, orientation: Orientation
    ) -> tuple[Placement, tuple[float, ...]]:
        """Where a geom stands, and half its lengths in m."""
        xml, ends = self.xml, part.get("fromto")
        words = xml.word(part, "size")
        count = SIZES[kind] if ends is None else 1
        size = xml.read_numbers(part, " ".join(words.split()[:count]), count, f'size="{words}"')
        if not min(size) > 0:
            raise xml.refusal(part, f'size="{words}"', "lengths above 0")
        if ends is None:
            return orientation.placement(part), size
        numbers = np.array(xml.numbers(part, "fromto", 6))
        way = numbers[3:] - numbers[:3]
        length = float(np.linalg.norm(way))
        if not length > 0 or kind == "sphere":
            raise xml.refusal(
                part, f'fromto="{ends}"', "two places, of a capsule, cylinder, box or ellipsoid"
            )
        whole = (*size, *size, length / 2) if SIZES[kind] == 3 else (*size, length / 2)
        return Placement.of((numbers[:3] + numbers[3:]) / 2, towards(way / length)), whole

    def _mesh(self, part: Element) -> Lump:
        name, scale = self._file(part)
        found = self.folders.find(name)
        if found is None:
            expected = "an STL, OBJ or PLY that is there, or an <inertial> of the body"
            raise self.xml.refusal(part, f"the mesh {name} without a file that can be read", expected)
        return mesh_lump(found, scale)

    def _file(self, part: Element) -> tuple[str, tuple[float, ...]]:
        """File and scale of the mesh of a geom."""
        name = self.xml.known(part, "mesh", self.xml.word(part, "mesh"), self.meshes, "mesh of <asset>")
        asset = self.meshes[name]
        for key in ("refpos", "refquat"):
            if asset.get(key) is not None:
                raise self.xml.refusal(asset, key, "a mesh without it; move the geom instead")
        file = os.path.join(self.directory, self.xml.word(asset, "file"))
        return file, self.xml.numbers(asset, "scale", 3, (1.0, 1.0, 1.0))


def _mesh_name(part: Element) -> str:
    return part.get("name") or os.path.splitext(os.path.basename(part.get("file", "")))[0]
