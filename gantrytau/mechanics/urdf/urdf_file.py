"""Content of a URDF file: links and joints of a tree, as numbers in m, kg, s and rad.

https://wiki.ros.org/urdf/XML: orientations are roll, pitch, yaw about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll); what
belongs to a joint is resolved in the frame of its parent link, and its axis in its own frame, which is that of
its child link.
"""

import math
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Placement:
    """Pose of a frame in another: xyz (3,) in m, rpy (3,) in rad."""

    xyz: tuple[float, ...] = NOWHERE
    rpy: tuple[float, ...] = NOWHERE

    @property
    def R(self) -> np.ndarray:
        """Its orientation, (3, 3): columns are its axes."""
        (a, b, c), (x, y, z) = np.cos(self.rpy), np.sin(self.rpy)
        about_x = np.array([[1, 0, 0], [0, a, -x], [0, x, a]])
        about_y = np.array([[b, 0, y], [0, 1, 0], [-y, 0, b]])
        about_z = np.array([[c, -z, 0], [z, c, 0], [0, 0, 1]])
        return about_z @ about_y @ about_x


@dataclass(frozen=True)
class Visual:
    """Shape of a link. kind: box, with size (3,) m; cylinder, along z, with size (radius, length); sphere, (radius,);
    mesh, with its file and size (3,), m for a unit of the file.
    """

    kind: str
    placement: Placement
    size: tuple[float, ...]
    file: str = ""


@dataclass(frozen=True)
class UrdfLink:
    """A body, or a frame if it has no mass. m: kg; J: (3, 3) kg.m2 about the centre of mass, along the axes of `centre`."""

    name: str
    m: float = 0.0
    J: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    centre: Placement = Placement()
    visuals: tuple[Visual, ...] = ()


