"""The closure equations of an arm, whose links may hang on turntables, with exact Jacobians.

    A_j = A^0 + q v + R(u1) R(q4) (r2 + R(u2) R(q6) a_j)            (4.16)-(4.24)
    e_j = (|T + R_T B_j - A_j|^2 - L_j^2) / (2 L_j^0), in m         (5.10)-(5.12) by constant weights

An arm has m links, the parameters p are stacked in the order lengths, plate joints, A^0, v, turntables from the cart
outwards, joints on the last turntable; e is (N, m), its Jacobian (N, m, p). Dressler (2012), sections 4.5 and 5.4.
An arm without turntables is one of (4.14), or of (4.13) where the plate cannot turn.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import check_words
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import about, cross, skewed
from gantrytau.language.self_description.rods import RodArm, RodTurntable, SingleRod
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods, read_nominal

Orientation = Literal["local", "unit", "free"]


@dataclass(frozen=True, eq=False)
class ArmClosure(Record):
    """The geometry of one arm, and which of it is unknown.

    said: its parameters by name; cart: the column of its cart in q; columns: those of its turntables;
    orientation: how a quaternion u = (w, r) is unknown. "free": R = I + 2 w [r]x + 2 [r]x^2 with any length of u;
    "unit": the same of u / |u|; "local": R(u) exp([d]x) with three unknowns d, zero here, named `.rotation`.
    values: all vectors by name, m, 1 and scalar-first quaternions; free: names of the unknown ones, in order;
    lengths: L_j^0 of the weights; layout: places of the unknowns, and which are local, worked out.
    """

    said: RodArm
    cart: int
    columns: tuple[int, ...]
    orientation: Orientation
    values: Mapping[str, np.ndarray]
    free: tuple[str, ...]
    lengths: np.ndarray = field(repr=False)
    layout: Mapping[str, tuple[slice, bool]] = field(default_factory=dict, repr=False)

    def __post_init__(self):
        if not self.layout:  # else that of the arm which was moved
            places, start = {}, 0
            for name in self.free:
                size = len(self._elements(name))
                places[name] = slice(start, start + size), self.is_local(name)
                start += size
            object.__setattr__(self, "layout", places)

    @property
    def name(self) -> str:
        """Its path, such as `arms[i]`."""
        return self.said.name

    @property
    def turntables(self) -> tuple[RodTurntable, ...]:
        """From the cart outwards, by name."""
        return tuple(self.said.turntables)

    @property
    def links(self) -> tuple[str, ...]:
        """Paths of its links."""
        return tuple(rod.name for rod in self.said.rods)

    @property
    def turns(self) -> bool:
        """Whether it holds the orientation of a plate."""
        return any(rod.plate_offset is not None for rod in self.said.rods)

    def vector_of(self, name: str | None) -> np.ndarray:
        """A vector by name, zero where there is none."""
        return np.zeros(3) if name is None else self.values[name]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the unknown scalars, the columns of the Jacobian."""
        return tuple(element for name in self.free for element in self._elements(name))

    @property
    def count(self) -> int:
        """How many unknowns there are."""
        return len(self.names)

    def is_local(self, name: str) -> bool:
        """Whether a value is an orientation that is unknown by a local rotation."""
        return self.orientation == "local" and any(name == table.orientation for table in self.turntables)

    def _elements(self, name: str) -> list[str]:
        if self.is_local(name):
            return [f"{name.rpartition('.')[0]}.rotation[{k}]" for k in range(3)]
        size = np.size(self.values[name])
        return [f"{name}[{k}]" for k in range(size)] if self.values[name].ndim else [name]

    @property
    def vector(self) -> np.ndarray:
        """The values of the unknowns, (p,); local rotations are zero."""
        blocks = [np.zeros(3) if self.is_local(name) else self.values[name] for name in self.free]
        return np.concatenate([np.ravel(block) for block in blocks])

    def moved(self, step: np.ndarray) -> "ArmClosure":
        """The arm with its unknowns changed by step, (p,)."""
        values = dict(self.values)
        for name, (place, local) in self.layout.items():
            change = step[place]
            if local:
                values[name] = product(values[name], exponential(change))
            else:
                values[name] = values[name] + change.reshape(values[name].shape)
        return replace(self, values=values)

    def closure(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Closure errors (N, m) in m, and their Jacobian by the unknowns (N, m, p).

        q: (N, n), carts first; r: (N, 3) in m; R: (N, 3, 3), or None for a plate that keeps the orientation I.
        """
        frames = _Frames(self, q)
        errors = np.empty((len(q), len(self.lengths)))
        places = {name: place for name, (place, _) in self.layout.items()}
        jacobian = np.zeros((len(q), len(self.lengths), max(place.stop for place in places.values())))
        for j, rod in enumerate(self.said.rods):
            places_of = frames.places(rod)
            d, length = self._on_plate(rod, r, R) - places_of[0], self.values[rod.length]
            errors[:, j] = (np.einsum("ni,ni->n", d, d) - length**2) / (2 * self.lengths[j])
            g = d / self.lengths[j]
            for name, column in frames.columns(rod, g, R, places_of, -length / self.lengths[j]):
                if name in places:
                    jacobian[:, j, places[name]] = column
        return errors, jacobian

    def errors(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """The closure errors alone, (N, m) in m."""
        d = self.directions(q, r, R)
        lengths = np.array([float(self.values[rod.length]) for rod in self.said.rods]) / self.lengths
        return (np.einsum("nji,nji->nj", d, d) - lengths**2) * self.lengths / 2

    def directions(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """(B_j - A_j) / L_j^0 of all links, the derivatives of the closure errors by T, (N, m, 3)."""
        frames = _Frames(self, q)
        found = []
        for rod, length in zip(self.said.rods, self.lengths, strict=True):
            found.append((self._on_plate(rod, r, R) - frames.places(rod)[0]) / length)
        return np.stack(found, axis=1)

    def _on_plate(self, rod: SingleRod, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """The joint B_j in the world, (N, 3)."""
        on_plate = self.vector_of(rod.plate_offset)
        return r + (on_plate if R is None else R @ on_plate)


class _Frames:
    """The frames of the turntables of an arm at all poses.

    before[k]: rotation of what carries turntable k, (3, 3) or (N, 3, 3); seats[k] = R(u_k); turns[k] = R(q_k), (N, 3, 3).
    """

    def __init__(self, arm: ArmClosure, q: np.ndarray):
        self.arm, self.q = arm, q
        self.cart = arm.vector_of(arm.said.offset) + q[:, arm.cart, None] * arm.values[arm.said.direction]
        self.before, self.seats, self.turns = [np.eye(3)], [], []
        for turntable, column in zip(arm.turntables, arm.columns, strict=True):
            gain = arm.values[f"{turntable.name}.gain"]
            self.seats.append(_seat(arm, turntable))
            self.turns.append(about(arm.values[turntable.axis], gain * q[:, column]))
            self.before.append(self.before[-1] @ self.seats[-1] @ self.turns[-1])

    def places(self, rod: SingleRod) -> list[np.ndarray]:
        """The joint A_j in the world, then turned by each turntable from the cart outwards, each (N, 3)."""
        x = self.arm.vector_of(rod.offset)
        turned = []
        for k in reversed(range(len(self.arm.turntables))):
            y = _forth(self.turns[k], x)
            turned.append(y)
            x = y @ self.seats[k].T + self.arm.values[self.arm.turntables[k].offset]
        return [self.cart + x, *reversed(turned)]

    def columns(
        self, rod: SingleRod, g: np.ndarray, R: np.ndarray | None, places: list[np.ndarray], by_length: float
    ) -> Iterator[tuple[str | None, np.ndarray]]:
        """Derivatives of (|d|^2 - L^2) / (2 L^0) by each vector that the link depends on; g = d / L^0."""
        arm = self.arm
        yield rod.length, np.full((len(g), 1), by_length)
        yield rod.plate_offset, g if R is None else np.einsum("nij,ni->nj", R, g)
        yield arm.said.offset, -g
        yield arm.said.direction, -self.q[:, arm.cart, None] * g
        for k, (turntable, column) in enumerate(zip(arm.turntables, arm.columns, strict=True)):
            h = _back(self.before[k], g)
            yield turntable.offset, -h
            yield turntable.orientation, -_by_orientation(arm, turntable, places[k + 1], h)
            about = cross(places[k + 1], h @ self.seats[k])
            yield (
                f"{turntable.name}.gain",
                -(self.q[:, column] * (about @ arm.values[turntable.axis]))[:, None],
            )
        yield rod.offset, -_back(self.before[-1], g)


def _forth(rotations: np.ndarray, x: np.ndarray) -> np.ndarray:
    return rotations @ x if x.ndim == 1 else np.einsum("nij,nj->ni", rotations, x)


def _back(rotation: np.ndarray, g: np.ndarray) -> np.ndarray:
    return g @ rotation if rotation.ndim == 2 else np.einsum("nij,ni->nj", rotation, g)


def _by_orientation(arm: ArmClosure, turntable: RodTurntable, y: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The row h . d(R(u) y) by the unknowns of the orientation, (N, 4) or (N, 3)."""
    u = arm.values[turntable.orientation]
    if arm.orientation == "local":
        return cross(y, h @ rotation(u))
    norm = np.linalg.norm(u) if arm.orientation == "unit" else 1.0
    w, r = u[0] / norm, u[1:] / norm
    c = cross(y, h)
    by_r = 2 * w * c + 2 * (cross(cross(r, y), h) + cross(y, cross(h, r)))
    rows = np.concatenate([2 * (c @ r)[:, None], by_r], axis=1)
    if arm.orientation == "free":
        return rows
    unit = u / norm
    return (rows - np.outer(rows @ unit, unit)) / norm


def rotation(u: np.ndarray) -> np.ndarray:
    """R = I + 2 w [r]x + 2 [r]x^2 of a scalar-first quaternion, which is a rotation where |u| = 1; (3, 3)."""
    r = skewed(u[1:])
    return np.eye(3) + 2 * u[0] * r + 2 * r @ r


def _seat(arm: ArmClosure, turntable: RodTurntable) -> np.ndarray:
    u = arm.values[turntable.orientation]
    return rotation(u / np.linalg.norm(u) if arm.orientation == "unit" else u)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two scalar-first quaternions."""
    return np.concatenate([
        [a[0] * b[0] - a[1:] @ b[1:]],
        a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:]),
    ])  # fmt: skip


def exponential(turn: np.ndarray) -> np.ndarray:
    """The unit quaternion of a rotation vector in rad."""
    half = np.linalg.norm(turn) / 2
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) / 2 * turn])


def read_arms(
    robot: Model, orientation: Orientation = "local", *, gains: bool = False
) -> tuple[ArmClosure, ...]:
    """The arms of a robot at its own parameters, as its `rods()` says.

    gains: with `turntables[k].gain`, the true angle for one of q, 1 where it is nominal, among the unknowns.
    Unknown are lengths, joints on the plate, offset and direction of guideways, offsets of turntables upon turntables,
    orientations, and joints on the arm; 10, 24 and 38 of an F1 with quaternions. What the robot says is given is not.
    Raises ModelError for a model without `rods()`, another orientation, or a quaternion that is not unit where it has to be.
    """
    check_words(read_arms, locals())
    return arms_of(read_nominal(robot), orientation, gains=gains)


def arms_of(
    nominal: NominalRods, orientation: Orientation = "local", *, gains: bool = False
) -> tuple[ArmClosure, ...]:
    """The same of a robot whose parameters are known."""
    columns = iter(range(len(nominal.arms), len(nominal.rods.joints)))
    found = []
    for cart, arm in enumerate(nominal.arms):
        own = tuple(next(columns) for _ in arm.turntables)
        found.append(_closure_of(arm, cart, own, nominal, orientation, gains))
    return tuple(found)


def _closure_of(
    arm: RodArm,
    cart: int,
    columns: tuple[int, ...],
    nominal: NominalRods,
    orientation: Orientation,
    gains: bool,
) -> ArmClosure:
    rods, tables = arm.rods, arm.turntables
    names = [rod.length for rod in rods] + [rod.plate_offset for rod in rods] + [arm.offset, arm.direction]
    for table in tables:
        names += [table.offset, table.orientation]
    names = [name for name in (*names, *(rod.offset for rod in rods)) if name is not None]
    values = {name: nominal.values[name] for name in (*names, *(table.axis for table in tables))}
    values |= {f"{table.name}.gain": np.array(1.0) for table in tables}
    for table in tables:
        norm = float(np.linalg.norm(values[table.orientation]))
        if orientation != "free" and abs(norm - 1.0) > 1e-9:
            found = f"found a quaternion of length {norm:.6g}, expected 1; normalise it, or take "
            raise ModelError(found, Given("orientation", "free"), place=table.orientation)
    free = [name for name in names if name not in nominal.rods.given]
    free += [f"{table.name}.gain" for table in tables] if gains else []
    lengths = np.array([float(values[rod.length]) for rod in rods])
    return ArmClosure(arm, cart, columns, orientation, values, tuple(free), lengths)
