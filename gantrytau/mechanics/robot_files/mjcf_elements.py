"""An MJCF file with its includes and defaults written out, and orientations in MuJoCo's many ways."""

import os
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from gantrytau.mechanics.robot_files.robot_description import NOWHERE, Placement, turned
from gantrytau.mechanics.robot_files.xml_file import XmlFile

GENERATED = ("frame", "replicate", "attach", "composite", "flexcomp")  # what MuJoCo's compiler writes out
WAYS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
DEGREE = np.pi / 180


def expanded(xml: XmlFile) -> XmlFile:
    """The file with what it includes, each element with the attributes of its default class."""
    _include(xml, xml.top, ())
    first, *others = xml.top.findall("worldbody") or [Element("worldbody")]
    for world in others:
        first.extend(world)
        xml.top.remove(world)
    whole = xml.again()
    for part in whole.top.iter():
        if part.tag in GENERATED:
            way = "bodies; MuJoCo writes them out, mujoco.MjSpec.from_file(file) and its to_xml()"
            raise whole.refusal(part, f"<{part.tag}>", way)
    classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}
    for part in whole.top.iterfind("default"):
        _read_defaults(whole, part, part.get("class", "main"), {}, classes)
    for world in whole.top.iterfind("worldbody"):
        _apply(whole, world, "main", classes)
    return whole


def _include(xml: XmlFile, part: Element, around: tuple[str, ...]) -> None:
    for child in list(part):
        if child.tag != "include":
            _include(xml, child, around)
            continue
        name = xml.word(child, "file")
        file = os.path.join(os.path.dirname(xml.file), name)
        if name in around:
            raise xml.refusal(None, f"{name} which includes itself", "files that end")
        inner = XmlFile.read(file, "MJCF")
        _include(XmlFile(xml.file, inner.top, {**xml.paths, **inner.paths}), inner.top, (*around, name))
        place = list(part).index(child)
        part.remove(child)
        for k, one in enumerate(inner.top):
            part.insert(place + k, one)


def _read_defaults(
    xml: XmlFile, part: Element, name: str, above: dict[str, dict[str, str]], classes: dict
) -> None:
    """Attributes by classes and tags; a class has those of the class around it."""
    own = {tag: dict(values) for tag, values in {**above, **classes.get(name, {})}.items()}
    classes[name] = own
    for child in part:
        if child.tag == "default":
            continue
        own[child.tag] = {**own.get(child.tag, {}), **child.attrib}
    for child in part.iterfind("default"):
        _read_defaults(xml, child, xml.word(child, "class"), own, classes)


def _apply(xml: XmlFile, part: Element, name: str, classes: dict[str, dict[str, dict[str, str]]]) -> None:
    for child in part:
        chosen = child.get("class", name)
        known = classes[xml.known(child, "class", chosen, classes, "default class")].get(child.tag, {})
        if any(way in child.attrib for way in (*WAYS, "fromto")):  # one orientation replaces another
            known = {key: value for key, value in known.items() if key not in (*WAYS, "fromto")}
        child.attrib.update({**known, **child.attrib})
        _apply(xml, child, child.get("childclass", name) if child.tag == "body" else name, classes)


@dataclass(frozen=True)
class Orientation:
    """How a file states orientations. angle: rad for a unit of its angles; sequence: of Euler angles, capitals about axes
    that stand still.
    """

    xml: XmlFile
    angle: float
    sequence: str

    @staticmethod
    def of(xml: XmlFile, settings: dict[str, str]) -> "Orientation":
        """What <compiler> says."""
        angle, sequence = settings.get("angle", "degree"), settings.get("eulerseq", "xyz")
        part = xml.top.find("compiler")
        if part is not None:
            xml.known(part, "angle", angle, ("degree", "radian"), "unit")
            if settings.get("coordinate", "local") != "local":
                raise xml.refusal(part, 'coordinate="global"', '"local"; MuJoCo has given up the other')
            if len(sequence) != 3 or not set(sequence.lower()) <= set("xyz"):
                raise xml.refusal(part, f'eulerseq="{sequence}"', "three of x, y and z")
        return Orientation(xml, 1.0 if angle == "radian" else DEGREE, sequence)

    def placement(self, part: Element) -> Placement:
        """Where an element stands in its body."""
        return Placement.of(self.xml.numbers(part, "pos", 3, NOWHERE), self.matrix(part))

    def matrix(self, part: Element) -> np.ndarray:
        """The orientation of an element, (3, 3)."""
        xml = self.xml
        if part.get("quat") is not None:
            return self.of_quaternion(part, xml.numbers(part, "quat", 4))
        if part.get("axisangle") is not None:
            *n, angle = xml.numbers(part, "axisangle", 4)
            return turned(self._direction(part, n, "axisangle"), self.angle * angle)
        if part.get("euler") is not None:
            found = np.eye(3)
            for letter, angle in zip(self.sequence, xml.numbers(part, "euler", 3), strict=True):
                one = turned(np.eye(3)["xyz".index(letter.lower())], self.angle * angle)
                found = found @ one if letter.islower() else one @ found
            return found
        if part.get("xyaxes") is not None:
            numbers = np.array(xml.numbers(part, "xyaxes", 6))
            x = self._direction(part, numbers[:3], "xyaxes")
            y = self._direction(part, numbers[3:] - x * (x @ numbers[3:]), "xyaxes")
            return np.column_stack([x, y, np.cross(x, y)])
        if part.get("zaxis") is not None:
            return towards(self._direction(part, xml.numbers(part, "zaxis", 3), "zaxis"))
        return np.eye(3)

    def of_quaternion(self, part: Element, q: tuple[float, ...]) -> np.ndarray:
        """The orientation of a quaternion, scalar first, of any length."""
        return Placement.of_quaternion(NOWHERE, tuple(self._direction(part, q, "quat"))).R

    def _direction(self, part: Element, numbers: object, key: str) -> np.ndarray:
        length = np.linalg.norm(np.asarray(numbers, dtype=float))
        if not length > 0:
            raise self.xml.refusal(part, f'{key}="{part.get(key)}"', "a direction")
        return np.asarray(numbers, dtype=float) / length


def towards(z: np.ndarray) -> np.ndarray:
    """The smallest rotation that brings the third axis to a unit vector; about the first one for its opposite."""
    axis = np.cross([0.0, 0.0, 1.0], z)
    length = np.linalg.norm(axis)
    return turned(axis if length > 1e-300 else np.array([1.0, 0, 0]), np.arctan2(length, z[2]))
