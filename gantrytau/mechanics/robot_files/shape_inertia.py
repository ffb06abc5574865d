"""Mass, centre and inertia of shapes, of bodies that state their shapes only."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.mechanics.robot_files.robot_description import Placement, RobotLink, Visual
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders
from gantrytau.mechanics.robot_files.xml_file import XmlFile


@dataclass(frozen=True)
class Lump:
    """m: kg; r: (3,), its centre; J: (3, 3) about its centre, both in the frame of a link."""

    m: float
    r: np.ndarray
    J: np.ndarray

    def times(self, factor: float) -> "Lump":
        """The same shape of another density."""
        return Lump(self.m * factor, self.r, self.J * factor)


def link_of(name: str, lumps: list[Lump], visuals: tuple[Visual, ...]) -> RobotLink:
    """A link of shapes that are joined rigidly."""
    m = sum(lump.m for lump in lumps)
    centre = sum((lump.m * lump.r for lump in lumps), np.zeros(3)) / m
    J = np.zeros((3, 3))
    for lump in lumps:
        arm = lump.r - centre
        J += lump.J + lump.m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return RobotLink(name, m, tuple(map(tuple, J.tolist())), Placement(tuple(centre.tolist())), visuals)


def lump_of(xml: XmlFile, part: Element, shape: Visual | None, folders: MeshFolders) -> Lump:
    """The shape that an element states, of the density 1 kg/m3."""
    if shape is None:
        raise xml.refusal(part, "a shape without a volume", "mass and inertia of the link")
    size, radius = shape.size, shape.size[0]
    match shape.kind:
        case "box":
            lump = _of_axes(math.prod(size), np.divide(size, 2), 3)
        case "ellipsoid":
            lump = _of_axes(4 / 3 * math.pi * math.prod(size), size, 5)
        case "sphere":
            lump = _of_axes(4 / 3 * math.pi * radius**3, size * 3, 5)
        case "cylinder" | "capsule":
            lump = _round(radius, size[1], shape.kind == "capsule")
        case _:
            file = folders.find(shape.file)
            if file is None:
                found = f"the mesh {shape.file} without a file that can be read"
                raise xml.refusal(part, found, "STL, OBJ or PLY; or mass and inertia of the link")
            lump = _mesh(file, size)
    R = shape.placement.R
    return Lump(lump.m, shape.placement.xyz + R @ lump.r, R @ lump.J @ R.T)


def _of_axes(m: float, half: Any, divisor: int) -> Lump:
    """A cuboid or an ellipsoid by half its lengths."""
    x, y, z = np.square(half)
    return Lump(m, np.zeros(3), np.diag([y + z, x + z, x + y]) * m / divisor)


def _round(radius: float, length: float, capped: bool) -> Lump:
    """A cylinder along z, with a half of a ball on each end if it is capped."""
    m, ball = math.pi * radius**2 * length, 4 / 3 * math.pi * radius**3 * capped
    # a half of a ball has its centre 3/8 of the radius above its base
    aside = ball * (length**2 / 4 + 3 / 8 * length * radius + 2 / 5 * radius**2)
    across = m * (radius**2 / 4 + length**2 / 12) + aside
    along = m * radius**2 / 2 + 2 / 5 * ball * radius**2
    return Lump(m + ball, np.zeros(3), np.diag([across, across, along]))


def _mesh(file: Path, scale: tuple[float, ...]) -> Lump:
    """A closed mesh by the integrals of trimesh; scale: m for a unit of the file, along its axes."""
    try:
        import trimesh
    except ImportError:
        found, expected = "no trimesh, which integrates meshes", "it installed; pip install 'gantrytau[view]'"
        raise ModelError(f"{file}: found {found}, expected {expected}", argument="file") from None
    try:
        mesh = trimesh.load_mesh(str(file))
        mesh.apply_transform(np.diag([*scale, 1.0]))
        closed = mesh.is_watertight and mesh.volume > 0
    except Exception as error:  # each format has a reader of its own, with errors of its own
        raise ModelError(
            f"{file}: found no mesh ({error}), expected STL, OBJ or PLY", argument="file"
        ) from None
    if not closed:
        found, expected = "a mesh that is not closed", "one with a volume; or mass and inertia of its link"
        raise ModelError(f"{file}: found {found}, expected {expected}", argument="file")
    return Lump(float(mesh.volume), np.array(mesh.center_mass), np.array(mesh.moment_inertia))
