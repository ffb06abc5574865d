"""Where the ball joints of a robot are in given poses, from the parameters of its model by their names.

Links of Gantry-Tau robots: of the three-link robot (4.8), one by one (4.14), and on turntables (4.20) to (4.23).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gantrytau.errors import ModelError
from gantrytau.flat_model import FlatModel
from gantrytau.flattening import flatten
from gantrytau.model import Model
from gantrytau.parameters import parameter_table


@dataclass(frozen=True)
class Links:
    """The m links of a robot with n carts.

    arms: the arm of each link, (m,); lengths: (m,) in m; offsets, directions: guideway of each arm, (n, 3); on_arm: joint
    in the frame of cart or turntable, (m, 3); on_plate: joint in plate axes, (m, 3); turntables: those of each arm, from
    the cart outwards, as (number among the joints, offset (3,), seat (3, 3), axis (3,)); strokes: limits of the carts
    in the model, (n, 2) in m, infinite where it has none; home: start of the tool, (3,) and (3, 3).
    """

    name: str
    arms: np.ndarray
    lengths: np.ndarray
    offsets: np.ndarray
    directions: np.ndarray
    on_arm: np.ndarray
    on_plate: np.ndarray
    turntables: tuple[tuple[tuple[int, np.ndarray, np.ndarray, np.ndarray], ...], ...]
    strokes: np.ndarray
    home: tuple[np.ndarray, np.ndarray]

    @property
    def single(self) -> bool:
        """Whether each arm is a single link that ends in the tool point."""
        return len(self.lengths) == len(self.offsets) and not self.on_plate.any()

    def cart_frames(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origin (N, m, 3) and orientation (N, m, 3, 3) of what carries each link, for actuators q (N, n)."""
        number = len(self.offsets)
        origin = self.offsets + q[:, :number, None] * self.directions
        turned = np.broadcast_to(np.eye(3), (*origin.shape, 3)).copy()
        for arm, chain in enumerate(self.turntables):
            for joint, offset, seat, axis in chain:
                origin[:, arm] += turned[:, arm] @ offset
                turned[:, arm] = turned[:, arm] @ seat @ _rotations(axis, q[:, number + joint])
        return origin[:, self.arms], turned[:, self.arms]

    def joints(self, q: np.ndarray, r: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints on the carts and on the plate in the world, (N, m, 3) each, in m."""
        origin, turned = self.cart_frames(q)
        on_cart = origin + np.einsum("nmij,mj->nmi", turned, self.on_arm)
        return on_cart, r[:, None] + np.einsum("nij,mj->nmi", R, self.on_plate)


def links_of(robot: Model) -> Links:
    """The links of a model instance such as GantryTau(prototypes.L1); ModelError if it has none of these names."""
    flat = flatten(robot)
    values = parameter_table(flat).values
    count = _count(values, "arms[{}].direction[0]")
    if not count or not ("arms[0].length" in values or "arms[0].links[0].length" in values):
        raise ModelError(
            f"{flat.name}: found no 'arms[i].direction' with 'arms[i].length' or 'arms[i].links[j].length', expected a "
            "robot of carts and links such as GantryTau(prototypes.L1)"
        )
    single = "arms[0].length" in values
    offsets = np.array([_array(values, f"arms[{i}].offset", 3) for i in range(count)])
    directions = np.array([_array(values, f"arms[{i}].direction", 3) for i in range(count)])
    if single:
        names = [(i, f"arms[{i}]") for i in range(count)]
        on_arm = on_plate = np.zeros((count, 3))
    else:
        per_arm = [_count(values, f"arms[{i}].links[{{}}].length") for i in range(count)]
        names = [(i, f"arms[{i}].links[{j}]") for i in range(count) for j in range(per_arm[i])]
        on_arm = np.array([_array(values, f"{name}.offset", 3) for _, name in names])
        on_plate = np.array([_array(values, f"{name}.plate_offset", 3) for _, name in names])
    return Links(
        name=flat.name,
        arms=np.array([arm for arm, _ in names]),
        lengths=np.array([values[f"{name}.length"] for _, name in names]),
        offsets=offsets,
        directions=directions,
        on_arm=on_arm,
        on_plate=on_plate,
        turntables=_turntables(values, count),
        strokes=_strokes(flat, count),
        home=_home(flat),
    )


def _count(values: Mapping[str, float], pattern: str) -> int:
    found = 0
    while pattern.format(found) in values:
        found += 1
    return found


def _array(values: Mapping[str, float], name: str, size: int) -> np.ndarray:
    return np.array([values[f"{name}[{k}]"] for k in range(size)])


def _turntables(values: Mapping[str, float], arms: int) -> tuple:
    """Turntables of the F1: the first on arm 2, the second on arm 3, the third on the second (section 4.5)."""
    count = _count(values, "turntables[{}].axis[0]")
    found = []
    for k in range(count):
        w, x, y, z = _array(values, f"turntables[{k}].orientation", 4)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        seat = np.eye(3) + 2 * w * cross + 2 * cross @ cross
        found.append(
            (
                k,
                _array(values, f"turntables[{k}].offset", 3),
                seat,
                _array(values, f"turntables[{k}].axis", 3),
            )
        )
    if count == 0:
        return ((),) * arms
    if (arms, count) != (3, 3):
        raise ModelError(
            f"turntables: found {count} on {arms} arms, expected three on the arms 2 and 3 as F1GantryTau has them; "
            "other structures have no workspace here yet"
        )
    return ((), (found[0],), (found[1], found[2]))


def _strokes(flat: FlatModel, count: int) -> np.ndarray:
    """Limits of the positions of the carts that the model declares, as carts=[dict(s=Bounds(0, 2)), ...]."""
    limits = np.tile([-np.inf, np.inf], (count, 1))
    variables = {variable.name: variable for variable in flat.variables}
    for i in range(count):
        variable = variables.get(f"carts[{i}].s")
        for side, limit in enumerate((variable.min, variable.max) if variable else ()):
            if limit is not None and limit[0].is_constant():
                limits[i, side] = float(limit[0])
    return limits


def _home(flat: FlatModel) -> tuple[np.ndarray, np.ndarray]:
    """Start values of the tool; a quaternion `tool.q`, scalar first, gives the orientation."""
    starts = {variable.name: variable.start for variable in flat.variables}
    r = starts.get("tool.r")
    quaternion = starts.get("tool.q")
    R = np.eye(3)
    if quaternion is not None and all(x.is_constant() for x in quaternion):
        q = np.array([float(x) for x in quaternion])
        w, x, y, z = q / np.linalg.norm(q)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        R = R + 2 * w * cross + 2 * cross @ cross
    place = [float(x) for x in r] if r is not None and all(x.is_constant() for x in r) else [np.nan] * 3
    return np.array(place), R


def _rotations(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotations about a unit vector, (N, 3, 3)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = angle[:, None, None]
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
