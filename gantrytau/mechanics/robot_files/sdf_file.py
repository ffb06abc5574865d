"""Content of an SDF file, Gazebo's own format: one model of links and joints, which may close loops.

http://sdformat.org/spec: a pose is seen from the frame that `relative_to` names, otherwise that of a link from the model and
that of a joint from its child link; all coordinates are zero where links stand as they are written.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.robot_description import (
    Coupling,
    Placement,
    RobotDescription,
    RobotJoint,
    RobotLink,
    Visual,
)
from gantrytau.mechanics.robot_files.shape_inertia import link_of, lump_of
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders
from gantrytau.mechanics.robot_files.xml_file import XmlFile

KINDS = {
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "ball": "spherical",
    "universal": "universal",
}
READ = {  # elements, and what is in them; all others are left out
    "model": "pose link joint frame static",
    "link": "pose inertial visual gravity self_collide kinematic",
    "joint": "pose parent child axis axis2",
}
MEASURES = {"box": ("size", 3), "sphere": ("radius", 1), "ellipsoid": ("radii", 3)}
TRUE = ("true", "1")
UNLIMITED = 1e15  # m or rad: SDF writes 1e16 where there is no limit


def read_sdf_file(file: str | os.PathLike[str], folders: MeshFolders) -> RobotDescription:
    """The robot of an SDF file. ModelError for a file that cannot be read, or holds no robot or several."""
    xml = XmlFile.read(file, "SDF", "sdf", "a <model>")
    models = [*xml.top.iterfind("model"), *xml.top.iterfind("world/model")]
    if len(models) != 1:
        raise xml.refusal(None, f"{len(models)} models", "one in a file of its own")
    model = models[0]
    for tag in ("include", "model"):
        if (part := model.find(tag)) is not None:
            raise xml.refusal(
                part, f"<{tag}> in a model", "links and joints; `gz sdf --print FILE` writes them out"
            )
    reader = _Reader(xml, model, folders)
    links = [reader.link(part) for part in model.iterfind("link")]
    joints = [reader.joint(part) for part in model.iterfind("joint")]
    xml.different("links", [link.name for link in links])
    xml.different("joints", [joint.name for joint in joints])
    if not links:
        raise xml.refusal(model, "no <link>", "one or more")
    static = reader.word(model, "static", "false") in TRUE
    joints = [] if static else joints
    bases, closed = _bases([link.name for link in links], joints)
    for base in bases:
        pose = reader.place @ reader.pose(base)
        joints.append(RobotJoint(f"{base}_base", "fixed" if static else "floating", "world", base, pose))
    gravity = xml.top.find("world/gravity")
    return RobotDescription(
        xml.file,
        model.get("name") or Path(file).stem,
        "world",
        (RobotLink("world"), *links),
        tuple(joints),
        closed=closed,
        gravity=None if gravity is None else xml.read_numbers(gravity, gravity.text or "", 3, "<gravity>"),
        left_out=tuple(reader.left_out()),
    )


def _bases(links: list[str], joints: list[RobotJoint]) -> tuple[list[str], bool]:
    """The first link of each group that no joint ties to the world, and whether joints close loops."""
    group = {name: name for name in ("world", *links)}
    closed = False
    for joint in joints:
        a, b = group[joint.parent], group[joint.child]
        closed = closed or a == b
        group = {name: a if one == b else one for name, one in group.items()}
    firsts = {group[name]: name for name in reversed(links) if group[name] != group["world"]}
    return list(firsts.values())[::-1], closed


@dataclass(frozen=True)
class _Reader:
    """Elements of a model as records."""

    xml: XmlFile
    model: Element
    folders: MeshFolders
    assumed: list[str] = field(default_factory=list)

    @property
    def place(self) -> Placement:
        """Where the model stands in the world."""
        return self._written(self.model)

    def part(self, at: Element, name: str) -> Element:
        """The link, joint or frame of a name."""
        parts = {
            part.get("name", ""): part
            for tag in ("link", "joint", "frame")
            for part in self.model.iterfind(tag)
        }
        return parts[self.xml.known(at, "the frame", name, parts, "link, joint or frame")]

    def pose(self, name: str, above: tuple[str, ...] = ()) -> Placement:
        """Pose of a link, joint or frame in the model."""
        if name in ("__model__", ""):
            return Placement()
        if name == "world":
            return self.place.inverse
        part = self.part(self.model, name)
        if name in above:
            raise self.xml.refusal(
                part, f"a pose relative to itself ({', '.join(above)})", "one that ends at the model"
            )
        pose, usual = part.find("pose"), part.get("attached_to", "")
        usual = self.word(part, "child") if part.tag == "joint" else usual
        reference = (None if pose is None else pose.get("relative_to")) or usual
        return self.pose(reference, (*above, name)) @ self._written(part)

    def body(self, at: Element, name: str, above: tuple[str, ...] = ()) -> str:
        """The link that a frame belongs to."""
        if name == "world":
            return name
        first = self.xml.one(self.model, "link").get("name", "")
        part = self.part(at, self.model.get("canonical_link", first) if name == "__model__" else name)
        if part.tag == "link" or name in above:
            return part.get("name", "")
        next_one = self.word(part, "child") if part.tag == "joint" else part.get("attached_to", "__model__")
        return self.body(part, next_one, (*above, name))

    def link(self, part: Element) -> RobotLink:
        xml, name = self.xml, self.xml.word(part, "name")
        visuals = tuple(seen for one in part.iterfind("visual") if (seen := self._shape(one)))
        inertial = part.find("inertial")
        if inertial is not None and inertial.get("auto") in TRUE:
            usual = self._number(inertial, "density", 1000.0)
            parts = {one: self._number(one, "density", usual) for one in part.iterfind("collision")}
            if not parts:
                raise xml.refusal(inertial, 'auto="true" without a <collision>', "one, or mass and inertia")
            lumps = [
                lump_of(xml, one, self._shape(one), self.folders).times(rho) for one, rho in parts.items()
            ]
            return link_of(name, lumps, visuals)
        if inertial is None:
            self.assumed.append(
                f"{xml.paths[part]}: without <inertial>, so 1 kg and 1 kg.m2 are taken as SDF says"
            )
            inertial = Element("inertial")
        m = self._number(inertial, "mass", 1.0)
        if not m > 0:
            raise xml.refusal(inertial, f"{m:g} kg", "a mass above 0")
        tensor = inertial.find("inertia")
        keys = (("ixx", 1.0), ("iyy", 1.0), ("izz", 1.0), ("ixy", 0.0), ("ixz", 0.0), ("iyz", 0.0))
        xx, yy, zz, xy, xz, yz = (
            usual if tensor is None else self._number(tensor, key, usual) for key, usual in keys
        )
        J = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        return RobotLink(name, m, J, self._written(inertial), visuals)

    def joint(self, part: Element) -> RobotJoint:
        xml, name = self.xml, self.xml.word(part, "name")
        kind = KINDS[xml.known(part, "type", xml.word(part, "type"), KINDS, "kind of joint")]
        words = [self.word(part, tag) for tag in ("parent", "child")]
        parent, child = (self.body(part, word) for word in words)
        if parent == child:
            raise xml.refusal(part, f"'{parent}' as both links", "two links")
        here = self.pose(name)
        joint = RobotJoint(
            name, kind, parent, child, self.pose(parent).inverse @ here, here.inverse @ self.pose(child)
        )
        if kind in ("fixed", "spherical"):
            return joint
        axis = self._axis(xml.one(part, "axis"), name, here)
        if kind == "universal":
            return replace(joint, axis=axis, axis_b=self._axis(xml.one(part, "axis2"), name, here))
        return replace(joint, axis=axis, **self._of_axis(xml.one(part, "axis"), kind))

    def _axis(self, part: Element, joint: str, here: Placement) -> tuple[float, ...]:
        """The direction of an axis, in the frame of its joint."""
        xyz, old = part.find("xyz"), self.word(part, "use_parent_model_frame", "0") in TRUE
        axis = (
            (0.0, 0.0, 1.0)
            if xyz is None
            else self.xml.read_numbers(xyz, xyz.text or "", 3, f"<xyz>{xyz.text}")
        )
        if not np.linalg.norm(axis) > 0:
            raise self.xml.refusal(xyz, "the axis 0 0 0", "a direction")
        frame = (None if xyz is None else xyz.get("expressed_in")) or ("__model__" if old else joint)
        return axis if frame == joint else tuple(map(float, here.R.T @ self.pose(frame).R @ axis))

    def _of_axis(self, part: Element, kind: str) -> dict:
        """What an axis says besides its direction."""
        limit, dynamics, mimic = part.find("limit"), part.find("dynamics"), part.find("mimic")
        found: dict = {}
        if limit is not None:
            low, high = (
                self._number(limit, key, usual) for key, usual in (("lower", -np.inf), ("upper", np.inf))
            )
            if low > high:
                raise self.xml.refusal(limit, f"{low:g} above {high:g}", "limits in their order")
            limited = kind != "continuous" and (abs(low) < UNLIMITED or abs(high) < UNLIMITED)
            found["limits"] = (low, high) if limited else None
            for key in ("effort", "velocity"):
                most = self._number(limit, key, -1.0)
                found[key] = most if 0 < most < UNLIMITED else None
        if dynamics is not None:
            keys = ("damping", "friction", "spring_stiffness", "spring_reference")
            values = (self._number(dynamics, key, 0.0) for key in keys)
            found |= zip(("damping", "friction", "stiffness", "rest"), values, strict=True)
        if mimic is not None:
            factor, offset, reference = (
                self._number(mimic, key, usual)
                for key, usual in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
            )
            other = self.xml.word(mimic, "joint")
            self.xml.known(
                mimic, "the joint", other, (j.get("name", "") for j in self.model.iterfind("joint")), "joint"
            )
            found["mimic"] = Coupling(other, factor, offset - factor * reference)
        return found

    def left_out(self) -> Iterator[str]:
        """Paths of the elements that nothing reads, and what was assumed."""
        yield from self.assumed
        for part in (self.model, *self.model.iterfind("link"), *self.model.iterfind("joint")):
            yield from (self.xml.paths[child] for child in part if child.tag not in READ[part.tag].split())

    def _shape(self, part: Element) -> Visual | None:
        """The geometry of a <visual> or <collision>; None for one without a volume."""
        shapes, place = list(part.iterfind("geometry/*")), self._written(part)
        if len(shapes) != 1:
            raise self.xml.refusal(part, f"{len(shapes)} shapes", "one")
        kind, shape = shapes[0].tag, shapes[0]
        if kind in ("cylinder", "capsule"):
            return Visual(kind, place, (self._number(shape, "radius"), self._number(shape, "length")))
        if kind == "mesh":
            scale = (1.0,) * 3 if shape.find("scale") is None else self._numbers(shape, "scale", 3)
            return Visual(kind, place, scale, self.word(shape, "uri"))
        return Visual(kind, place, self._numbers(shape, *MEASURES[kind])) if kind in MEASURES else None

    def _written(self, part: Element) -> Placement:
        """The numbers of the <pose> of an element."""
        pose = part.find("pose")
        words = [] if pose is None else (pose.text or "").split()
        if pose is None or not words:
            return Placement()
        if pose.get("rotation_format") == "quat_xyzw":
            x, y, z, qx, qy, qz, qw = self.xml.read_numbers(pose, pose.text or "", 7, f"<pose>{pose.text}")
            if not any((qx, qy, qz, qw)):
                raise self.xml.refusal(
                    pose,
                    f"the quaternion {qx:g} {qy:g} {qz:g} {qw:g}",
                    "one with a direction, 0 0 0 1 for none",
                )
            return Placement.of_quaternion((x, y, z), (qw, qx, qy, qz))
        numbers = self.xml.read_numbers(pose, pose.text or "", 6, f"<pose>{pose.text}")
        unit = np.pi / 180 if pose.get("degrees") in TRUE else 1.0
        return Placement(numbers[:3], tuple(unit * x for x in numbers[3:]))

    def word(self, part: Element, tag: str, otherwise: str | None = None) -> str:
        """The text of an element in another."""
        found = part.find(tag)
        text = "" if found is None else (found.text or "").strip()
        if not text and otherwise is None:
            raise self.xml.refusal(part, f"no <{tag}>", "one with a text")
        return text or otherwise or ""

    def _number(self, part: Element, tag: str, otherwise: float | None = None) -> float:
        if otherwise is not None and part.find(tag) is None:
            return otherwise
        return self._numbers(part, tag, 1, finite=otherwise is None or np.isfinite(otherwise))[0]

    def _numbers(self, part: Element, tag: str, count: int, finite: bool = True) -> tuple[float, ...]:
        text = self.word(part, tag)
        return self.xml.read_numbers(self.xml.one(part, tag), text, count, f"<{tag}>{text}", finite)
