"""Arms whose links hang on turntables: geometry, and the closure equations with exact Jacobians.

    A_j = A^0 + q v + R(u1) R(q4) (r2 + R(u2) R(q6) a_j)            (4.16)-(4.24)
    e_j = (|T + R_T B_j - A_j|^2 - L_j^2) / (2 L_j^0), in m         (5.10)-(5.12) by constant weights

An arm has m links, the parameters p are stacked in the order lengths, plate joints, A^0, v, turntables from the cart
outwards, joints on the last turntable; e is (N, m), its Jacobian (N, m, p). Dressler (2012), sections 4.5 and 5.4.
An arm without turntables is one of (4.14), or of (4.13) where the plate cannot turn.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError, flatten
from gantrytau.compiler.parameters import parameter_table
from gantrytau.flattening.instantiation import instantiate
from gantrytau.kinematics.rotations import about, cross, skewed

Orientation = Literal["local", "unit", "free"]
ORIENTATIONS = ("local", "unit", "free")
_READ = re.compile(
    r"(arms\[\d+\]|turntables\[\d+\])(\.links\[\d+\])?"
    r"\.(length|offset|direction|plate_offset|orientation|axis)"
)
F1_TURNTABLES = ((), (0,), (1, 2))  # on the carts of arms 1 to 3 (4.20)-(4.24)


@dataclass(frozen=True, eq=False)
class Turntable:
    """A turntable of an arm: its name, its column in q, and the axis it turns about in its own frame, (3,)."""

    name: str
    column: int
    axis: np.ndarray


@dataclass(frozen=True, eq=False)
class Arm:
    """The geometry of one arm, and which of it is unknown.

    name: its path, `arms[i]`; cart: the column of its cart in q; turntables: from the cart outwards; links: paths;
    orientation: how a quaternion u = (w, r) is unknown. "free": R = I + 2 w [r]x + 2 [r]x^2 with any length of u;
    "unit": the same of u / |u|; "local": R(u) exp([d]x) with three unknowns d, zero here, named `.rotation`.
    values: all vectors by name, m, 1 and scalar-first quaternions; free: names of the unknown ones, in order;
    lengths: L_j^0 of the weights.
    """

    name: str
    cart: int
    turntables: tuple[Turntable, ...]
    links: tuple[str, ...]
    orientation: Orientation
    values: Mapping[str, np.ndarray]
    free: tuple[str, ...]
    lengths: np.ndarray = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknown scalars, the columns of the Jacobian."""
        return tuple(element for name in self.free for element in self._elements(name))

    @property
    def count(self) -> int:
        """How many unknowns there are."""
        return len(self.names)

    def _elements(self, name: str) -> list[str]:
        if name.endswith(".orientation") and self.orientation == "local":
            return [f"{name.removesuffix('orientation')}rotation[{k}]" for k in range(3)]
        size = np.size(self.values[name])
        return [f"{name}[{k}]" for k in range(size)] if self.values[name].ndim else [name]

    @property
    def vector(self) -> np.ndarray:
        """The values of the unknowns, (p,); local rotations are zero."""
        blocks = [
            np.zeros(3)
            if name.endswith(".orientation") and self.orientation == "local"
            else self.values[name]
            for name in self.free
        ]
        return np.concatenate([np.ravel(block) for block in blocks])

    def moved(self, step: np.ndarray) -> "Arm":
        """The arm with its unknowns changed by step, (p,)."""
        values, start = dict(self.values), 0
        for name in self.free:
            size = len(self._elements(name))
            change, start = step[start : start + size], start + size
            if name.endswith(".orientation") and self.orientation == "local":
                values[name] = product(values[name], exponential(change))
            else:
                values[name] = values[name] + change.reshape(values[name].shape)
        return replace(self, values=values)

    def closure(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Closure errors (N, m) in m, and their Jacobian by the unknowns (N, m, p).

        q: (N, n), carts first; r: (N, 3) in m; R: (N, 3, 3), or None for a plate that keeps the orientation I.
        """
        frames = _Frames(self, q)
        errors = np.empty((len(q), len(self.links)))
        jacobian = np.zeros((len(q), len(self.links), self.count))
        places = self._places()
        for j, link in enumerate(self.links):
            on_plate = self.values.get(f"{link}.plate_offset", np.zeros(3))
            places_of = frames.places(link)
            d = r + (on_plate if R is None else R @ on_plate) - places_of[0]
            length = self.values[f"{link}.length"]
            errors[:, j] = (np.einsum("ni,ni->n", d, d) - length**2) / (2 * self.lengths[j])
            g = d / self.lengths[j]
            for name, column in frames.columns(link, g, R, places_of):
                if name in places:
                    jacobian[:, j, places[name]] = column
        return errors, jacobian

    def directions(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """(B_j - A_j) / L_j^0 of all links, the derivatives of the closure errors by T, (N, m, 3)."""
        frames = _Frames(self, q)
        found = []
        for j, link in enumerate(self.links):
            on_plate = self.values.get(f"{link}.plate_offset", np.zeros(3))
            d = r + (on_plate if R is None else R @ on_plate) - frames.places(link)[0]
            found.append(d / self.lengths[j])
        return np.stack(found, axis=1)

    def _places(self) -> dict[str, slice]:
        places, start = {}, 0
        for name in self.free:
            size = len(self._elements(name))
            places[name], start = slice(start, start + size), start + size
        return places


class _Frames:
    """The frames of the turntables of an arm at all poses.

    before[k]: rotation of what carries turntable k, (3, 3) or (N, 3, 3); seats[k] = R(u_k); turns[k] = R(q_k), (N, 3, 3).
    """

    def __init__(self, arm: Arm, q: np.ndarray):
        self.arm, self.q = arm, q
        self.cart = (
            arm.values[f"{arm.name}.offset"] + q[:, arm.cart, None] * arm.values[f"{arm.name}.direction"]
        )
        self.before, self.seats, self.turns = [np.eye(3)], [], []
        for turntable in arm.turntables:
            gain = arm.values[f"{turntable.name}.gain"]
            self.seats.append(_seat(arm, turntable))
            self.turns.append(about(turntable.axis, gain * q[:, turntable.column]))
            self.before.append(self.before[-1] @ self.seats[-1] @ self.turns[-1])

    def places(self, link: str) -> list[np.ndarray]:
        """The joint A_j in the world, then turned by each turntable from the cart outwards, each (N, 3)."""
        x = self.arm.values.get(f"{link}.offset", np.zeros(3))
        if link == self.arm.name:  # the one link of an arm is on the cart itself
            x = np.zeros(3)
        turned = []
        for k in reversed(range(len(self.arm.turntables))):
            y = _forth(self.turns[k], x)
            turned.append(y)
            x = y @ self.seats[k].T + self.arm.values[f"{self.arm.turntables[k].name}.offset"]
        return [self.cart + x, *reversed(turned)]

    def columns(
        self, link: str, g: np.ndarray, R: np.ndarray | None, places: list[np.ndarray]
    ) -> Iterator[tuple[str, np.ndarray]]:
        """Derivatives of (|d|^2 - L^2) / (2 L^0) by each vector that the link depends on; g = d / L^0."""
        arm = self.arm
        yield (
            f"{link}.length",
            np.full((len(g), 1), -arm.values[f"{link}.length"] / arm.lengths[arm.links.index(link)]),
        )
        yield f"{link}.plate_offset", g if R is None else np.einsum("nij,ni->nj", R, g)
        yield f"{arm.name}.offset", -g
        yield f"{arm.name}.direction", -self.q[:, arm.cart, None] * g
        for k, turntable in enumerate(arm.turntables):
            h = _back(self.before[k], g)
            yield f"{turntable.name}.offset", -h
            yield f"{turntable.name}.orientation", -_by_orientation(arm, turntable, places[k + 1], h)
            about = cross(places[k + 1], h @ self.seats[k])
            yield f"{turntable.name}.gain", -(self.q[:, turntable.column] * (about @ turntable.axis))[:, None]
        yield f"{link}.offset", -_back(self.before[-1], g)


def _forth(rotations: np.ndarray, x: np.ndarray) -> np.ndarray:
    return rotations @ x if x.ndim == 1 else np.einsum("nij,nj->ni", rotations, x)


def _back(rotation: np.ndarray, g: np.ndarray) -> np.ndarray:
    return g @ rotation if rotation.ndim == 2 else np.einsum("nij,ni->nj", rotation, g)


def _by_orientation(arm: Arm, turntable: Turntable, y: np.ndarray, h: np.ndarray) -> np.ndarray:
    """The row h . d(R(u) y) by the unknowns of the orientation, (N, 4) or (N, 3)."""
    u = arm.values[f"{turntable.name}.orientation"]
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


def _seat(arm: Arm, turntable: Turntable) -> np.ndarray:
    u = arm.values[f"{turntable.name}.orientation"]
    return rotation(u / np.linalg.norm(u) if arm.orientation == "unit" else u)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two scalar-first quaternions."""
    return np.concatenate([
        [a[0] * b[0] - a[1:] @ b[1:]],
        a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]),
    ])  # fmt: skip


