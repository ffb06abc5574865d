"""<visual>s of links as shapes, and where their meshes are."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gantrytau.language.self_description.appearance import Ball, Cuboid, MeshFile, RoundBar, Shape
from gantrytau.mechanics.robot_files.robot_description import RobotLink, Visual

READABLE = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off")  # what a viewer reads without further packages
PACKAGES, FILE = ("package", "model"), "file://"


@dataclass(frozen=True)
class MeshFolders:
    """Search path for the meshes of a file. packages: folders by the names of packages."""

    file: str
    packages: Mapping[str, str | os.PathLike[str]]

    def find(self, name: str) -> Path | None:
        """The file of a mesh; None if there is none, or none that can be read."""
        found = next((path for path in self._candidates(name) if path.is_file()), None)
        return found if found is not None and found.suffix.lower() in READABLE else None

    def _candidates(self, name: str) -> Iterator[Path]:
        above = Path(self.file).resolve().parents
        scheme, _, path = name.partition("://")
        if scheme not in PACKAGES:
            yield above[0] / name.removeprefix(FILE)
            return
        package, _, rest = path.partition("/")
        if package in self.packages:
            yield Path(self.packages[package]) / rest
        for folder in above:  # a file usually stands in the package, or beside it
            if folder.name == package:
                yield folder / rest
            yield folder / package / rest


def missing_meshes(links: Iterable[RobotLink], folders: MeshFolders) -> Iterator[str]:
    """What is not drawn, as its file cannot be found or read."""
    for link in links:
        for visual in link.visuals:
            if visual.file and folders.find(visual.file) is None:
                yield f"link {link.name}: mesh {visual.file}, not found or of another format"


def shapes_of_link(link: RobotLink, folders: MeshFolders) -> tuple[Shape, ...]:
    """Shapes of a link; none without <visual>, or where no mesh is found."""
    found = (_shape(visual, folders) for visual in link.visuals)
    return tuple(shape for shape in found if shape is not None)


def _shape(visual: Visual, folders: MeshFolders) -> Shape | None:
    where: dict[str, Any] = dict(at="frame_a.r", R="frame_a.R", offset=visual.placement.xyz)
    turned = dict(where, turn=visual.placement.R)
    if visual.kind == "box":
        return Cuboid(size=visual.size, **turned)
    if visual.kind in ("cylinder", "capsule"):
        return RoundBar(radius=visual.size[0], length=visual.size[1], **turned)
    if visual.kind == "sphere":
        return Ball(radius=visual.size[0], **where)
    if visual.kind == "ellipsoid":
        return None
    file = folders.find(visual.file)
    return None if file is None else MeshFile(file=str(file), scale=visual.size, **turned)
