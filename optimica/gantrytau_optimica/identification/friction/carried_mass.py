"""Forces of a mass at the tool in the actuators, by the robot's own model.

    f = J^T G m + f_0        at rest, G weight of 1 kg at the tool, f_0 weight of all else      Dressler (2012), (6.9)

At speed the model adds what bends the way of the tool at constant speeds of the actuators. Links are without mass:
m is the mass of the plate with half of the mass of each link (all of them for links whose ends are guided alike).
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError, translate
from gantrytau.dae import Dae
from gantrytau.describing.record import Record

PLATE = ("plate_mass", "platform.m", "tool.m")  # what robots call it
# links, and what laws of friction call their parameters
NO_LOAD = re.compile(r"\.(link_mass|(f|tau)_[cvs])(\[\d+\])?$")


@dataclass(frozen=True, eq=False)
class CarriedMass(Record):
    """Forces at constant speeds as known + mass * slope.

    name: of the robot's class; coordinates, actuators: scalar names, n each; nominal: mass of the plate in kg.
    """

    name: str
    coordinates: tuple[str, ...]
    actuators: tuple[str, ...]
    nominal: float
    rows_of: Callable[..., ca.DM]

    def forces(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces of 1 kg at the tool, and of all but the tool, (N, n) each, at q and v (N, n).

        Raises ModelError where the robot cannot be assembled.
        """
        n = len(self.coordinates)
        rows = np.asarray(self.rows_of(np.hstack([q, v]).T)).T
        bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        if bad.size:
            raise ModelError(
                f"{self.name}: found positions {np.round(q[bad[0]], 4).tolist()} of {', '.join(self.coordinates)} that "
                "its links do not reach, expected positions within the workspace; look whether they are in m and in the "
                "order of the actuators",
                argument="runs",
            )
        known = rows[:, n:]
        return rows[:, :n] - known, known


def carried_mass(robot: Model) -> CarriedMass:
    """The forces of a mass at the tool of a robot whose actuators are inputs `f` or `tau` beside an `s` or a `phi`.

    Raises ModelError for robots without such actuators, or without a mass of their plate.
    """
    dae = translate(robot)
    coordinates = driven_coordinates(dae)
    plate = next((name for name in PLATE if name in dae.adjustable), None)
    if plate is None:
        raise ModelError(
            f"identify_friction: {dae.name} has no {', '.join(PLATE)}, expected the mass of a plate at its tool",
            argument="robot",
        )
    off = [name for name in dae.adjustable if NO_LOAD.search(name)]
    motion = [pattern.format(name) for pattern in ("{}", "der({})", "der(der({}))") for name in coordinates]
    whole = dae.function(given=[*motion, plate, *off], find=list(dae.inputs))
    n = len(coordinates)
    x = ca.MX.sym("x", 2 * n)
    states, zeros = ca.vertsplit(x), [ca.MX(0)] * n
    columns = [
        ca.vertcat(*whole.call([*states, *zeros, ca.MX(mass), *[ca.MX(0)] * len(off)])) for mass in (1.0, 0.0)
    ]
    return CarriedMass(
        dae.name,
        coordinates,
        tuple(dae.inputs),
        dae.parameter_values[plate],
        ca.Function("f", [x], [ca.vertcat(*columns)]),
    )


def driven_coordinates(dae: Dae) -> tuple[str, ...]:
    """The coordinate that each input drives: `s` or `phi` of its component. Raises ModelError where there is none."""
    found = []
    for force in dae.inputs:
        owner = force.rpartition(".")[0]
        beside = next((f"{owner}.{end}" for end in ("s", "phi") if f"{owner}.{end}" in dae.variables), None)
        if beside is None:
            raise ModelError(
                f"{dae.name}: found no s or phi beside the input {force}, expected the coordinate that it drives; give "
                "the component one",
                argument="robot",
            )
        found.append(beside)
    if not found:
        raise ModelError(
            f"{dae.name}: found no inputs, expected forces of actuators as Input", argument="robot"
        )
    return tuple(found)
