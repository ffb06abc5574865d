"""Geoms of an MJCF file: what is seen of a body, and its mass where it states none."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.mjcf_elements import Orientation, towards
from gantrytau.mechanics.robot_files.robot_description import Placement, Visual
from gantrytau.mechanics.robot_files.shape_inertia import Lump, lump_of
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders
from gantrytau.mechanics.robot_files.xml_file import XmlFile

SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
FLAT = ("plane", "hfield", "sdf")  # without mass


@dataclass(frozen=True)
class Geoms:
    """The geoms of a file; settings: attributes of <compiler>."""

    xml: XmlFile
    orientation: Orientation
    folders: MeshFolders
    settings: dict[str, str]

    @cached_property
    def meshes(self) -> dict[str, Element]:
        """The meshes of <asset> by their names, which are those of their files unless stated."""
        parts = self.xml.top.iterfind("asset/mesh")
        return {p.get("name") or os.path.splitext(os.path.basename(p.get("file", "")))[0]: p for p in parts}

    def lumps(self, body: Element) -> Iterator[Lump]:
        """Those geoms of a body that have a mass."""
        xml = self.xml
        words = self.settings.get("inertiagrouprange", "0 5")
        low, high = xml.read_numbers(xml.top, words, 2, f'inertiagrouprange="{words}"')
        for part in body.iterfind("geom"):
            mass = None if part.get("mass") is None else xml.number(part, "mass")
            density = xml.number(part, "density", 1000.0)
            shape = self.shape(part)
            grouped = low <= xml.number(part, "group", 0.0) <= high
            if shape is None or not grouped or (density if mass is None else mass) == 0:
                continue
            if part.get("shellinertia") == "true":
                raise xml.refusal(part, 'shellinertia="true"', "an <inertial> of its body")
            lump = lump_of(xml, part, shape, self.folders)
            yield lump.times(density if mass is None else mass / lump.m)

    def shape(self, part: Element) -> Visual | None:
        """The shape of a geom; None for one without a volume."""
        xml, ends = self.xml, part.get("fromto")
        kind = xml.known(part, "type", part.get("type", "sphere"), (*SIZES, *FLAT, "mesh"), "shape")
        if kind in FLAT:
            return None
        place = self.orientation.placement(part)
        if kind == "mesh":
            return self._mesh(part, place)
        words = xml.word(part, "size")
        count = SIZES[kind] if ends is None else 1
        half = xml.read_numbers(part, " ".join(words.split()[:count]), count, f'size="{words}"')
        if not min(half) > 0:
            raise xml.refusal(part, f'size="{words}"', "lengths above 0")
        if ends is not None:
            numbers = np.array(xml.numbers(part, "fromto", 6))
            way = numbers[3:] - numbers[:3]
            length = float(np.linalg.norm(way))
            if not length > 0 or kind == "sphere":
                raise xml.refusal(part, f'fromto="{ends}"', "two places, of a geom that is no sphere")
            half = half * (SIZES[kind] - 1) + (length / 2,)
            place = Placement.of((numbers[:3] + numbers[3:]) / 2, towards(way / length))
        if kind == "box":
            return Visual(kind, place, tuple(2 * x for x in half))
        return Visual(kind, place, (half[0], 2 * half[1]) if SIZES[kind] == 2 else half)

    def _mesh(self, part: Element, place: Placement) -> Visual:
        name = self.xml.known(part, "mesh", self.xml.word(part, "mesh"), self.meshes, "mesh of <asset>")
        asset = self.meshes[name]
        for key in ("refpos", "refquat"):
            if asset.get(key) is not None:
                raise self.xml.refusal(asset, key, "a mesh without it; move the geom instead")
        folder = self.settings.get("meshdir", self.settings.get("assetdir", ""))
        file = os.path.join(folder, self.xml.word(asset, "file"))
        return Visual("mesh", place, self.xml.numbers(asset, "scale", 3, (1.0, 1.0, 1.0)), file)
