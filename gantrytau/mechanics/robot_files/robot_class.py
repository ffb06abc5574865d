"""A robot as its file describes it, as a class of components."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from keyword import iskeyword
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import Model, ModelError, StateSelect, connect
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import Cylindrical, Prismatic, Revolute, Spherical, Universal, World
from gantrytau.mechanics.robot_files.robot_description import (
    Coupling,
    LoopJoint,
    Placement,
    RobotDescription,
    RobotJoint,
    RobotLink,
    RobotSensor,
)
from gantrytau.mechanics.robot_files.robot_parts import (
    LinkBody,
    LinkFrame,
    Origin,
    PlanarJoint,
    SlideBySlide,
    SlideByTurn,
    TurnBySlide,
    TurnByTurn,
)
from gantrytau.mechanics.robot_files.visual_shapes import MeshFolders, shapes_of_link

Way = tuple[str, ...]
FOLLOWERS = {  # whether it slides, and whether the one that it follows does
    (False, False): TurnByTurn,
    (False, True): TurnBySlide,
    (True, False): SlideByTurn,
    (True, True): SlideBySlide,
}
LETTERS = {True: ("s", "v", "f"), False: ("phi", "w", "tau")}  # of a joint that slides, or turns


class DescribedRobot(Model):
    """Base of robots from files.

    names: from the names of the file, `link elbow`, to those of components; sensors: from names of sensors to variables;
    left_out: what the file has and the model has not.
    """

    placement = Origin()
    world = World()
    names: Mapping[str, str] = {}
    sensors: Mapping[str, str] = {}
    left_out: tuple[str, ...] = ()
    wires: tuple[tuple[Way, Way], ...] = ()

    if TYPE_CHECKING:  # its links and joints are known when the file is read

        def __getattr__(self, name: str) -> Any: ...

    def equations(self):
        for a, b in self.wires:
            yield connect(_member(self, a), _member(self, b))


def robot_class(robot: RobotDescription, folders: MeshFolders) -> type[DescribedRobot]:
    """The class of a robot: a component for each link, joint and loop, drives, friction and springs at the joints."""
    plan = _Plan(robot, _driven(robot))
    for link in robot.links:
        plan.add_link(link, folders)
    plan.wire(("world", "frame_b"), ("placement", "frame_a"))
    plan.wire(("placement", "frame_b"), plan.frame(robot.root))
    for joint in robot.joints:
        plan.add_joint(joint)
    for loop in robot.loops:
        plan.add_loop(loop)
    return plan.made()


def _driven(robot: RobotDescription) -> set[str]:
    """Names of the driven joints: those of the file, or else all moving joints without a coupling."""
    free = (joint.name for joint in robot.joints if joint.moves and joint.mimic is None)
    return set(free if robot.driven is None else robot.driven)


@dataclass(frozen=True)
class _Plan:
    """Collects the components of the class and the connections between them."""

    robot: RobotDescription
    driven: set[str]
    members: dict[str, Any] = field(default_factory=dict)
    wires: list[tuple[Way, Way]] = field(default_factory=list)

    @cached_property
    def names(self) -> dict[str, str]:
        """Names of components, from those of the file."""
        return _component_names(self.robot)

    def wire(self, a: Way, b: Way) -> None:
        self.wires.append((a, b))

    def frame(self, link: str) -> Way:
        """The frame of a link."""
        return self._named("link", link), "frame_a"

    def add_link(self, link: RobotLink, folders: MeshFolders) -> None:
        name = self._named("link", link.name)
        shapes = shapes_of_link(link, folders)
        base = LinkBody if link.m > 0 else LinkFrame
        kind: Any = type(base.__name__, (base,), dict(visuals=shapes, __doc__=f"Link {link.name}."))
        if link.m > 0:
            R = link.centre.R
            J = R @ np.array(link.J) @ R.T
            self.members[name] = kind(m=link.m, r_cm=list(link.centre.xyz), J=(J + J.T) / 2)
        else:
            self.members[name] = kind()

    def add_joint(self, joint: RobotJoint) -> None:
        name = self._named("joint", joint.name)
        if joint.kind == "floating":
            return self._float(joint)
        seen = dict(drawn=not any(link.visuals for link in self.robot.links))
        if joint.kind == "fixed":
            self.members[name] = _origin(joint.placement @ joint.seat, seen)
            self.wire(self.frame(joint.parent), (name, "frame_a"))
            return self.wire((name, "frame_b"), self.frame(joint.child))
        self._offset(f"{name}_origin", self.frame(joint.parent), joint.placement, (name, "frame_a"), seen)
        self.members[name] = self._moving(joint, seen)
        if joint.seat == Placement():
            self.wire((name, "frame_b"), self.frame(joint.child))
        else:
            self._offset(f"{name}_seat", (name, "frame_b"), joint.seat, self.frame(joint.child), seen)
        if joint.moves:
            self._attach(joint, name)
        return None

    def _offset(self, name: str, inner: Way, placement: Placement, outer: Way, seen: Mapping[str, bool]):
        """An origin between two frames."""
        found = self._free(name)
        self.members[found] = _origin(placement, seen)
        self.wire(inner, (found, "frame_a"))
        self.wire((found, "frame_b"), outer)

    def _float(self, joint: RobotJoint) -> None:
        """A link that flies: it starts where its origin says, seen from the base."""
        link = self._named("link", joint.child)
        if not isinstance(self.members[link], LinkBody):
            raise ModelError(
                f"{self.robot.file}: found joint '{joint.name}' on which link '{joint.child}' without a mass floats, "
                f"expected an inertia of it",
                argument="file",
            )
        start = joint.placement @ joint.seat
        pose = dict(r=dict(start=list(start.xyz)), q=dict(start=_quaternion(start.rpy)))
        self.members[link] = self.members[link].modified(pose)

    def _moving(self, joint: RobotJoint, seen: dict[str, bool]) -> Model:
        axis = list(joint.axis)
        match joint.kind:
            case "planar":
                n = np.array(axis) / np.linalg.norm(axis)
                across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
                across /= np.linalg.norm(across)
                return PlanarJoint(n=axis, n_x=list(across), n_y=list(np.cross(n, across)), **seen)
            case "spherical":
                return Spherical(**seen)
            case "universal":
                return Universal(n_a=axis, n_b=list(joint.axis_b), **seen)
        coordinate, speed, force = LETTERS[joint.kind == "prismatic"]
        values: dict[str, Any] = {coordinate: {}, speed: _both(joint.velocity), force: _both(joint.effort)}
        closed = bool(self.robot.loops) or self.robot.closed
        # loops start as they are written, unless somebody says where
        written = closed and not any(one.chosen for one in self.robot.joints)
        start = 0.0 if written and joint.start is None else joint.start
        if joint.limits is not None:
            low, high = joint.limits
            values[coordinate] = dict(min=low, max=high)
            start = min(max(0.0, low), high) or None if start is None else start
        if start is not None:
            values[coordinate]["start"] = start
            # where a loop starts is said by what drives it, the rest follows
            values[coordinate]["fixed"] = closed and joint.chosen and joint.name in self.driven
        if closed and joint.name not in self.driven:
            for one in (coordinate, speed):
                values[one]["prefer"] = StateSelect.DEFAULT
        kind = Prismatic if joint.kind == "prismatic" else Revolute
        return kind(n=axis, **{key: value for key, value in values.items() if value}, **seen)

    def _attach(self, joint: RobotJoint, name: str) -> None:
        """Components at the axis of a joint: drive, friction, rotor, spring, the joint that it follows."""
        slides = joint.kind == "prismatic"
        if joint.name in self.driven:
            self._at_axis(name, "drive", translational.Force() if slides else rotational.Torque())
        if joint.damping or joint.friction:
            friction = (
                translational.TanhFriction(f_c=joint.friction, f_v=joint.damping)
                if slides
                else rotational.TanhFriction(tau_c=joint.friction, tau_v=joint.damping)
            )
            self._at_axis(name, "friction", friction)
        if joint.armature:
            rotor = translational.Mass(m=joint.armature) if slides else rotational.Inertia(J=joint.armature)
            self._at_axis(name, "rotor", rotor, "flange" if slides else "flange_a")
        if joint.stiffness:
            spring = (
                translational.Spring(c=joint.stiffness, s_rel0=joint.rest)
                if slides
                else rotational.Spring(c=joint.stiffness, phi_rel0=joint.rest)
            )
            end = self._at_axis(name, "spring", spring, "flange_b")
            ground = self._free(f"{name}_spring_end")
            self.members[ground] = translational.Fixed() if slides else rotational.Fixed()
            self.wire((ground, "flange"), (end, "flange_a"))
        if joint.mimic is not None:
            self._follow(joint, name, joint.mimic)

    def _follow(self, joint: RobotJoint, name: str, mimic: Coupling) -> None:
        """The coordinate of a joint follows another, or is held."""
        slides = joint.kind == "prismatic"
        if mimic.other is None:
            held = translational.Fixed(s=mimic.offset) if slides else rotational.Fixed(phi=mimic.offset)
            self._at_axis(name, "hold", held)
            return
        other = next((one for one in self.robot.joints if one.name == mimic.other), joint)
        if not other.moves or other is joint:
            raise ModelError(
                f"{self.robot.file}: found joint '{joint.name}' which mimics '{other.name}', a {other.kind} joint, "
                "expected another one that moves in one coordinate",
                argument="file",
            )
        kind = FOLLOWERS[slides, other.kind == "prismatic"]
        gear = kind(multiplier=mimic.multiplier, offset=mimic.offset)
        follower = self._at_axis(name, "mimic", gear, "flange_a")
        self.wire((follower, "flange_b"), (self._named("joint", other.name), "axis"))

    def _at_axis(self, joint: str, what: str, component: Model, flange: str = "flange") -> str:
        """The name of a component that is connected to the axis of a joint."""
        name = self._free(f"{joint}_{what}")
        self.members[name] = component
        self.wire((name, flange), (joint, "axis"))
        return name

    def add_loop(self, loop: LoopJoint) -> None:
        name = self._named("loop", loop.name)
        ends = []
        for side, link, placement in (("a", loop.link_a, loop.origin_a), ("b", loop.link_b, loop.origin_b)):
            end = self._free(f"{name}_origin_{side}")
            self.members[end] = _origin(placement, {})
            self.wire(self.frame(link), (end, "frame_a"))
            ends.append((end, "frame_b"))
        if loop.kind == "fixed":
            return self.wire(*ends)
        self.members[name] = _closing(loop)
        self.wire(ends[0], (name, "frame_a"))
        return self.wire(ends[1], (name, "frame_b"))

    def made(self) -> type[DescribedRobot]:
        """The class."""
        robot = self.robot
        if robot.gravity is not None:
            self.members["world"] = World(gravity=list(robot.gravity))
        content = dict(
            __doc__=f"{robot.name}, from {os.path.basename(robot.file)}.",
            __module__=__name__,
            names={key: value for key, value in self.names.items() if key.partition(" ")[2] != value},
            sensors={sensor.name: self._sensed(sensor) for sensor in robot.sensors},
            left_out=robot.left_out,
            wires=tuple(self.wires),
        )
        title = "".join(word.capitalize() for word in _identifier(robot.name).split("_"))
        made: Any = type(title, (DescribedRobot,), {**self.members, **content})
        return made

    def _sensed(self, sensor: RobotSensor) -> str:
        """The variable that a sensor tells."""
        name = self._named(sensor.kind, sensor.part)
        if sensor.kind == "link":
            return f"{name}.{sensor.quantity}"
        slides = next(one for one in self.robot.joints if one.name == sensor.part).kind == "prismatic"
        return f"{name}.{LETTERS[slides][('position', 'speed', 'force').index(sensor.quantity)]}"

    def _named(self, kind: str, name: str) -> str:
        """The name of the component for something of the file."""
        return self.names[f"{kind} {name}"]

    def _free(self, name: str) -> str:
        """The name, or one like it where it is taken."""
        return _not_in({*self.names.values(), *self.members}, name, "part")


def _component_names(robot: RobotDescription) -> dict[str, str]:
    """From `link elbow`, `joint elbow`, `loop pin` to names of components, which are words of Python and all different."""
    every = (("link", robot.links), ("joint", robot.joints), ("loop", robot.loops))
    found: dict[str, str] = {}
    for kind, parts in every:
        for part in parts:
            found[f"{kind} {part.name}"] = _not_in(set(found.values()), _identifier(part.name), kind)
    return found


def _not_in(taken: set[str], name: str, kind: str) -> str:
    """The name; where another component or a Model has it already, with the kind or a number behind it."""
    others = (name, f"{name}_{kind}", *(f"{name}_{kind}_{k}" for k in range(2, len(taken) + 3)))
    return next(other for other in others if other not in taken and not hasattr(DescribedRobot, other))


def _identifier(name: str) -> str:
    found = re.sub(r"\W", "_", name).strip("_") or "part"
    return f"part_{found}" if found[0].isdigit() or iskeyword(found) else found


def _member(robot: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        robot = getattr(robot, name)
    return robot


def _origin(placement: Placement, seen: Mapping[str, bool]) -> Origin:
    return Origin(xyz=list(placement.xyz), rpy=list(placement.rpy), **seen)


def _quaternion(rpy: tuple[float, ...]) -> list[float]:
    """Unit quaternion, scalar first, of roll, pitch and yaw about fixed axes."""
    (a, b, c), (x, y, z) = np.cos(np.divide(rpy, 2)), np.sin(np.divide(rpy, 2))
    return [
        a * b * c + x * y * z,
        x * b * c - a * y * z,
        a * y * c + x * b * z,
        a * b * z - x * y * c,
    ]


def _both(most: float | None) -> dict[str, float]:
    """Limits on both sides."""
    return {} if most is None else dict(min=-most, max=most)


def _closing(loop: LoopJoint) -> Model:
    """The joint that closes a loop; none of its coordinates is a state before those of driven joints."""
    rest = dict(prefer=StateSelect.DEFAULT)
    axis = list(loop.axis)
    match loop.kind:
        case "spherical":
            return Spherical()
        case "universal":
            return Universal(
                n_a=axis, n_b=list(loop.axis_b), first=dict(phi=rest, w=rest), second=dict(phi=rest, w=rest)
            )
        case "revolute":
            return Revolute(n=axis, phi=rest, w=rest)
        case "prismatic":
            return Prismatic(n=axis, s=rest, v=rest)
        case _:
            return Cylindrical(n=axis, s=rest, v=rest, phi=rest, w=rest)
