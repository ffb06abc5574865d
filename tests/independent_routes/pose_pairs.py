"""Random pairs of poses of the three-link robot GT-A, wider than its workspace, and the fastest motion between them."""

import numpy as np

from gantrytau import SolveError
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import Optimization, final, initial, optimize
from gantrytau_optimica.answers.optimum import Optimum
from tests.benchmarks.gta import Task, reaches
from tests.benchmarks.peers import by_hand, three_link
from tests.benchmarks.peers.written import Outcome

Pair = tuple[np.ndarray, np.ndarray]
LOW, HIGH = np.array([-1.5, 1.2, -2.0]), np.array([1.5, 4.5, 1.2])  # m; motions start at x = 0
SHORTEST = 0.3  # m
LEAST_REACH = 0.4  # m by which the tool is ahead of each cart along the straight line
LEAST_DETERMINANT = 0.15  # of W in q' = W T', which is singular where three links lie in one plane
BY_HAND = 0.2  # m, the least reach of the program by hand, without which it is lost where ours would be


def pairs(count: int, seed: int) -> list[Pair]:
    """Start and end, each (3,) in m, with a straight line between them that keeps clear of singular poses."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        start, end = random.uniform(LOW, HIGH), random.uniform(LOW, HIGH)
        start[0] = 0.0
        if np.linalg.norm(end - start) >= SHORTEST and _clear(start, end):
            found.append((start, end))
    return found


def _clear(start: np.ndarray, end: np.ndarray) -> bool:
    robot = Task().robot
    line = start + np.linspace(0.0, 1.0, 41)[:, None] * (end - start)
    ahead = reaches(robot, line)
    if not np.all(ahead >= LEAST_REACH):
        return False
    across = line[:, None, 1:] - np.array(robot.offsets)[None, :, 1:]
    determinant = np.linalg.det(
        np.concatenate([np.ones((*ahead.shape, 1)), across / ahead[..., None]], axis=2)
    )
    return bool(np.all(determinant > LEAST_DETERMINANT) or np.all(determinant < -LEAST_DETERMINANT))


def fastest(pair: Pair) -> Optimum:
    """The motion in least time by default, cold; where there is none, where the solver ended."""
    start, end = pair

    class Between(FreePath):
        def constraints(self):
            yield initial(self.robot.tool.r) == tuple(start)
            yield final(self.robot.tool.r) == tuple(end)
            yield initial(self.robot.tool.v) == 0
            yield final(self.robot.tool.v) == 0

    problem: type[Optimization] = Between
    try:
        return optimize(problem, max_time=120.0)
    except SolveError as error:
        return error.optimum


def fastest_by_hand(pair: Pair, elements: int = 50) -> Outcome:
    """The same by the program that was written for this robot."""
    task = Task(start=tuple(pair[0]), end=tuple(pair[1]), least_reach=BY_HAND)
    return by_hand.solve(lambda: three_link.motion(task=task), elements)