def exponential(turn: np.ndarray) -> np.ndarray:
    """The unit quaternion of a rotation vector in rad."""
    half = np.linalg.norm(turn) / 2
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) / 2 * turn])


def read_arms(
    robot: Model,
    orientation: Orientation = "local",
    *,
    gains: bool = False,
    values: Mapping[str, Any] | None = None,
) -> tuple[Arm, ...]:
    """The arms of a model of a Gantry-Tau robot at its own parameters.

    robot: an instance with `arms[i].direction` and one link or `arms[i].links[j]` each, and `turntables` as the F1;
    values: its parameters by name, where they were read before;
    gains: with `turntables[k].gain`, the true angle for one of q, 1 where it is nominal, among the unknowns.
    Unknown are lengths, joints on the plate, offset and direction of guideways, offsets of turntables upon turntables,
    orientations, and joints on the arm; 10, 24 and 38 of an F1 with quaternions. What follows by convention is not:
    joints on a cart where the cart has an offset (4.20), offsets of turntables on carts (4.21).
    Raises ModelError for another model, another orientation, or a quaternion that is not unit where it has to be.
    """
    if orientation not in ORIENTATIONS:
        raise ModelError(
            f"orientation: found {orientation!r}, expected one of {', '.join(map(repr, ORIENTATIONS))}"
        )
    table = _Values(robot, values)
    count = table.how_many("arms[{}].direction")
    turning = table.how_many("turntables[{}].axis")
    if count == 0 or turning not in (0, 3) or (turning and count != 3):
        raise ModelError(
            f"{type(robot).__name__}: found {count} arms with a direction and {turning} turntables, expected arms, and "
            "no turntables or the three of an F1; give a model such as GantryTau, SixLinkGantryTau or F1GantryTau"
        )
    on_arm = F1_TURNTABLES if turning else ((),) * count
    return tuple(_arm(table, i, on_arm[i], count, orientation, gains, bool(turning)) for i in range(count))