@dataclass(frozen=True)
class UrdfJoint:
    """Joint between a link and its parent. limits: of the coordinate, m or rad; effort, velocity: N or N.m, m/s or rad/s;
    damping, friction: viscous and Coulomb; mimic: of which joint it is (name, multiplier, offset).
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: Placement
    axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    limits: tuple[float, float] | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    mimic: tuple[str, float, float] | None = None

    @property
    def moves(self) -> bool:
        """Whether it has one coordinate."""
        return self.kind in ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class UrdfTree:
    """A robot as its file states it. joints: each behind that of its parent; driven: joints with a <transmission>."""

    file: str
    name: str
    root: str
    links: tuple[UrdfLink, ...]
    joints: tuple[UrdfJoint, ...]
    driven: tuple[str, ...]

    def refusal(self, found: str, expected: str) -> ModelError:
        """Error for a fault of the file."""
        return ModelError(f"{self.file}: found {found}, expected {expected}", argument="file")


def read_tree(file: str | os.PathLike[str]) -> UrdfTree:
    """The tree of a URDF file; ModelError for one that cannot be read, says nothing sensible, or is no tree."""
    path = Path(file)
    try:
        text = path.read_bytes()
        top = ElementTree.fromstring(text)
    except OSError as error:
        raise ModelError(
            f"{path}: found no file that can be read ({error.strerror}), expected URDF", argument="file"
        ) from None
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ModelError(f"{path}: found no XML ({error}), expected URDF", argument="file") from None
    if b"xacro:" in text:
        raise ModelError(
            f"{path}: found macros of xacro, expected URDF; write it with `xacro {path.name} > robot.urdf`",
            argument="file",
        )
    if top.tag != "robot":
        raise ModelError(
            f"{path}: found <{top.tag}>, expected <robot> around links and joints", argument="file"
        )
    reader = _Reader(str(path))
    links = [reader.link(part) for part in top.iterfind("link")]
    joints = [reader.joint(part) for part in top.iterfind("joint")]
    driven = [reader.word(part, "name") for part in top.iterfind("transmission/joint")]
    root, order = _ordered(reader, links, joints)
    for joint in joints:
        if joint.mimic is not None:
            reader.known(joint.mimic[0], [j.name for j in joints], f"<joint> '{joint.name}' mimics", "joint")
    for name in driven:
        reader.known(name, [j.name for j in joints], "a <transmission> drives", "joint")
    title = top.get("name") or path.stem
    return UrdfTree(str(path), title, root, tuple(links), tuple(order), tuple(dict.fromkeys(driven)))


@dataclass(frozen=True)
class _Reader:
    """Elements of a file as records, and what is wrong with them by names."""

    file: str

    def link(self, part: ElementTree.Element) -> UrdfLink:
        name = self.word(part, "name")
        visuals = tuple(self._visual(seen, name) for seen in part.iterfind("visual"))
        inertial = part.find("inertial")
        if inertial is None:
            return UrdfLink(name, visuals=visuals)
        m = self.number(inertial.find("mass"), "value", f"the <mass> of link '{name}'")
        if m < 0:
            raise self.refusal(f"the mass {m:g} kg of link '{name}'", "none below 0")
        tensor = inertial.find("inertia")
        what = f"the <inertia> of link '{name}'"
        ixx, ixy, ixz, iyy, iyz, izz = (
            self.number(tensor, key, what, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        J = ((ixx, ixy, ixz), (ixy, iyy, iyz), (ixz, iyz, izz))
        if m == 0 and np.any(J):
            raise self.refusal(
                f"link '{name}' with an inertia and no mass", "a mass above 0, or neither of them"
            )
        return UrdfLink(name, m, J, self._placement(inertial, f"link '{name}'"), visuals)

    def joint(self, part: ElementTree.Element) -> UrdfJoint:
        name, kind = self.word(part, "name"), self.word(part, "type")
        where = f"joint '{name}'"
        self.known(kind, KINDS, f"{where} is", "kind of joint")
        axis_part, limit, dynamics = part.find("axis"), part.find("limit"), part.find("dynamics")
        axis = (
            (1.0, 0.0, 0.0)
            if axis_part is None
            else self.numbers(axis_part, "xyz", 3, f"the axis of {where}")
        )
        if kind not in ("fixed", "floating") and not np.linalg.norm(axis) > 0:
            raise self.refusal(f"the axis 0 0 0 of {where}", "a direction")
        return UrdfJoint(
            name,
            kind,
            self.word(part.find("parent"), "link", f"the <parent> of {where}"),
            self.word(part.find("child"), "link", f"the <child> of {where}"),
            self._placement(part, where),
            axis,
            self._range(limit, kind, where),
            self._positive(limit, "effort", where),
            self._positive(limit, "velocity", where),
            self.number(dynamics, "damping", where, 0.0),
            self.number(dynamics, "friction", where, 0.0),
            self._mimic(part.find("mimic"), where),
        )

    def _range(self, limit: ElementTree.Element | None, kind: str, where: str) -> tuple[float, float] | None:
        if limit is None or kind not in ("revolute", "prismatic"):
            return None
        low, high = (self.number(limit, key, f"the limits of {where}", 0.0) for key in ("lower", "upper"))
        if low > high:
            raise self.refusal(f'lower="{low:g}" above upper="{high:g}" of {where}', "limits in their order")
        return None if low == high == 0 else (low, high)  # left out means 0

    def _positive(self, limit: ElementTree.Element | None, key: str, where: str) -> float | None:
        """The limit of an effort or a speed; 0 is written by who knows none."""
        found = abs(self.number(limit, key, f"the limits of {where}", 0.0))
        return found if 0 < found else None

    def _mimic(self, part: ElementTree.Element | None, where: str) -> tuple[str, float, float] | None:
        if part is None:
            return None
        what = f"the <mimic> of {where}"
        other = self.word(part, "joint", what)
        return other, self.number(part, "multiplier", what, 1.0), self.number(part, "offset", what, 0.0)

    def _visual(self, part: ElementTree.Element, link: str) -> Visual:
        where = f"a <visual> of link '{link}'"
        shapes = list(part.iterfind("geometry/*"))
        if len(shapes) != 1:
            raise self.refusal(f"{len(shapes)} shapes in {where}", "one: box, cylinder, sphere or mesh")
        shape, placement = shapes[0], self._placement(part, where)
        if shape.tag == "box":
            return Visual("box", placement, self.numbers(shape, "size", 3, where))
        if shape.tag == "cylinder" or shape.tag == "capsule":
            size = tuple(self.number(shape, key, where) for key in ("radius", "length"))
            return Visual("cylinder", placement, size)
        if shape.tag == "sphere":
            return Visual("sphere", placement, (self.number(shape, "radius", where),))
        self.known(shape.tag, ("box", "cylinder", "sphere", "mesh"), f"{where} is", "shape")
        scale = (1.0,) * 3 if shape.get("scale") is None else self.numbers(shape, "scale", 3, where)
        return Visual("mesh", placement, scale, self.word(shape, "filename", where))

    def _placement(self, part: ElementTree.Element, where: str) -> Placement:
        origin = part.find("origin")
        if origin is None:
            return Placement()
        xyz, rpy = (
            self.numbers(origin, key, 3, f"the <origin> of {where}")
            if origin.get(key) is not None
            else NOWHERE
            for key in ("xyz", "rpy")
        )
        return Placement(xyz, rpy)

    def word(self, part: ElementTree.Element | None, key: str, where: str = "") -> str:
        """An attribute that has to be there."""
        found = None if part is None else part.get(key)
        if not (found or "").strip():
            place = where or f"a <{'' if part is None else part.tag}>"
            raise self.refusal(f"{place} without {key}=", f'{key}="..."')
        return str(found).strip()

    def number(
        self, part: ElementTree.Element | None, key: str, where: str, otherwise: float | None = None
    ) -> float:
        """An attribute as a finite number; `otherwise` where it is not there, if that is allowed."""
        if otherwise is not None and (part is None or part.get(key) is None):
            return otherwise
        self.word(part, key, where)
        return self.numbers(part, key, 1, where)[0]

    def numbers(self, part: Any, key: str, count: int, where: str) -> tuple[float, ...]:
        """An attribute as so many finite numbers."""
        words = self.word(part, key, where).split()
        try:
            found = tuple(float(word) for word in words)
        except ValueError:
            found = ()
        if len(found) != count or not all(map(math.isfinite, found)):
            many = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.refusal(f'{key}="{part.get(key)}" in {where}', many)
        return found

    def known(self, name: str, names: Iterable[str], what: str, kind: str) -> None:
        """ModelError for a name that is none of `names`."""
        if name not in (some := list(names)):
            raise self.refusal(f"{what} '{name}'", f"a {kind} that is there{did_you_mean(name, some)}")

    def refusal(self, found: str, expected: str) -> ModelError:
        return ModelError(f"{self.file}: found {found}, expected {expected}", argument="file")


def _ordered(reader: _Reader, links: list[UrdfLink], joints: list[UrdfJoint]) -> tuple[str, list[UrdfJoint]]:
    """The root of the tree and its joints from there on; ModelError for what is no tree."""
    names = [link.name for link in links]
    if not names:
        raise reader.refusal("no <link>", "one or more")
    for kind, all_names in (("link", names), ("joint", [joint.name for joint in joints])):
        twice = {name for name in all_names if all_names.count(name) > 1}
        if twice:
            raise reader.refusal(f"two {kind}s of the name '{min(twice)}'", "different names")
    parents: dict[str, UrdfJoint] = {}
    for joint in joints:
        for end in (joint.parent, joint.child):
            reader.known(end, names, f"joint '{joint.name}' joins", "link")
        if joint.child in parents:
            raise reader.refusal(
                f"joints '{parents[joint.child].name}' and '{joint.name}' which both carry link '{joint.child}'",
                "one joint above each link; a loop is closed by an entry of the loop file, `read_urdf(file, loops=...)`",
            )
        parents[joint.child] = joint
    roots = [name for name in names if name not in parents]
    if len(roots) > 1:
        raise reader.refusal(
            f"{len(roots)} links that no joint carries ({', '.join(roots[:4])})", "one, the base"
        )
    order = list(_from_root(roots, joints))
    if not roots or len(order) < len(joints):
        left = sorted({joint.name for joint in joints} - {joint.name for joint in order})
        raise reader.refusal(f"joints in a circle ({', '.join(left[:4])})", "a tree of links")
    return roots[0], order


def _from_root(roots: list[str], joints: list[UrdfJoint]) -> Iterator[UrdfJoint]:
    waiting = list(roots)
    while waiting:
        parent = waiting.pop(0)
        for joint in joints:
            if joint.parent == parent:
                yield joint
                waiting.append(joint.child)
