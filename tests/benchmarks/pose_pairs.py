"""Two hundred random moves in the workspace of the L1 robot: does each converge from its straight line?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.solver import Solver, SolverOptions
from gantrytau_optimica.transcription import transcribe
from tests.benchmarks.gta import Task, reaches
from tests.benchmarks.gta_problem import control_problem, guess

LOW, HIGH = (0.0, 2.4, -1.1), (1.8, 3.5, 0.0)  # m, about one metre across as in Figure 2.4
LEAST_REACH = 0.5  # m, distance from the singularity dX = 0 at both ends
LEAST_DISTANCE = 0.2  # m


@dataclass(frozen=True)
class Verdict:
    """What became of one pair."""

    start: np.ndarray
    end: np.ndarray
    success: bool
    time: float  # s
    iterations: int
    seconds: float
    status: str


def pose_pairs(count: int = 200, seed: int = 2012) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs of tool positions (m) that all three arms reach."""
    random, robot = np.random.default_rng(seed), Task().robot
    while count:
        pair = random.uniform(LOW, HIGH, (2, 3))
        apart = np.linalg.norm(pair[1] - pair[0]) > LEAST_DISTANCE
        if apart and (np.nan_to_num(reaches(robot, pair)) > LEAST_REACH).all():
            count -= 1
            yield pair[0], pair[1]


def sweep(
    solve: Callable[[np.ndarray, np.ndarray], Verdict], count: int = 200, seed: int = 2012
) -> list[Verdict]:
    """The verdicts of a solver on every pair."""
    return [solve(start, end) for start, end in pose_pairs(count, seed)]


def core_solver(elements: int = 50, max_seconds: float = 60.0) -> Callable[[np.ndarray, np.ndarray], Verdict]:
    """The free path on one transcription, whose poses are parameters."""
    task = Task()
    solver = Solver(transcribe(control_problem(task), elements), SolverOptions(max_seconds=max_seconds))

    def solve(start: np.ndarray, end: np.ndarray) -> Verdict:
        found = solver.solve({"start": start, "end": end}, guess=guess(task, start, end))
        return Verdict(
            start,
            end,
            found.success,
            found.free["final_time"],
            found.iterations,
            found.solve_seconds,
            found.status,
        )

    return solve
