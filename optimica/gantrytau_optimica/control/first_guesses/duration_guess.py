"""The pace of a first guess: of a motion whose duration is free and whose forces follow from it.

Forces of inertia fall with the square of the duration. A guess of a second for what takes a fifth of one has accelerations
and forces of a twenty-fifth of their sizes, and unknowns that are to grow so far beyond their sizes take Ipopt hundreds
of small steps. The guess is made as fast as the limits of its forces allow.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.control.first_guesses.completion import driven
from gantrytau_optimica.control.first_guesses.guesses import first_guesses
from gantrytau_optimica.control.limits import signal_limits

MOST_PACES = 4  # durations that are tried
MOST_CHANGE = 4.0  # times longer or shorter than the one before
NEAR = (0.7, 1.4)  # of the limits: forces at a pace that is kept
FAIR = (0.1, 2.0)  # the same where gravity or friction keep them from coming near
SHARES = np.linspace(0.0, 1.0, 21)  # of the horizon, at which forces are looked at


def at_pace(built: Built, given: Mapping[str, Any]) -> Built:
    """The problem with the guess of its duration so that forces reach their limits; as it is where nothing tells it."""
    place = _duration(built.problem)
    if place is None or built.problem.free[place].name in given:
        return built
    number = built.problem.free[place]
    found = built
    for _ in range(MOST_PACES):
        share = _share(found, given)
        if share is None:
            return built
        if NEAR[0] <= share <= NEAR[1]:
            return found
        change = float(np.clip(np.sqrt(share), 1 / MOST_CHANGE, MOST_CHANGE))
        duration = float(np.clip(found.problem.free[place].guess * change, number.min, number.max))
        found = _lasting(built, place, duration)
    share = _share(found, given)
    return found if share is not None and FAIR[0] <= share <= FAIR[1] else built


def _duration(problem: ControlProblem) -> int | None:
    """The free number that is the duration of the only phase, by its place."""
    if len(problem.phases) != 1:
        return None
    (phase,) = problem.phases
    slope = ca.jacobian(phase.final_time - phase.start_time, problem.numbers)
    if slope.nnz() != 1 or not slope.is_constant():
        return None
    place = int(slope.sparsity().get_triplet()[1][0])
    return place if float(ca.DM(slope)[place]) == 1.0 and not problem.free[place].held else None


def _lasting(built: Built, place: int, duration: float) -> Built:
    free = list(built.problem.free)
    free[place] = replace(free[place], guess=duration)
    return replace(built, problem=replace(built.problem, free=tuple(free)))


def _share(built: Built, given: Mapping[str, Any]) -> float | None:
    """The share of their limits that forces have along the first guess, the largest of them as root mean square over time;
    None where none follows from the motion.
    """
    problem = built.problem
    (phase,) = problem.phases
    limits = signal_limits(phase, problem.name)
    limited = [s for s in driven(phase, built.system.orders).inputs if np.all(np.isfinite(limits[s.name]))]
    if not limited:
        return None
    guesses = first_guesses(built, given)
    shares = [np.zeros(SHARES.size)]
    for signal in limited:
        low, high = limits[signal.name]
        if low < high:
            shares.append(np.abs(2 * guesses[signal.name](SHARES) - low - high) / (high - low))
    share = float(np.sqrt(np.mean(np.max(shares, axis=0) ** 2)))
    return share if 0.0 < share < np.inf else None
