"""What components look like, by the names of their places: for pictures and animations, which know no component.

A model says it in a method `shapes()`, as this rod does:

    def shapes(self):
        yield Stick("frame_a.r", "frame_b.r")

Names are those of quantities of the component; numbers are places in the world, in m; a place is also three of either,
`("x", 0.0, "y")`. With `drawn=False` a component is not shown, nor what is in it. z is up.
"""

import inspect
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from types import FunctionType
from typing import Any, ClassVar

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record

Value = str | float | Sequence[float | str] | np.ndarray


@dataclass(frozen=True)
class Shape(Record):
    """Something to be seen. Its fields that are texts are names of quantities, lengths in m.

    owner: path of the component that it belongs to, from the one that says it; it turns red while that is at a limit.
    """

    owner: str = ""
    texts: ClassVar[tuple[str, ...]] = ("owner",)  # fields that are no names

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the quantities that it needs."""
        fields_of_names = (
            getattr(self, field.name) for field in fields(self) if field.name not in self.texts
        )
        parts = (part for value in fields_of_names for part in (value if _several(value) else [value]))
        return tuple(part for part in parts if isinstance(part, str))

    def within(self, path: str) -> "Shape":
        """The same with the names of the whole model, for a component at that path."""
        kept = set(self.texts) - {"owner"}
        found = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in kept}
        return replace(self, **{name: _placed(value, path) for name, value in found.items()})


def _several(value: Any) -> bool:
    return isinstance(value, (list, tuple))


def _placed(value: Any, path: str) -> Any:
    """A name, or names in a list, as seen from outside of the component at that path."""
    if _several(value):
        return tuple(_placed(part, path) for part in value)
    if not isinstance(value, str) or not path:
        return value
    return f"{path}.{value}" if value else path


@dataclass(frozen=True, kw_only=True)
class Stick(Shape):
    """A round bar from one place to another, each (3,) in m; radius: that of all bars of a picture unless given."""

    a: Value
    b: Value
    radius: float | str | None = None


@dataclass(frozen=True, kw_only=True)
class Ball(Shape):
    """A ball at a place. mass: kg, of which its size is taken, as that of a ball of steel, if it has no radius; offset: (3,)
    in m, of its middle, along R (3, 3).
    """

    at: Value
    radius: float | str | None = None
    mass: float | str | None = None
    R: str | np.ndarray | None = None
    offset: Value = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Cuboid(Shape):
    """A cuboid about a place, its edges along the columns of R (3, 3), a name or numbers; size: of its edges, (3,) in m, or
    one number for a cube that is so many radii of bars long; offset: (3,) in m, of its middle, along R; turn: (3, 3), its
    own axes in R.
    """

    at: Value
    size: Value
    R: str | np.ndarray | None = None
    offset: Value = (0.0, 0.0, 0.0)
    turn: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True)
class RoundBar(Shape):
    """A round bar whose middle is at a place, along the third axis of R (3, 3): radius and length in m; offset: (3,) in m,
    of its middle, along R; turn: (3, 3), its own axes in R.
    """

    at: Value
    radius: float | str
    length: float | str
    R: str | np.ndarray | None = None
    offset: Value = (0.0, 0.0, 0.0)
    turn: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True)
class Lump(Shape):
    """A rigid body as the cuboid of the same mass (kg) and inertia J (3, 3) in kg.m2 about its centre r_cm, along R."""

    at: Value
    R: str
    mass: str
    r_cm: str
    J: str


@dataclass(frozen=True, kw_only=True)
class Hinge(Shape):
    """A short bar across, about which something turns: at a place, along an axis (3,) in the axes R (3, 3)."""

    at: Value
    axis: Value
    R: str | None = None


@dataclass(frozen=True, kw_only=True)
class Slideway(Shape):
    """A straight guideway through a place, along `direction` (3,) in the axes R, as far as `coordinate` goes, whose unit
    moves what slides by `direction`. slides: whether the place is what slides, or where the coordinate is 0.
    """

    at: Value
    direction: Value
    coordinate: str
    R: str | None = None
    slides: bool = False


@dataclass(frozen=True, kw_only=True)
class ForceArrow(Shape):
    """A force as an arrow at a place, along the axes R: its elements (3,) in N, or its value along `direction` (3,)."""

    at: Value
    force: str
    direction: Value | None = None
    R: str | None = None


@dataclass(frozen=True, kw_only=True)
class PathLine(Shape):
    """The way that a place takes."""

    at: Value


@dataclass(frozen=True, kw_only=True)
class Triad(Shape):
    """The axes R (3, 3) of a frame at a place: x red, y green, z blue."""

    at: Value
    R: str


@dataclass(frozen=True, kw_only=True)
class Cloud(Shape):
    """Places, (k, 3) in m, as dots of that size in m."""

    places: np.ndarray
    size: float


@dataclass(frozen=True, kw_only=True)
class MeshFile(Shape):
    """A mesh of one's own: a file that trimesh reads (STL, OBJ, PLY, GLB), its axes along R (3, 3); scale: m per unit, one
    number, or three along its axes; offset: (3,) in m, of its origin, along R; turn: (3, 3), its own axes in R.
    """

    file: str
    at: Value
    R: str | None = None
    scale: Value = 1.0
    offset: Value = (0.0, 0.0, 0.0)
    turn: np.ndarray | None = None
    texts: ClassVar[tuple[str, ...]] = ("owner", "file")


def shapes_of(components: Iterable[tuple[str, Any]], known: Iterable[str]) -> tuple[Shape, ...]:
    """The shapes of the components of a model, by their paths; known: names of its quantities.

    Raises ModelError for what is no shape, and for names that do not exist.
    """
    names, hidden = set(known), []
    found: list[Shape] = []
    for path, component in components:  # whoever holds another comes first
        beneath = any(path.startswith(f"{above}." if above else "") for above in hidden)
        if beneath or getattr(component, "drawn", True) is False:
            hidden.append(path)
            continue
        for shape in _stated(component, path):
            placed = shape.within(path)
            for name in placed.names:
                if name not in names:
                    raise ModelError(
                        f"{path or 'the model'} ({type(component).__name__}).shapes: found '{name}', expected the name of "
                        f"a quantity{did_you_mean(name, names)}"
                    )
            found.append(placed)
    return tuple(found)


def _stated(component: Any, path: str) -> Iterator[Shape]:
    if not isinstance(inspect.getattr_static(type(component), "shapes", None), FunctionType):
        return
    found = component.shapes()
    for shape in found if isinstance(found, Iterable) else [found]:
        if not isinstance(shape, Shape):
            raise ModelError(
                f"{path or 'the model'} ({type(component).__name__}).shapes: found {shape!r}, expected shapes, as "
                'Stick(a="frame_a.r", b="frame_b.r")'
            )
        yield shape
