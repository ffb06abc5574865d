"""Motions from rest to rest of robots whose loops have no closed form, and the times that programs by hand found.

closed_loop_pairs.json: 20 pairs of poses for each robot on the branch of its home pose, the plate's Jacobian well
conditioned along the straight line; limits of the drives. TIMES: of the first pairs in s, 20 elements of 3 Radau points,
computed apart by Lagrange's equations with rod tensions, accelerations being what is chosen.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gantrytau import Start, between
from gantrytau_models import DeltaRobot, F1GantryTau, FourBar, SixLinkGantryTau, StewartPlatform, prototypes
from gantrytau_optimica import Free, Optimization, final, initial

PAIRS = json.loads((Path(__file__).parent / "closed_loop_pairs.json").read_text())
TIMES = {
    "six_D1": (0.4160, 0.5609, 0.2344, 0.2172, 0.4752, 0.3735, 0.2019, 0.1519, 0.5463, 0.5625),
    "six_L1": (0.4579, 0.5662, 0.2551, 0.1843, 0.5075, 0.2971, 0.1879, 0.1827, 0.5871, 0.5105),
    "delta": (0.1947, 0.2035, 0.1791, 0.1181, 0.2120, 0.1490, 0.1242, 0.1088, 0.1989, 0.2279),
    "f1": (0.1868, 0.1960, 0.2069),
    "stewart": (0.2407, 0.2521, 0.2626),
    "fourbar": (0.23502, 0.28979, 0.08919),
}
ROBOTS: dict[str, Any] = {
    "six_D1": lambda: SixLinkGantryTau(prototypes.D1),
    "six_L1": lambda: SixLinkGantryTau(prototypes.L1),
    "f1": lambda: F1GantryTau(prototypes.F1),
    "delta": DeltaRobot,
    "stewart": StewartPlatform,
}
TURNING = ("f1", "stewart")  # plates with six degrees of freedom


def carried(kind: str, number: int) -> type[Optimization]:
    """The fastest motion of a robot between the poses of a pair, its model started where it is at home."""
    (begin, end), limits = PAIRS[kind]["pairs"][number], PAIRS[kind]["limits"]
    first = quaternion(begin["tool_R"])
    last = quaternion(end["tool_R"])
    last = last if first @ last > 0 else -last

    class Carried(Optimization):
        robot = ROBOTS[kind]()
        final_time = Free(1.0, min=0.02, unit="s")

        def objective(self):
            return self.final_time

        def constraints(self):
            plate = self.robot.platform if kind == "stewart" else self.robot.tool
            for at, pose, q in ((initial, begin, first), (final, end, last)):
                yield at(plate.r) == pose["tool_r"]
                yield at(plate.v) == [0.0, 0.0, 0.0]
                if kind in TURNING:
                    yield at(plate.q[1:4]) == q[1:]
                    yield at(plate.w) == [0.0, 0.0, 0.0]
            for name, limit in limits.items():
                yield between(-limit, member(self.robot, name), limit)

    return Carried


def turned(number: int) -> type[Optimization]:
    """The crank of a four-bar linkage turned between two angles drawn from +-2.5 rad, with 20 N.m."""
    begin, end = np.random.default_rng(1).uniform(-2.5, 2.5, (100, 2))[number]

    class Turned(Optimization):
        robot = FourBar(crank=dict(length=0.3, phi=Start(begin)))
        final_time = Free(0.5, min=0.02, unit="s")

        def objective(self):
            return self.final_time

        def constraints(self):
            crank = self.robot.crank
            for at, phi in ((initial, begin), (final, end)):
                yield at(crank.phi) == phi
                yield at(crank.w) == 0.0
            yield between(-20.0, self.robot.torque, 20.0)

    return Turned


def quaternion(R: Any) -> np.ndarray:
    """Of a rotation matrix, (4,), the real part first and not negative."""
    x, y, z, w = Rotation.from_matrix(np.array(R)).as_quat(canonical=True)
    return np.array([w, x, y, z])


def member(robot: Any, name: str) -> Any:
    """`carts[0].f` of a robot."""
    array, rest = name.split("[")
    number, quantity = rest.split("].")
    return getattr(getattr(robot, array)[int(number)], quantity)
