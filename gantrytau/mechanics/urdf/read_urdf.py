"""`read_urdf`: a robot from a URDF file as a class of components, with loops closed that URDF cannot state."""

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
from gantrytau.mechanics.urdf.loop_file import Closure, LoopJoint, read_closure
from gantrytau.mechanics.urdf.urdf_file import Placement, UrdfJoint, UrdfLink, UrdfTree, read_tree
from gantrytau.mechanics.urdf.urdf_parts import (
    LinkBody,
    LinkFrame,
    Origin,
    PlanarJoint,
    SlideBySlide,
    SlideByTurn,
    TurnBySlide,
    TurnByTurn,
)
from gantrytau.mechanics.urdf.visual_shapes import MeshFolders, shapes_of_link

Way = tuple[str, ...]
FOLLOWERS = {  # whether it slides, and whether the one that it follows does
    (False, False): TurnByTurn,
    (False, True): TurnBySlide,
    (True, False): SlideByTurn,
    (True, True): SlideBySlide,
}


class UrdfRobot(Model):
    """Base of robots from URDF files. `names`: from the names of the file, `link elbow`, to those of components."""

    placement = Origin()
    world = World()
    names: Mapping[str, str] = {}
    wires: tuple[tuple[Way, Way], ...] = ()

    if TYPE_CHECKING:  # its links and joints are known when the file is read

        def __getattr__(self, name: str) -> Any: ...

    def equations(self):
        for a, b in self.wires:
            yield connect(_member(self, a), _member(self, b))


def read_urdf(
    file: str | os.PathLike[str],
    loops: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    *,
    packages: Mapping[str, str | os.PathLike[str]] | None = None,
    driven: list[str] | tuple[str, ...] | None = None,
) -> type[UrdfRobot]:
    """The robot of a URDF file as a class: `Arm = read_urdf("arm.urdf")`, `simulate(Arm(), stop=1.0)`.

    Links are components of their names with `r`, `v`, `w`, and `m`, `r_cm`, `J` where they have a mass; joints have `phi`,
    `w`, `tau` or `s`, `v`, `f`, with the limits of the file; `Arm.names` has both where a name had to be changed. A joint q
    that is driven has the input `q_drive.tau`, or `.f`, and `q_friction` if the file says <dynamics>; `placement` puts the
    base anywhere, `Arm(placement=dict(xyz=[0, 0, 1]))`. The base link stands in the world.

    loops: what closes the tree, a TOML file or its content, see `gantrytau/mechanics/README.md`; packages: folders of what
    is written `package://name/`; driven: names of joints, else those of the loop file, of <transmission>, or all that move
    and follow no other. Meshes that are not found, or not STL, OBJ, PLY, GLB, are not drawn; <collision> is not read.
    Raises ModelError for files that are no URDF, no tree, or miss numbers. https://wiki.ros.org/urdf/XML
    """
    tree = read_tree(file)
    closure = read_closure(loops, tree)
    plan = _Plan(tree, closure, _driven(tree, closure, driven))
    folders = MeshFolders(tree.file, {} if packages is None else packages)
    for link in tree.links:
        plan.add_link(link, folders)
    plan.wire(("world", "frame_b"), ("placement", "frame_a"))
    plan.wire(("placement", "frame_b"), plan.frame(tree.root))
    for joint in tree.joints:
        plan.add_joint(joint)
    for loop in closure.loops:
        plan.add_loop(loop)
    return plan.robot()


def _driven(tree: UrdfTree, closure: Closure, asked: Any) -> set[str]:
    """Names of the joints that have a drive."""
    moving = [joint.name for joint in tree.joints if joint.moves]
    if asked is not None:
        if isinstance(asked, str) or not set(asked) <= set(moving):
            raise ModelError(
                f"read_urdf: found driven={asked!r}, expected a list of joints that move, of {', '.join(moving)}",
                argument="driven",
            )
        return set(asked)
    if closure.driven is not None:
        return set(closure.driven)
    free = {joint.name for joint in tree.joints if joint.moves and joint.mimic is None}
    return (set(tree.driven) & set(moving)) or free


