"""Random pose pairs in the workspace of the L1 robot: does every motion converge from its straight line?"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from time import process_time
from typing import Any

import numpy as np

from gantrytau import Parameter, SolveError, Study, study
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_models import prototypes
from gantrytau_optimica import Prepared, final, initial, prepare

LOW, HIGH = (0.0, 2.4, -1.1), (1.8, 3.5, 0.0)  # m, the workspace that the thesis draws in its Figure 2.4
# m by which the tool is ahead of each cart, away from the singular position where it is beside
LEAST_REACH = 0.5
LEAST_DISTANCE = 0.2  # m


@dataclass(frozen=True)
class Verdict:
    """What became of one pair; time in s, or nan; seconds: of the processor."""

    start: tuple[float, ...]
    end: tuple[float, ...]
    success: bool
    status: str
    time: float
    iterations: int
    seconds: float


class BetweenPoses(FreePath):
    """The free motion between poses that are parameters."""

    start_pose = Parameter([0.0, 2.51, -1.03], shape=3, unit="m", description="where the tool starts")
    end_pose = Parameter([1.711, 3.46, -0.24], shape=3, unit="m", description="where the tool ends")

    def constraints(self):
        yield initial(self.robot.tool.r) == self.start_pose
        yield final(self.robot.tool.r) == self.end_pose
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0


@cache
def prepared(elements: int) -> Prepared:
    """The problem, built once in each process."""
    return prepare(BetweenPoses, parameters=["start_pose", "end_pose"], elements=elements)


def fastest(start: np.ndarray, end: np.ndarray, elements: int = 50) -> Verdict:
    """The minimum-time motion between two poses."""
    problem, begun = prepared(elements), process_time()
    try:
        optimum = problem.solve({"start_pose": start, "end_pose": end})
    except SolveError as error:
        optimum = error.optimum
    return Verdict(
        tuple(start),
        tuple(end),
        optimum.success,
        optimum.status,
        optimum.final_time if optimum.success else float("nan"),
        optimum.iterations,
        process_time() - begun,
    )


def sweep(count: int, seed: int, elements: int = 50, **policy: Any) -> Study:
    """Minimum-time motions on free paths between `count` random pairs of poses; policy: keywords of `study`."""
    starts, ends = zip(*pairs(count, seed), strict=True)
    return study(
        partial(fastest, elements=elements), over={"start": starts, "end": ends}, combine="zip", **policy
    )


def pairs(count: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Random pairs, both ends reachable with a margin on the branch with the carts behind the tool."""
    random = np.random.default_rng(seed)
    found = 0
    while found < count:
        start, end = random.uniform(LOW, HIGH), random.uniform(LOW, HIGH)
        if np.linalg.norm(end - start) > LEAST_DISTANCE and min(reach(start), reach(end)) > LEAST_REACH:
            found += 1
            yield start, end


def reach(tool: np.ndarray) -> float:
    """The least distance in m by which the tool is ahead of a cart of GT-A, or -inf if a link is too short."""
    least = np.inf
    for arm in prototypes.GT_A.arms:
        across = (tool - np.array(arm.offset))[1:]
        square = arm.length**2 - across @ across
        least = min(least, np.sqrt(square) if square > 0 else -np.inf)
    return float(least)


if __name__ == "__main__":
    found = sweep(200, 1, folder=sys.argv[1] if len(sys.argv) > 1 else None)
    print(f"{sum(v.success for v in found.values)} of {len(found)} converged")
    for verdict in found.values:
        if not verdict.success:
            print(verdict)
