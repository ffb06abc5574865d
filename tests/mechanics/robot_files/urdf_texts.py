"""Small URDF files, written for tests."""

from pathlib import Path
from typing import Any

from gantrytau.mechanics.robot_files import DescribedRobot, read_urdf


def written(folder: Path, body: str, name: str = "robot") -> Path:
    """A URDF file with that content."""
    file = folder / "robot.urdf"
    file.write_text(f'<?xml version="1.0"?>\n<robot name="{name}">{body}</robot>\n')
    return file


def link(name: str, m: float = 1.0, inside: str = "") -> str:
    return (
        f'<link name="{name}"><inertial><mass value="{m}"/><inertia ixx=".1" iyy=".1" izz=".1"/></inertial>'
        f"{inside}</link>"
    )


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'
    )


def read(folder: Path, body: str, **keywords: Any) -> type[DescribedRobot]:
    return read_urdf(written(folder, body), **keywords)