@dataclass(frozen=True)
class _Plan:
    """The members of the class, and what is connected with what, as they come together."""

    tree: UrdfTree
    closure: Closure
    driven: set[str]
    members: dict[str, Any] = field(default_factory=dict)
    wires: list[tuple[Way, Way]] = field(default_factory=list)

    @cached_property
    def names(self) -> dict[str, str]:
        """Names of components, from those of the file."""
        return _component_names(self.tree, self.closure)

    def wire(self, a: Way, b: Way) -> None:
        self.wires.append((a, b))

    def frame(self, link: str) -> Way:
        """The frame of a link."""
        return self._named("link", link), "frame_a"

    def add_link(self, link: UrdfLink, folders: MeshFolders) -> None:
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

    def add_joint(self, joint: UrdfJoint) -> None:
        name = self._named("joint", joint.name)
        parent, child = self.frame(joint.parent), self.frame(joint.child)
        if joint.kind == "floating":
            return self._float(joint)
        seen = dict(drawn=not any(link.visuals for link in self.tree.links))
        if joint.kind == "fixed":
            self.members[name] = _origin(joint.placement, seen)
            self.wire(parent, (name, "frame_a"))
            return self.wire((name, "frame_b"), child)
        origin = self._free(f"{name}_origin")
        self.members[origin] = _origin(joint.placement, seen)
        self.members[name] = self._moving(joint, seen)
        self.wire(parent, (origin, "frame_a"))
        self.wire((origin, "frame_b"), (name, "frame_a"))
        self.wire((name, "frame_b"), child)
        if joint.moves:
            self._attach(joint, name)
        return None

    def _float(self, joint: UrdfJoint) -> None:
        """A link that flies: it starts where its origin says, seen from the base."""
        link = self._named("link", joint.child)
        if not isinstance(self.members[link], LinkBody):
            raise self.tree.refusal(
                f"joint '{joint.name}' on which link '{joint.child}' without a mass floats",
                "an <inertial> of it",
            )
        self.members[link] = self.members[link].modified(dict(r=dict(start=list(joint.placement.xyz))))

    def _moving(self, joint: UrdfJoint, seen: dict[str, bool]) -> Model:
        axis = list(joint.axis)
        if joint.kind == "planar":
            n = np.array(axis) / np.linalg.norm(axis)
            across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
            across /= np.linalg.norm(across)
            return PlanarJoint(n=axis, n_x=list(across), n_y=list(np.cross(n, across)), **seen)
        coordinate, speed, force = ("s", "v", "f") if joint.kind == "prismatic" else ("phi", "w", "tau")
        values: dict[str, Any] = {coordinate: {}, speed: _both(joint.velocity), force: _both(joint.effort)}
        start = dict(self.closure.start).get(joint.name)
        if joint.limits is not None:
            low, high = joint.limits
            values[coordinate] = dict(min=low, max=high)
            start = min(max(0.0, low), high) or None if start is None else start
        if start is not None:
            values[coordinate]["start"] = start
            # where a loop starts is said by what drives it, the rest follows
            values[coordinate]["fixed"] = bool(self.closure.loops) and joint.name in self.driven
        if self.closure.loops and joint.name not in self.driven:
            for one in (coordinate, speed):
                values[one]["prefer"] = StateSelect.DEFAULT
        kind = Prismatic if joint.kind == "prismatic" else Revolute
        return kind(n=axis, **{key: value for key, value in values.items() if value}, **seen)

    def _attach(self, joint: UrdfJoint, name: str) -> None:
        """Components at the axis of a joint: drive, friction, the joint that it follows."""
        slides = joint.kind == "prismatic"
        if joint.name in self.driven:
            drive = self._free(f"{name}_drive")
            self.members[drive] = translational.Force() if slides else rotational.Torque()
            self.wire((drive, "flange"), (name, "axis"))
        if joint.damping or joint.friction:
            friction = self._free(f"{name}_friction")
            self.members[friction] = (
                translational.TanhFriction(f_c=joint.friction, f_v=joint.damping)
                if slides
                else rotational.TanhFriction(tau_c=joint.friction, tau_v=joint.damping)
            )
            self.wire((friction, "flange"), (name, "axis"))
        if joint.mimic is None:
            return
        other = next((one for one in self.tree.joints if one.name == joint.mimic[0]), joint)
        if not other.moves or other is joint:
            raise self.tree.refusal(
                f"joint '{joint.name}' which mimics '{other.name}', a {other.kind} joint",
                "another one that moves in one coordinate",
            )
        follower = self._free(f"{name}_mimic")
        _, multiplier, offset = joint.mimic
        kind = FOLLOWERS[slides, other.kind == "prismatic"]
        self.members[follower] = kind(multiplier=multiplier, offset=offset)
        self.wire((follower, "flange_a"), (name, "axis"))
        self.wire((follower, "flange_b"), (self._named("joint", other.name), "axis"))

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

    def robot(self) -> type[UrdfRobot]:
        """The class."""
        content = dict(
            __doc__=f"{self.tree.name}, from {os.path.basename(self.tree.file)}.",
            __module__=__name__,
            names={key: value for key, value in self.names.items() if key.partition(" ")[2] != value},
            wires=tuple(self.wires),
        )
        title = "".join(word.capitalize() for word in _identifier(self.tree.name).split("_"))
        made: Any = type(title, (UrdfRobot,), {**self.members, **content})
        return made

    def _named(self, kind: str, name: str) -> str:
        """The name of the component for something of the file."""
        return self.names[f"{kind} {name}"]

    def _free(self, name: str) -> str:
        """The name, or one like it where it is taken."""
        return _not_in({*self.names.values(), *self.members}, name, "part")


def _component_names(tree: UrdfTree, closure: Closure) -> dict[str, str]:
    """From `link elbow`, `joint elbow`, `loop pin` to names of components, which are words of Python and all different."""
    every = (("link", tree.links), ("joint", tree.joints), ("loop", closure.loops))
    found: dict[str, str] = {}
    for kind, parts in every:
        for part in parts:
            found[f"{kind} {part.name}"] = _not_in(set(found.values()), _identifier(part.name), kind)
    return found


def _not_in(taken: set[str], name: str, kind: str) -> str:
    """The name, or with the kind or a number behind it where it is taken, or is that of something of all models."""
    others = (name, f"{name}_{kind}", *(f"{name}_{kind}_{k}" for k in range(2, len(taken) + 3)))
    return next(other for other in others if other not in taken and not hasattr(UrdfRobot, other))


def _identifier(name: str) -> str:
    found = re.sub(r"\W", "_", name).strip("_") or "part"
    return f"part_{found}" if found[0].isdigit() or iskeyword(found) else found


def _member(robot: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        robot = getattr(robot, name)
    return robot


def _origin(placement: Placement, seen: Mapping[str, bool]) -> Origin:
    return Origin(xyz=list(placement.xyz), rpy=list(placement.rpy), **seen)


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
