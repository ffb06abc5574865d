"""Shapes as solids: unit cylinders, balls, cuboids, cones with a place, an orientation and a size at each picture."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.self_description.appearance import (
    Ball,
    Cloud,
    Cuboid,
    ForceArrow,
    Hinge,
    Lump,
    MeshFile,
    PathLine,
    RoundBar,
    Shape,
    Slideway,
    Stick,
    Triad,
)
from gantrytau.viewing.film import Film

STEEL = 7800.0  # kg/m3
THIN = 1 / 130  # of the size of a picture: the radius of bars
LONGEST = 0.22  # of the size of a picture: the largest force
COLOURS = dict(
    bar=(70, 100, 150),
    ground=(150, 156, 164),
    ball=(40, 46, 56),
    body=(86, 128, 196),
    drive=(230, 120, 10),
    force=(190, 20, 110),
    path=(0, 130, 90),
    limit=(225, 20, 20),
    around=(176, 150, 100),
)
DOTS = 20_000  # of a cloud, at most


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid of a kind: cylinder (along z), ball, cuboid, cone (along z, its base at the place), axes, mesh, or a line
    or dots at all its places.

    owner: path of its component; r (N, 3) m, R (N, 3, 3), size (N, 3) m: diameters or edges along R.
    """

    owner: str
    kind: str
    role: str
    r: np.ndarray
    R: np.ndarray
    size: np.ndarray
    file: Path | None = None

    @property
    def rests(self) -> bool:
        """Whether it does not move, where anything may."""
        return len(self.r) > 1 and all(np.ptp(x, axis=0).max() < 1e-9 for x in (self.r, self.R, self.size))


