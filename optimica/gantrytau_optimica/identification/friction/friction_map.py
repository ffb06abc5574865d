"""Coulomb friction of carts over the force in their links: a link that pulls harder presses its cart harder on the guideway.

    f_c,i = a_i + b_i |F_i|,    |F_i| = |w_i| |dq_i/dT|        w_i: weight in actuator i, F_i: in its link

The power of F along the link u is that of w along the guideway v, F u.v = w, and closure gives dq/dT = u / (u.v).
Dressler (2012), section 6.2, saw friction of its carts change with the position of the tool and left a law of it open.
"""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import array, instance
from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics
from gantrytau.language.self_description.rods import rods_of
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.identification.friction.friction_fit import actuator_rows
from gantrytau_optimica.identification.friction.friction_result import Friction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOLD = 1e-2  # of the load, by which it must differ from run to run to be told from constant friction


@dataclass(frozen=True, eq=False)
class FrictionMap(Record):
    """Friction of n carts over the force in their links.

    coulomb: (n, 2) in N without force in the link, viscous: (n, 2) in kg/s, at positive and at negative speed; by_load: N of
    friction by N in the link, (n,), with its deviations; load: (R, n) in N, in the runs. `at(r)` is the map over the
    workspace.
    """

    friction: Friction
    kinematics: Kinematics
    coulomb: np.ndarray
    viscous: np.ndarray
    by_load: np.ndarray
    deviations: np.ndarray
    load: np.ndarray

    def at(self, r: Any) -> np.ndarray:
        """Coulomb friction with the tool at r (N, 3) in m, (N, n, 2) in N, at positive and at negative speed."""
        places = array("FrictionMap.at", "r", r, (None, 3), (3,), unit="m").reshape(-1, 3)
        load = _link_loads(self.kinematics, self.kinematics.ik(places), self.friction)
        return self.coulomb + (self.by_load * load)[:, :, None]

    def plot(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Friction of each run less its viscous part over the force in the link, and the lines that were found."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        runs, names = self.friction.runs, self.friction.load.actuators
        left = runs.f - runs.known - self.friction.mass * runs.slope
        figure, axes = plt.subplots(
            1, len(names), figsize=(3.2 * len(names), 3.2), squeeze=False, layout="constrained"
        )
        for i, (axis, name) in enumerate(zip(axes[0], names, strict=True)):
            for k, (side, sign) in enumerate((("forth", 1), ("back", -1))):
                rows, ends = sign * runs.v[:, i] > 0, np.array([0.0, self.load[:, i].max()])
                rest = sign * (left[rows, i] - self.viscous[i, k] * runs.v[rows, i])
                axis.plot(self.load[rows, i], rest, ".", color=f"C{k}", label=side)
                axis.plot(ends, self.coulomb[i, k] + self.by_load[i] * ends, color=f"C{k}")
            axis.set(xlabel="force in the link [N]", title=name)
            axis.grid(alpha=0.3)
        axes[0, 0].set_ylabel("friction without viscous part [N]")
        axes[0, 0].legend(fontsize="small")
        return finished(figure, file)


def friction_over_load(robot: Model, friction: Friction) -> FrictionMap:
    """How Coulomb friction of each cart grows with the force in its link, from runs at several positions of the tool.

        found = identify_friction(robot, runs, mass="positions")
        friction_over_load(robot, found).at([0.9, 2.7, -0.7])

    robot: of one link on each cart, whose plate cannot turn, as `GantryTau`. Raises ModelError for others, and where
    the forces in the links hardly differ from run to run.
    """
    instance("friction_over_load", "friction", friction, Friction, "what identify_friction finds")
    rods = rods_of(robot)
    if rods is None or rods.turns or any(len(arm.rods) != 1 for arm in rods.arms):
        raise ModelError(
            "friction_over_load: expected a robot of one link on each cart, as GantryTau; the forces in others do "
            "not follow from the weight in their actuators",
            argument="robot",
        )
    kinematics = Kinematics(robot)
    runs, n = friction.runs, len(friction.load.actuators)
    load = _link_loads(kinematics, runs.q, friction)
    pairs = np.full((2, n, 2), np.nan)
    slopes = np.full((2, n), np.nan)
    for i, name in enumerate(friction.load.actuators):
        a = actuator_rows(runs, i, f"coulomb[{i}]" not in friction.names, name)
        column = np.sign(runs.v[a.rows, i]) * load[a.rows, i]
        if not np.linalg.norm(a.beside(column)) > TOLD * np.linalg.norm(column):
            raise ModelError(
                f"friction_over_load: found the same force in the link of {name} in all runs, expected others; add runs at "
                "other positions of the tool",
                argument="friction",
            )
        columns, y = np.column_stack([a.X, column]), a.y - friction.mass * a.slope
        inverse = np.linalg.pinv(columns)
        values = inverse @ y
        left, spare = y - columns @ values, y.size - values.size
        slopes[:, i] = (
            values[-1],
            np.sqrt(left @ left / spare) * np.linalg.norm(inverse[-1]) if spare > 0 else np.inf,
        )
        for pair, part in zip(pairs, np.split(values[:-1], 2), strict=True):
            for group, value in zip(a.groups, part, strict=True):
                pair[i, slice(None) if group == 2 else group] = value
    return FrictionMap(friction, kinematics, pairs[0], pairs[1], slopes[0], slopes[1], load)


def _link_loads(kinematics: Kinematics, q: np.ndarray, friction: Friction) -> np.ndarray:
    """Sizes of the forces in the links that bear the mass at rest, (N, n) in N."""
    by_place = np.linalg.norm(kinematics.jacobian(kinematics.fk(q)[0]), axis=2)
    return np.abs(friction.gravity(q)) * by_place