class _Values:
    """Parameters of a model by name, vectors too.

    Plain numbers are read as they are declared, five times as quick as flattening the whole model.
    """

    def __init__(self, robot: Model, values: Mapping[str, Any] | None = None):
        self.name, self.values = type(robot).__name__, dict(values or {})
        if self.values:
            return
        try:
            for placed in instantiate(robot).quantities:
                if _READ.fullmatch(placed.name):
                    self.values[placed.name] = np.asarray(placed.attributes["value"].value, dtype=float)
        except (AttributeError, KeyError, TypeError, ValueError):  # an expression of other parameters
            flat = flatten(robot)
            numbers = parameter_table(flat).values
            self.values = {
                each.name: np.array([numbers[n] for n in each.elements]).reshape(each.shape, order="F")
                for each in flat.parameters
            }

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise ModelError(
                f"{self.name}: it has no parameter {name}, which calibration needs; "
                "give a model such as GantryTau, SixLinkGantryTau or F1GantryTau"
            )
        return self.values[name]

    def how_many(self, pattern: str) -> int:
        k = 0
        while pattern.format(k) in self.values:
            k += 1
        return k


def _arm(
    table: _Values,
    i: int,
    turntables: tuple[int, ...],
    carts: int,
    orientation: Orientation,
    gains: bool,
    on_carts: bool,
) -> Arm:
    name = f"arms[{i}]"
    links = tuple(f"{name}.links[{j}]" for j in range(table.how_many(name + ".links[{}].length"))) or (name,)
    tables = [f"turntables[{k}]" for k in turntables]
    whole = links == (name,)  # one link per arm, and a plate that cannot turn
    names = [f"{link}.length" for link in links]
    names += [] if whole else [f"{link}.plate_offset" for link in links]
    names += [f"{name}.offset", f"{name}.direction"]
    for each in tables:
        names += [f"{each}.orientation"] if each == tables[0] else [f"{each}.offset", f"{each}.orientation"]
    names += [] if whole else [f"{link}.offset" for link in links]
    fixed = [] if whole else [f"{link}.offset" for link in links] if on_carts and not tables else []
    fixed += [] if whole or on_carts else [f"{name}.offset"]
    values = {each: np.asarray(table[each]) for each in (*names, *(f"{t}.offset" for t in tables))}
    values |= {f"{each}.gain": np.array(1.0) for each in tables}
    free = [each for each in names if each not in fixed] + (
        [f"{each}.gain" for each in tables] if gains else []
    )
    for each in tables:
        norm = float(np.linalg.norm(values[f"{each}.orientation"]))
        if orientation != "free" and abs(norm - 1.0) > 1e-9:
            raise ModelError(
                f"{each}.orientation: found a quaternion of length {norm:.6g}, expected 1; normalise it, or say "
                "orientation='free'"
            )
    return Arm(
        name=name,
        cart=i,
        turntables=tuple(
            Turntable(each, carts + k, np.asarray(table[f"{each}.axis"]))
            for each, k in zip(tables, turntables, strict=True)
        ),
        links=links,
        orientation=orientation,
        values=values,
        free=tuple(free),
        lengths=np.array([float(values[f"{link}.length"]) for link in links]),
    )
