"""Content of an MJCF file, MuJoCo's own format: bodies, sites, joints, and the loops of <equality>.

https://mujoco.readthedocs.io/en/stable/XMLreference.html: what belongs to a joint is resolved in the frame of its body; a
body may have several joints, one after another; a coordinate is `ref` where bodies stand as they are written.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.mjcf_elements import Orientation, expanded
from gantrytau.mechanics.robot_files.mjcf_geoms import Geoms
from gantrytau.mechanics.robot_files.robot_description import (
    NOWHERE,
    Coupling,
    LoopJoint,
    Placement,
    RobotDescription,
    RobotJoint,
    RobotLink,
    RobotSensor,
    turned,
)
from gantrytau.mechanics.robot_files.shape_inertia import link_of
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders
from gantrytau.mechanics.robot_files.xml_file import XmlFile

KINDS = {"hinge": "revolute", "slide": "prismatic", "ball": "spherical", "free": "floating"}
SENSORS = {  # kind of sensor -> the attribute with the name of what it is at, what it tells
    "jointpos": ("joint", "position"),
    "jointvel": ("joint", "speed"),
    "jointactuatorfrc": ("joint", "force"),
    "framepos": ("objname", "r"),
    "framelinvel": ("objname", "v"),
    "frameangvel": ("objname", "w"),
}
READ = "compiler option size default asset worldbody equality actuator sensor include"
PASSED = "solref solimp margin group class user name rgba material"  # numerics and looks
OF_JOINTS = "type pos axis range limited damping frictionloss armature stiffness springref ref"
MASSES = "balanceinertia boundmass boundinertia settotalmass"  # settings that change them
OF_BALLS = "type pos"


def read_mjcf_file(file: str | os.PathLike[str], folders: MeshFolders) -> RobotDescription:
    """The robot of an MJCF file. ModelError for a file that cannot be read or describes no robot."""
    xml = expanded(XmlFile.read(file, "MJCF", "mujoco", "<worldbody>"))
    settings = {key: value for part in xml.top.iterfind("compiler") for key, value in part.attrib.items()}
    orientation = Orientation.of(xml, settings)
    reader = _Reader(xml, settings, orientation, Geoms(xml, orientation, folders, settings))
    reader.body(xml.one(xml.top, "worldbody"), "world", Placement())
    xml.different("bodies or sites", [link.name for link in reader.links])
    xml.different("joints", [joint.name for joint in reader.joints])
    reader.equalities()
    option = xml.top.find("option")
    gravity = xml.numbers(option, "gravity", 3, (0.0, 0.0, -9.81))
    driven = tuple(reader.driven())
    sensors = tuple(reader.sensors())
    return RobotDescription(
        xml.file,
        xml.top.get("model") or Path(file).stem,
        "world",
        tuple(reader.links),
        tuple(reader.joints),
        driven if xml.top.find("actuator") is not None else None,
        tuple(reader.loops),
        bool(reader.loops),
        None if gravity == (0.0, 0.0, -9.81) else gravity,
        sensors,
        tuple(reader.left_out),
    )


@dataclass(frozen=True)
class _Reader:
    """Elements of a file as records, as they come; poses: of bodies and sites in the world, as they are written."""

    xml: XmlFile
    settings: dict[str, str]
    orientation: Orientation
    geoms: Geoms
    links: list[RobotLink] = field(default_factory=list)
    joints: list[RobotJoint] = field(default_factory=list)
    loops: list[LoopJoint] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    poses: dict[str, Placement] = field(default_factory=dict)
    references: dict[str, float] = field(default_factory=dict)
    sites: dict[str, str] = field(default_factory=dict)

    @cached_property
    def bodies(self) -> set[str]:
        """Names of all bodies."""
        return {"world", *(part.get("name", "") for part in self.xml.top.iterfind("worldbody//body"))}

    def body(self, part: Element, name: str, pose: Placement) -> None:
        """A body that stands there in the world, its sites, and the bodies on it."""
        self.poses[name] = pose
        self.links.append(self._link(part, name))
        for site in part.iterfind("site"):
            place = self.orientation.placement(site)
            label = self._name(site, f"{name}_site")
            if label in self.bodies:
                label = f"{label}_site"
            self.sites[site.get("name", label)] = label
            self.links.append(RobotLink(label))
            self.joints.append(RobotJoint(f"{label}_mount", "fixed", name, label, place))
            self.poses[label] = pose @ place
        for child in part.iterfind("body"):
            label, place = self._name(child, "body"), self.orientation.placement(child)
            self.body(child, label, pose @ place)
            self.joints.extend(self._chain(child, name, label, place))
        for child in part:
            if child.tag not in ("inertial", "geom", "site", "body", "joint", "freejoint"):
                self._leave(child)

    def _link(self, part: Element, name: str) -> RobotLink:
        xml, inertial = self.xml, part.find("inertial")
        shapes = [self.geoms.shape(one) for one in part.iterfind("geom")]
        visuals = tuple(shape for shape in shapes if shape is not None)
        way = self.settings.get("inertiafromgeom", "auto")
        if part.tag == "worldbody" or (inertial is None and way == "false"):
            return RobotLink(name, visuals=visuals)
        if inertial is None or way == "true":
            lumps = list(self.geoms.lumps(part))
            return link_of(name, lumps, visuals) if lumps else RobotLink(name, visuals=visuals)
        m = xml.number(inertial, "mass")
        if m < 0:
            raise xml.refusal(inertial, f"mass = {m:g} kg", "none below 0")
        if inertial.get("fullinertia") is not None:
            xx, yy, zz, xy, xz, yz = xml.numbers(inertial, "fullinertia", 6)
        else:
            (xx, yy, zz), (xy, xz, yz) = xml.numbers(inertial, "diaginertia", 3), NOWHERE
        J = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        return RobotLink(name, m, J, self.orientation.placement(inertial), visuals)

    def _chain(self, part: Element, parent: str, child: str, place: Placement) -> Iterator[RobotJoint]:
        """The joints of a body, one after another; links without a mass stand between them."""
        parts = [one for one in part if one.tag in ("joint", "freejoint")]
        if not parts:
            yield RobotJoint(f"{child}_mount", "fixed", parent, child, place)
        for k, one in enumerate(parts, 1):
            end = child if k == len(parts) else self._free(f"{child}_{k}")
            if end != child:
                self.links.append(RobotLink(end))
            yield self._joint(one, parent, end, place)
            parent, place = end, Placement()

    def _joint(self, part: Element, parent: str, child: str, place: Placement) -> RobotJoint:
        xml = self.xml
        name = self._name(part, f"{child}_joint")
        word = "free" if part.tag == "freejoint" else part.get("type", "hinge")
        kind = KINDS[xml.known(part, "type", word, KINDS, "kind of joint")]
        if kind == "floating":
            if parent != "world" or child not in self.poses:
                raise xml.refusal(
                    part,
                    f"a free joint, one of several or in '{parent}'",
                    "the only one of a body of the world",
                )
            return RobotJoint(name, kind, parent, child, place)
        anchor = Placement(xml.numbers(part, "pos", 3, NOWHERE))
        known = OF_BALLS if kind == "spherical" else OF_JOINTS
        self.left_out.extend(
            f"{xml.paths[part]}: {key}" for key in part.attrib if key not in f"{known} {PASSED}".split()
        )
        joint = RobotJoint(name, kind, parent, child, place @ anchor, anchor.inverse)
        if kind == "spherical":
            return joint
        axis = xml.numbers(part, "axis", 3, (0.0, 0.0, 1.0))
        if not np.linalg.norm(axis) > 0:
            raise xml.refusal(part, 'axis="0 0 0"', "a direction")
        unit = self.orientation.angle if kind == "revolute" else 1.0
        zero = unit * xml.number(part, "ref", 0.0)
        self.references[name] = zero
        return replace(
            joint,
            axis=axis,
            seat=_moved(kind, axis, -zero) @ joint.seat,
            start=zero or None,
            limits=self._range(part, unit),
            damping=xml.number(part, "damping", 0.0),
            friction=xml.number(part, "frictionloss", 0.0),
            armature=xml.number(part, "armature", 0.0),
            stiffness=xml.number(part, "stiffness", 0.0),
            rest=unit * xml.number(part, "springref", 0.0),
        )

    def _range(self, part: Element, unit: float) -> tuple[float, float] | None:
        limited = part.get("limited", "auto")
        if (
            part.get("range") is None
            or limited == "false"
            or (limited == "auto" and self.settings.get("autolimits") == "false")
        ):
            return None
        low, high = self.xml.numbers(part, "range", 2)
        if low > high:
            raise self.xml.refusal(part, f"range from {low:g} to {high:g}", "limits in their order")
        return unit * low, unit * high

    def equalities(self) -> None:
        """Loops and couplings of <equality>."""
        kinds = {"connect": self._ball, "weld": self._weld, "joint": self._couple}
        for part in self.xml.top.iterfind("equality/*"):
            if part.tag not in kinds or part.get("active") == "false":
                self._leave(part)
            else:
                kinds[part.tag](part)

    def _ends(self, part: Element) -> tuple[str, str]:
        """The two bodies of a loop; the second is the world unless it is there."""
        for key in ("body1", "body2"):
            if key == "body1" or part.get(key):
                self.xml.known(part, key, self.xml.word(part, key), self.bodies, "body")
        a, b = self.xml.word(part, "body1"), part.get("body2", "world")
        if a == b:
            raise self.xml.refusal(part, f"'{a}' as both bodies", "two bodies")
        return a, b

    def _ball(self, part: Element) -> None:
        name = self._name(part, "connect")
        if part.get("site1") is not None:
            self.loops.append(
                LoopJoint(name, "spherical", self._site(part, "site1"), self._site(part, "site2"))
            )
            return
        a, b = self._ends(part)
        anchor = Placement(self.xml.numbers(part, "anchor", 3))
        other = Placement((self.poses[b].inverse @ self.poses[a] @ anchor).xyz)
        self.loops.append(LoopJoint(name, "spherical", a, b, anchor, other))

    def _weld(self, part: Element) -> None:
        name = self._name(part, "weld")
        if part.get("site1") is not None:
            self.loops.append(LoopJoint(name, "fixed", self._site(part, "site1"), self._site(part, "site2")))
            return
        a, b = self._ends(part)
        pose = self.poses[a].inverse @ self.poses[b]
        x, y, z, *quat = self.xml.numbers(part, "relpose", 7, (0.0,) * 7)
        if any(quat):
            pose = Placement.of((x, y, z), self.orientation.of_quaternion(part, tuple(quat)))
        self.loops.append(LoopJoint(name, "fixed", a, b, pose))

    def _site(self, part: Element, key: str) -> str:
        """The link of a site."""
        return self.sites[self.xml.known(part, key, self.xml.word(part, key), self.sites, "site")]

    def _couple(self, part: Element) -> None:
        """The coordinate of joint1 as a polynomial of that of joint2, both measured from `ref`."""
        xml, names = self.xml, [joint.name for joint in self.joints]
        name = xml.known(part, "joint1", xml.word(part, "joint1"), self.references, "joint")
        other = part.get("joint2")
        if other is not None:
            xml.known(part, "joint2", other, self.references, "joint")
        words = part.get("polycoef", "0 1 0 0 0")
        given = xml.read_numbers(part, words, len(words.split()), f'polycoef="{words}"')
        offset, slope, *higher = (*given, *(0.0, 1.0)[len(given) :])  # what is missing has its default
        if any(higher) and other is not None:
            raise xml.refusal(
                part, f'polycoef="{words}"', "a line, its first two numbers; no other curve is read"
            )
        k = names.index(name)
        if self.joints[k].mimic is not None or name == other:
            raise xml.refusal(part, f"'{name}' which follows twice or itself", "one coupling of a joint")
        offset += self.references[name] - (slope * self.references[other] if other is not None else 0.0)
        self.joints[k] = replace(self.joints[k], mimic=Coupling(other, slope, offset))

    def driven(self) -> Iterator[str]:
        """Joints of actuators; an input of a drive is the force or torque at the joint itself."""
        moving = [joint.name for joint in self.joints if joint.moves]
        for part in self.xml.top.iterfind("actuator/*"):
            name = part.get("joint")
            if name in moving:
                yield name
            if name not in moving or part.tag != "motor":
                self._leave(part)
            elif part.get("gear"):
                self.left_out.append(f"{self.xml.paths[part]}: gear")

    def sensors(self) -> Iterator[RobotSensor]:
        """Sensors whose numbers are variables; sections that nothing reads are left out."""
        known = {"joint": {name: name for name in self.references}, "site": self.sites}
        known |= {kind: {name: name for name in self.bodies} for kind in ("body", "xbody")}
        for part in self.xml.top.iterfind("sensor/*"):
            key, quantity = SENSORS.get(part.tag, ("", ""))
            kind = part.get("objtype", "joint") if key == "objname" else "joint"
            found = known.get(kind, {}).get(part.get(key, ""))
            if found is None or part.get("reftype") or (kind == "body" and quantity != "w"):
                self._leave(part)
            else:
                yield RobotSensor(
                    self._name(part, part.tag), "joint" if kind == "joint" else "link", found, quantity
                )
        for part in self.xml.top:
            if part.tag not in READ.split():
                self._leave(part)
        self.left_out.extend(f"mujoco/compiler: {key}" for key in MASSES.split() if key in self.settings)

    def _leave(self, part: Element) -> None:
        self.left_out.append(self.xml.paths[part])

    def _name(self, part: Element, otherwise: str) -> str:
        """The name of an element, or one that no other has."""
        return self.xml.word(part, "name") if part.get("name") else self._free(otherwise)

    def _free(self, name: str) -> str:
        taken = {one.name for one in (*self.links, *self.joints, *self.loops)} | self.bodies
        return next(
            one for one in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if one not in taken
        )


def _moved(kind: str, axis: tuple[float, ...], q: float) -> Placement:
    """Where a joint stands that has moved by q."""
    if kind == "prismatic":
        return Placement(tuple(q * np.array(axis) / np.linalg.norm(axis)))
    return Placement.of(NOWHERE, turned(np.array(axis), q))
