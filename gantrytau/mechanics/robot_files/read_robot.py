"""`read_urdf`, `read_mjcf`, `read_sdf`: robots from files as classes of components."""

import os
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gantrytau import DoubtfulResult, InitializationError, ModelError, StructureError, translate
from gantrytau.mechanics.robot_files.loop_file import read_closure
from gantrytau.mechanics.robot_files.mjcf_file import read_mjcf_file
from gantrytau.mechanics.robot_files.robot_class import DescribedRobot, robot_class
from gantrytau.mechanics.robot_files.robot_description import RobotDescription
from gantrytau.mechanics.robot_files.sdf_file import read_sdf_file
from gantrytau.mechanics.robot_files.urdf_file import read_urdf_file
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders, missing_meshes

File = str | os.PathLike[str]
Folders = Mapping[str, File] | None
Names = list[str] | tuple[str, ...] | None


def read_urdf(
    file: File,
    loops: File | Mapping[str, Any] | None = None,
    *,
    packages: Folders = None,
    driven: Names = None,
) -> type[DescribedRobot]:
    """The robot of a URDF file as a class: `Arm = read_urdf("arm.urdf")`, `simulate(Arm(), stop=1.0)`.

    Links are components of their names with `r`, `v`, `w`, and `m`, `r_cm`, `J` where they have a mass; joints have `phi`,
    `w`, `tau` or `s`, `v`, `f`, with the limits of the file; `Arm.names` has both where a name had to be changed. A joint q
    that is driven has the input `q_drive.tau`, or `.f`, and `q_friction` if the file says <dynamics>; `placement` puts the
    base anywhere, `Arm(placement=dict(xyz=[0, 0, 1]))`. The base link stands in the world.

    loops: what closes the tree besides <constraint>s, a TOML file or its content, see `gantrytau/mechanics/README.md`;
    packages: folders of what is written `package://name/`; driven: names of joints, else those of the loop file, of
    <transmission>, or all that move and follow no other. Meshes that are not found, or not STL, OBJ, PLY, GLB, are not
    drawn; `Arm.left_out` has the paths of what is not read, such as <collision>. Raises ModelError for files that are no
    URDF, no tree, or miss numbers. https://wiki.ros.org/urdf/XML
    """
    robot = read_urdf_file(file)
    closure = read_closure(loops, robot)
    robot = robot.completed(closure.loops, closure.driven, dict(closure.start))
    return _made(robot, packages, driven, "read_urdf")


def read_mjcf(file: File, *, packages: Folders = None, driven: Names = None) -> type[DescribedRobot]:
    """The robot of an MJCF file, MuJoCo's own, as a class: `Arm = read_mjcf("arm.xml")`.

    Bodies and sites are the links of `read_urdf`, all else is as there. Loops are those of <equality>: connect is a ball
    joint, weld holds two bodies together, joint is a gear without loss. A rotor of `armature` is `q_rotor`, a spring
    `q_spring`. `Arm.sensors` has the variables of sensors by their names, `Arm.left_out` what the model has not: contacts,
    tendons, laws of actuators, looks.

    packages: folders of what is written `package://name/`; driven: names of joints, else those of <actuator>, or all that
    move and follow no other. Inertias of bodies without <inertial> are those of their geoms. Constraints are exact here, not
    soft. Raises ModelError for what is no MJCF. https://mujoco.readthedocs.io/en/stable/XMLreference.html
    """
    folders = MeshFolders(os.fspath(file), packages or {})
    return _made(read_mjcf_file(file, folders), packages, driven, "read_mjcf")


def read_sdf(file: File, *, packages: Folders = None, driven: Names = None) -> type[DescribedRobot]:
    """The robot of an SDF file, Gazebo's own, as a class: `Arm = read_sdf("arm.sdf")`.

    All is as with `read_urdf`; joints may close loops, a ball joint is `Spherical`, what no joint ties to the world moves
    freely. `Arm.left_out` has the paths of what the model has not, such as sensors and plugins.

    packages: folders of what is written `model://name/` or `package://name/`; driven: names of joints, else all that move
    and follow no other. Raises ModelError for what is no SDF, or holds several models. http://sdformat.org/spec
    """
    folders = MeshFolders(os.fspath(file), packages or {})
    return _made(read_sdf_file(file, folders), packages, driven, "read_sdf")


def _made(robot: RobotDescription, packages: Folders, driven: Names, reader: str) -> type[DescribedRobot]:
    """The class of a robot; its drives are those that are asked for."""
    for name, folder in (packages or {}).items():
        if not os.path.isdir(folder):
            raise ModelError(
                f"{reader}: found no folder {os.fspath(folder)} for the package {name}, expected one that is there",
                argument="packages",
            )
    if driven is not None:
        if isinstance(driven, str) or not set(driven) <= set(robot.moving):
            raise ModelError(
                f"{reader}: found driven={driven!r}, expected a list of joints that move, of {', '.join(robot.moving)}",
                argument="driven",
            )
        robot = replace(robot, driven=tuple(driven))
    folders = MeshFolders(robot.file, packages or {})
    lost = missing_meshes(robot.links, folders)
    robot = replace(robot, left_out=(*robot.left_out, *lost))
    return robot_class(_as_meant(robot, folders) if robot.loops or robot.closed else robot, folders)


def _as_meant(robot: RobotDescription, folders: MeshFolders) -> RobotDescription:
    """The robot, or, where its loops stay open by angles such as 3.1416, with the quarter turns that these stand for."""
    meant = robot.meant
    pairs = (*zip(robot.joints, meant.joints, strict=True), *zip(robot.loops, meant.loops, strict=True))
    names = [one.name for one, other in pairs if one != other]
    if not names or _closes(robot, folders) or not _closes(meant, folders):
        return robot
    warnings.warn(
        f"{robot.file}: the loops of {robot.name} stay open with the angles of {', '.join(names)} as they are written, and "
        "close with quarter turns, which are taken; write these with all digits, 1.5707963267948966, 3.141592653589793",
        DoubtfulResult,
        stacklevel=4,
    )
    return meant


def _closes(robot: RobotDescription, folders: MeshFolders) -> bool:
    """Whether the robot can be assembled."""
    try:
        translate(robot_class(robot, folders)())
    except (StructureError, InitializationError):
        return False
    return True
