"""Content of a URDF file: links and joints of a tree, and the <constraint>s that close its loops.

https://wiki.ros.org/urdf/XML: what belongs to a joint is resolved in the frame of its parent link, and its axis in its own
frame, which is that of its child link. <constraint> as proposed to ROS, https://github.com/ros/urdfdom/pull/264.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.robot_description import (
    LOOP_KINDS,
    NOWHERE,
    Coupling,
    LoopJoint,
    Placement,
    RobotDescription,
    RobotJoint,
    RobotLink,
    Visual,
)
from gantrytau.mechanics.robot_files.xml_file import XmlFile

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
READ = {  # elements, and what is in them; all others are left out
    "robot": ("link", "joint", "constraint", "transmission", "material"),
    "link": ("inertial", "visual"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"),
}


def read_urdf_file(file: str | os.PathLike[str]) -> RobotDescription:
    """The robot of a URDF file. ModelError for a file that cannot be read, or describes no tree of links."""
    xml = XmlFile.read(file, "URDF", "robot", "links and joints")
    reader = _Reader(xml)
    top = xml.top
    links = [reader.link(part) for part in top.iterfind("link")]
    parts = {xml.word(part, "name"): part for part in top.iterfind("joint")}
    joints = [reader.joint(part) for part in top.iterfind("joint")]
    xml.different("links", [link.name for link in links])
    xml.different("joints", [joint.name for joint in joints])
    root, order = _ordered(xml, [link.name for link in links], joints, parts)
    for joint in joints:
        if joint.mimic is not None:
            part = xml.one(parts[joint.name], "mimic")
            xml.known(part, f"joint '{joint.name}' mimics", joint.mimic.other or "", parts, "joint")
    driven = {xml.word(part, "name"): part for part in top.iterfind("transmission/joint")}
    for name, part in driven.items():
        xml.known(part, "a drive of", name, parts, "joint")
    loops = tuple(reader.loop(part, [link.name for link in links]) for part in top.iterfind("constraint"))
    xml.different("constraints", [loop.name for loop in loops])
    return RobotDescription(
        xml.file,
        top.get("name") or Path(file).stem,
        root,
        tuple(links),
        tuple(order),
        tuple(name for name in driven if name in [joint.name for joint in joints if joint.moves]) or None,
        loops,
        bool(loops),
        left_out=tuple(reader.left_out()),
    )


@dataclass(frozen=True)
class _Reader:
    """Elements of a file as records."""

    xml: XmlFile

    def link(self, part: Element) -> RobotLink:
        xml, name = self.xml, self.xml.word(part, "name")
        visuals = tuple(self._visual(seen) for seen in part.iterfind("visual"))
        inertial = part.find("inertial")
        if inertial is None:
            return RobotLink(name, visuals=visuals)
        mass = xml.one(inertial, "mass")
        m = xml.number(mass, "value")
        if m < 0:
            raise xml.refusal(mass, f"{m:g} kg", "none below 0")
        tensor = inertial.find("inertia")
        ixx, ixy, ixz, iyy, iyz, izz = (
            xml.number(tensor, key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        J = ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz))
        if m == 0 and np.any(J):
            raise xml.refusal(inertial, "an inertia and no mass", "a mass above 0, or neither of them")
        return RobotLink(name, m, J, self._placement(inertial), visuals)

    def joint(self, part: Element) -> RobotJoint:
        xml = self.xml
        name, kind = xml.word(part, "name"), xml.word(part, "type")
        xml.known(part, "type", kind, KINDS, "kind of joint")
        limit, dynamics, mimic = part.find("limit"), part.find("dynamics"), part.find("mimic")
        axis = self._axis(part, "axis", kind not in ("fixed", "floating"), (1.0, 0.0, 0.0))
        return RobotJoint(
            name,
            kind,
            xml.word(xml.one(part, "parent"), "link"),
            xml.word(xml.one(part, "child"), "link"),
            self._placement(part),
            axis=axis,
            limits=self._range(limit, kind),
            effort=self._positive(limit, "effort"),
            velocity=self._positive(limit, "velocity"),
            damping=xml.number(dynamics, "damping", 0.0),
            friction=xml.number(dynamics, "friction", 0.0),
            mimic=None
            if mimic is None
            else Coupling(
                xml.word(mimic, "joint"),
                xml.number(mimic, "multiplier", 1.0),
                xml.number(mimic, "offset", 0.0),
            ),
        )

    def loop(self, part: Element, links: list[str]) -> LoopJoint:
        xml = self.xml
        kind = xml.known(part, "type", xml.word(part, "type"), LOOP_KINDS, "kind of joint")
        ends = [xml.one(part, end) for end in ("parent", "child")]
        a, b = (xml.known(end, "the link", xml.word(end, "link"), links, "link") for end in ends)
        if a == b:
            raise xml.refusal(part, f"'{a}' as both links", "two links")
        axis = self._axis(part, "parent_axis", True, (1.0, 0.0, 0.0))
        axis_b = self._axis(part, "child_axis", True, (0.0, 1.0, 0.0))
        origin_a, origin_b = (self._placement(part, f"{end}_origin") for end in ("parent", "child"))
        return LoopJoint(xml.word(part, "name"), kind, a, b, origin_a, origin_b, axis, axis_b)

    def left_out(self) -> Iterator[str]:
        """Paths of the elements that nothing reads."""
        top = self.xml.top
        for part in (top, *top.iterfind("link"), *top.iterfind("joint")):
            yield from (self.xml.paths[child] for child in part if child.tag not in READ[part.tag])

    def _axis(self, part: Element, tag: str, needed: bool, otherwise: tuple[float, ...]) -> tuple[float, ...]:
        found = part.find(tag)
        axis = otherwise if found is None else self.xml.numbers(found, "xyz", 3)
        if needed and not np.linalg.norm(axis) > 0:
            raise self.xml.refusal(found, "the axis 0 0 0", "a direction")
        return axis

    def _range(self, limit: Element | None, kind: str) -> tuple[float, float] | None:
        if limit is None or kind not in ("revolute", "prismatic"):
            return None
        low, high = (self.xml.number(limit, key, 0.0) for key in ("lower", "upper"))
        if low > high:
            raise self.xml.refusal(limit, f'lower="{low:g}" above upper="{high:g}"', "limits in their order")
        return None if low == high == 0 else (low, high)  # left out means 0

    def _positive(self, limit: Element | None, key: str) -> float | None:
        """The limit of an effort or a speed; 0 is written by who knows none."""
        found = abs(self.xml.number(limit, key, 0.0))
        return found if 0 < found else None

    def _visual(self, part: Element) -> Visual:
        xml, shapes, placement = self.xml, list(part.iterfind("geometry/*")), self._placement(part)
        if len(shapes) != 1:
            raise xml.refusal(part, f"{len(shapes)} shapes", "one: box, cylinder, sphere or mesh")
        shape = shapes[0]
        if shape.tag == "box":
            return Visual("box", placement, xml.numbers(shape, "size", 3))
        if shape.tag == "cylinder" or shape.tag == "capsule":
            return Visual(shape.tag, placement, (xml.number(shape, "radius"), xml.number(shape, "length")))
        if shape.tag == "sphere":
            return Visual("sphere", placement, (xml.number(shape, "radius"),))
        xml.known(part, "the shape", shape.tag, ("box", "cylinder", "sphere", "mesh"), "shape")
        return Visual(
            "mesh", placement, xml.numbers(shape, "scale", 3, (1.0,) * 3), xml.word(shape, "filename")
        )

    def _placement(self, part: Element, tag: str = "origin") -> Placement:
        origin = part.find(tag)
        return Placement(*(self.xml.numbers(origin, key, 3, NOWHERE) for key in ("xyz", "rpy")))


def _ordered(
    xml: XmlFile, names: list[str], joints: list[RobotJoint], parts: dict[str, Element]
) -> tuple[str, list[RobotJoint]]:
    """The root of the tree and its joints from there on; ModelError for what is no tree."""
    if not names:
        raise xml.refusal(None, "no <link>", "one or more")
    parents: dict[str, RobotJoint] = {}
    for joint in joints:
        for tag, end in (("parent", joint.parent), ("child", joint.child)):
            xml.known(xml.one(parts[joint.name], tag), "the link", end, names, "link")
        if joint.child in parents:
            raise xml.refusal(
                None,
                f"joints '{parents[joint.child].name}' and '{joint.name}' which both carry link '{joint.child}'",
                "one joint above each link; a loop is closed by a <constraint>, or by an entry of the loop file, "
                "`read_urdf(file, loops=...)`",
            )
        parents[joint.child] = joint
    roots = [name for name in names if name not in parents]
    if len(roots) > 1:
        raise xml.refusal(
            None, f"{len(roots)} links that no joint carries ({', '.join(roots[:4])})", "one, the base"
        )
    order = list(_from_root(roots, joints))
    if not roots or len(order) < len(joints):
        left = sorted({joint.name for joint in joints} - {joint.name for joint in order})
        raise xml.refusal(None, f"joints in a circle ({', '.join(left[:4])})", "a tree of links")
    return roots[0], order


def _from_root(roots: list[str], joints: list[RobotJoint]) -> Iterator[RobotJoint]:
    waiting = list(roots)
    while waiting:
        parent = waiting.pop(0)
        for joint in joints:
            if joint.parent == parent:
                yield joint
                waiting.append(joint.child)
