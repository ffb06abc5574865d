"""Loops from random starts, and the limits that they pass: `python -m ...random_starts crane 1000`."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import between
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Mpc, Optimization
from tests.benchmarks.table import Row, at_most, print_table, shown
from tests.optimica.predictive.test_robustness import RAIL, SWAY, Still

HOME = np.array([0.923, 2.9325, -0.4181])  # m, in the middle of the workspace of L1
FORCE, SPEED = 600.0, 0.5  # N, m/s


class Home(Optimization):
    """L1 goes home, within limits of the forces and speeds of its carts."""

    robot = GantryTau(prototypes.L1)
    given = ("robot.carts[0].f", "robot.carts[1].f", "robot.carts[2].f")

    def integrand(self):
        away = ca.sumsqr(self.robot.tool.r - HOME)
        return 1e2 * away + sum(1e-5 * cart.f**2 + 0.5 * cart.v**2 for cart in self.robot.carts)

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-FORCE, cart.f, FORCE)
            yield between(-SPEED, cart.v, SPEED)


def cranes(rng: np.random.Generator) -> Iterator[dict[str, float]]:
    """States on the rail, within the limit of the sway."""
    names = ("crane.s", "crane.v", "crane.phi", "crane.w")
    while True:
        start = rng.uniform(-1.0, 1.0, 4) * [5.0, 0.4, 0.6 * SWAY, 0.05]
        yield dict(zip(names, start.tolist(), strict=True))


def tools(rng: np.random.Generator) -> Iterator[dict[str, float]]:
    """States with the tool within reach, 0.3 m, or 0.15 m in height, around home."""
    reach = Kinematics(GantryTau(prototypes.L1))
    while True:
        r, v = HOME + rng.uniform(-1, 1, 3) * [0.3, 0.3, 0.15], rng.uniform(-0.1, 0.1, 3)
        if np.isfinite(reach.ik(r)).all():
            named = zip("rv", (r, v), strict=True)
            yield {f"robot.tool.{one}[{k}]": float(x[k]) for one, x in named for k in range(3)}


@dataclass(frozen=True)
class Loops:
    """Loops of a controller. limits: by name, those that hold; by: what integration and linearisation may pass them by."""

    keywords: dict[str, Any]
    problem: type
    starts: Callable[[np.random.Generator], Iterator[dict[str, float]]]
    stop: float  # s
    limits: dict[str, float]
    by: float


LOOPS = {
    "crane": Loops(
        dict(period=0.1, elements=40), Still, cranes, 2.0,
        {"crane.a": 0.5, "crane.s": RAIL, "crane.phi": SWAY}, 1e-3,
    ),
    "L1": Loops(
        dict(period=0.02, elements=20), Home, tools, 1.0,
        {f"robot.carts[{k}].f": FORCE for k in range(3)} | {f"robot.carts[{k}].v": SPEED for k in range(3)}, 1e-3,
    ),
}  # fmt: skip


def rows(title: str, count: int) -> Iterator[Row]:
    """Limits of so many loops."""
    case, told, begin = LOOPS[title], Counter[str](), process_time()
    mpc, most = Mpc(case.problem, **case.keywords), dict.fromkeys(case.limits, 0.0)
    mpc.compiled()
    starts = case.starts(np.random.default_rng(11))
    for _ in range(count):
        loop = mpc.run(stop=case.stop, start=next(starts))
        told.update(loop.statuses)
        most = {
            name: max(value, np.abs(loop[name]).max() / case.limits[name]) for name, value in most.items()
        }
    words = f"{title}, {count} random starts"
    for name, value in most.items():
        yield at_most(f"{words}: largest {name} over its limit", value, 1 + case.by)
    yield at_most(f"{words}: share of steps not solved", 1 - told["solved"] / told.total(), 0.0)
    yield shown(f"{words}: took", f"{process_time() - begin:.0f} s cpu")


if __name__ == "__main__":
    sys.exit(print_table("Loops from random starts", [rows(sys.argv[1], int(sys.argv[2]))]))