def extent(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """The corners (3,) and (3,) in m of the box that holds all places of all times."""
    places = []
    for shape in (*film.shapes, *film.around):
        places += [
            film.values(v, (3,)) for key in ("a", "b", "at") if (v := getattr(shape, key, None)) is not None
        ]
        if isinstance(shape, Cloud):
            places.append(shape.places)
        if isinstance(shape, Cuboid) and not isinstance(shape.size, (int, float)):
            half = np.abs(film.rotations(shape.R)) @ film.values(shape.size, (3,))[..., None] / 2
            places += [places[-1] - half[..., 0], places[-1] + half[..., 0]]
    if film.ghost is not None:
        places.append(np.array(extent(film.ghost)))
    every = np.concatenate(places)
    return every.min(axis=0), every.max(axis=0)


def ghosts(film: Film) -> Iterator[Solid]:
    """The solids of the ghost of a film that move."""
    if film.ghost is not None:
        yield from (solid for solid in solids(film.ghost, film) if not solid.rests)


def solids(film: Film, beside: Film | None = None) -> Iterator[Solid]:
    """The visible solids of a film; shapes without extent are left out. `beside`: another film that sets the scale."""
    low, high = extent(film if beside is None else beside)
    size = float(np.linalg.norm(high - low)) or 1.0
    arrows = (_force(film, shape) for shape in film.shapes if isinstance(shape, ForceArrow))
    largest = max((float(np.linalg.norm(f, axis=1).max()) for f in arrows), default=0.0)
    scene = _Scene(film, size, size * THIN, largest)
    for shape in film.shapes:
        for solid in scene.solids(shape):
            yield replace(solid, role="ground") if solid.role == "bar" and solid.rests else solid
    for shape in film.around:
        for solid in scene.solids(shape):
            yield replace(solid, role="around")


@dataclass(frozen=True, eq=False)
class _Scene:
    film: Film
    size: float  # m, of the whole
    thin: float  # m, radius of bars
    force: float  # N, the largest

    def solids(self, shape: Shape) -> Iterator[Solid]:
        ways: dict[type, Callable[[Any], Iterator[Solid]]] = {
            Stick: self._stick,
            Ball: self._ball,
            Cuboid: self._cuboid,
            RoundBar: self._cylinder,
            Lump: self._lump,
            Hinge: self._hinge,
            Slideway: self._slideway,
            ForceArrow: self._force,
            PathLine: self._path,
            Triad: self._axes,
            Cloud: self._cloud,
            MeshFile: self._mesh,
        }
        yield from ways[type(shape)](shape)

    def _stick(self, shape: Stick) -> Iterator[Solid]:
        a, b = self.film.values(shape.a, (3,)), self.film.values(shape.b, (3,))
        radius = self.thin if shape.radius is None else _not_negative(shape, self.film.values(shape.radius))
        yield from self._bar(shape, "bar", a, b, radius)

    def _bar(self, shape: Shape, role: str, a: np.ndarray, b: np.ndarray, radius: Any) -> Iterator[Solid]:
        """A cylinder from a (N, 3) to b (N, 3), if they are apart."""
        length = np.linalg.norm(b - a, axis=1)
        if length.max() > 1e-6 * self.size:
            yield Solid(
                shape.owner,
                "cylinder",
                role,
                (a + b) / 2,
                along(b - a),
                _sizes(2 * radius, 2 * radius, length),
            )

    def _ball(self, shape: Ball) -> Iterator[Solid]:
        r = self._middle(shape)
        if shape.radius is not None:
            diameter = 2 * _not_negative(shape, self.film.values(shape.radius))
        elif shape.mass is not None:
            diameter = np.cbrt(6 * _not_negative(shape, self.film.values(shape.mass)) / (np.pi * STEEL))
        else:
            diameter = np.full(len(r), 3 * self.thin)
        if diameter.max() > 0:
            role = "ball" if shape.mass is None else "body"
            yield Solid(shape.owner, "ball", role, r, _no_turn(r), _sizes(diameter, diameter, diameter))

    def _cuboid(self, shape: Cuboid) -> Iterator[Solid]:
        cube = shape.size if isinstance(shape.size, (int, float)) else None
        size = self.film.values(shape.size if cube is None else [self.thin * cube] * 3, (3,))
        role = "body" if cube is None else "drive"
        yield Solid(shape.owner, "cuboid", role, self._middle(shape), self._axes_of(shape), size)

    def _cylinder(self, shape: RoundBar) -> Iterator[Solid]:
        radius, length = (_not_negative(shape, self.film.values(x)) for x in (shape.radius, shape.length))
        sizes = _sizes(2 * radius, 2 * radius, length)
        yield Solid(shape.owner, "cylinder", "body", self._middle(shape), self._axes_of(shape), sizes)

    def _middle(self, shape: Ball | Cuboid | RoundBar | MeshFile) -> np.ndarray:
        """Its place and its offset from there, (N, 3)."""
        return self.film.values(shape.at, (3,)) + self.film.turned(shape.R, shape.offset)

    def _axes_of(self, shape: Cuboid | RoundBar | MeshFile) -> np.ndarray:
        """Its own axes in the world, (N, 3, 3)."""
        R = self.film.rotations(shape.R)
        return R if shape.turn is None else R @ shape.turn

    def _lump(self, shape: Lump) -> Iterator[Solid]:
        mass, J = self.film.values(shape.mass)[0], self.film.values(shape.J, (3, 3))[0]
        if mass <= 0:
            return
        moments, axes = np.linalg.eigh(J)
        axes[:, 2] *= np.linalg.det(axes)
        # moments of a cuboid: m (b^2 + c^2) / 12 and so on
        squares = 6 * (moments.sum() - 2 * moments) / mass
        edges = np.maximum(np.sqrt(np.maximum(squares, 0)), self.thin)
        R = self.film.rotations(shape.R)
        r = self.film.values(shape.at, (3,)) + self.film.turned(shape.R, shape.r_cm)
        yield Solid(shape.owner, "cuboid", "body", r, R @ axes, np.broadcast_to(edges, r.shape))

    def _hinge(self, shape: Hinge) -> Iterator[Solid]:
        r, axis = self.film.values(shape.at, (3,)), self.film.turned(shape.R, shape.axis)
        half = 3 * self.thin * _unit(shape, axis)
        yield from self._bar(shape, "ball", r - half, r + half, 1.6 * self.thin)

    def _slideway(self, shape: Slideway) -> Iterator[Solid]:
        s = self.film.values(shape.coordinate)
        margin = 0.05 * self.size
        r, way = self.film.values(shape.at, (3,)), self.film.turned(shape.R, shape.direction)
        if shape.slides:
            r = r - s[:, None] * way
        ends = r + (s.min() - margin) * way, r + (s.max() + margin) * way
        yield from self._bar(shape, "bar", *ends, 0.7 * self.thin)

    def _force(self, shape: ForceArrow) -> Iterator[Solid]:
        if self.force <= 0:
            return
        arrow = _force(self.film, shape) / self.force * LONGEST * self.size
        length = np.linalg.norm(arrow, axis=1)
        if length.max() <= 1e-3 * self.size:
            return
        r, head = self.film.values(shape.at, (3,)), np.minimum(7 * self.thin, length)
        towards = arrow / np.maximum(length, 1e-12)[:, None]
        yield from self._bar(shape, "force", r, r + arrow - towards * head[:, None], 0.9 * self.thin)
        sizes = _sizes(0.6 * head, 0.6 * head, head)
        yield Solid(shape.owner, "cone", "force", r + arrow - towards * head[:, None], along(arrow), sizes)

    def _path(self, shape: PathLine) -> Iterator[Solid]:
        r = self.film.values(shape.at, (3,))
        if np.ptp(r, axis=0).max() > 1e-6 * self.size:
            yield Solid(shape.owner, "line", "path", r, _no_turn(r), np.ones_like(r))

    def _axes(self, shape: Triad) -> Iterator[Solid]:
        r = self.film.values(shape.at, (3,))
        yield Solid(shape.owner, "axes", "bar", r, self.film.rotations(shape.R), np.full_like(r, self.size))

    def _cloud(self, shape: Cloud) -> Iterator[Solid]:
        r = shape.places[:: -(-len(shape.places) // DOTS) or 1]
        if len(r):
            yield Solid(shape.owner, "dots", "path", r, _no_turn(r), np.full_like(r, shape.size))

    def _mesh(self, shape: MeshFile) -> Iterator[Solid]:
        r = self._middle(shape)
        size = np.broadcast_to(np.asarray(shape.scale, dtype=float), r.shape)
        yield Solid(shape.owner, "mesh", "body", r, self._axes_of(shape), size, file=Path(shape.file))


def _force(film: Film, shape: ForceArrow) -> np.ndarray:
    """A force in the world, (N, 3) in N."""
    if shape.direction is None:
        return film.turned(shape.R, shape.force)
    way = film.turned(shape.R, shape.direction)
    return _unit(shape, way) * film.values(shape.force)[:, None]


def _unit(shape: Shape, way: np.ndarray) -> np.ndarray:
    """Directions (N, 3) of length 1; ModelError where there is none."""
    length = np.linalg.norm(way, axis=1, keepdims=True)
    if length.min() <= 0:
        raise ModelError(
            f"{shape.owner or 'the model'}: found the direction [0, 0, 0] of a {type(shape).__name__}, expected another"
        )
    return way / length


def _not_negative(shape: Shape, size: np.ndarray) -> np.ndarray:
    """Radii or masses; ModelError where one is below 0."""
    if size.min() < 0:
        kind, place = type(shape).__name__, shape.owner or "the model"
        raise ModelError(
            f"{place}: found the radius or mass {size.min():g} of a {kind}, expected none below 0"
        )
    return size


def along(way: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) that turn z into the directions (N, 3), by the shortest way; any where there is none."""
    length = np.linalg.norm(way, axis=1, keepdims=True)
    z = np.where(length > 1e-12, way / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])
    # an axis across that is far from z
    least = np.eye(3)[np.argmin(np.abs(z), axis=1)]
    x = np.cross(least, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _sizes(x: Any, y: Any, z: Any) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, y, z), axis=1).astype(float)


def _no_turn(r: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.eye(3), (len(r), 3, 3))
