"""How a mechanism is assembled: positions found by iteration stay on the branch of the first guess.

Loops without closed form have several solutions at every pose, and the equations of one time say nothing of the next, so
a program may take one solution here and another one there. Near the course of the guess there is one, and there limits keep
them. A solution in which a position nevertheless goes farther from one time to the next than its rate carries it is none.
"""

from collections.abc import Collection
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.ipopt import Solution, Solver
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory

BESIDE = 0.5  # of the largest value, and of the way that is gone: how far beside the guess positions may be
ANGLE = 1.0  # rad, or of a number without unit, the least of that
MOST_CLOSE = 300  # iterations from a solution on
MOST_WIDER = 5  # times that limits which bind are laid around the solution anew
FASTER = 4.0  # times the way by its rates at two times: a position that goes farther between them has jumped
LEAST_JUMP = 0.1  # of the largest value of a position, or rad
TOUCHES = 1e-5  # of their distance: how near to such a limit a solution rests on it


def solved_assembled(
    solver: Solver, program: Program, loops: Collection[str], first: np.ndarray, clock: Clock
) -> Solution:
    """Where a solver ends with positions (their symbols by name) as they are in unknowns `first` (unscaled)."""
    if not loops:
        return solver.solve(program, first, clock)
    narrow = assembled_near(program, loops, first)
    solution = solver.solve(narrow, first, clock)
    for _ in range(MOST_WIDER):
        if not (solution.success and clock.left and rests_on(narrow, program, solution.w)):
            break
        narrow = assembled_near(program, loops, solution.w)
        close = Solver(program, replace(solver.settings, barrier="near", max_iterations=MOST_CLOSE))
        wider = close.solve(narrow, solution.w, clock)
        if not wider.success:
            return replace(solution, held=True)  # a motion all the same
        solution = wider
    return solution


def jumps(built: Built, trajectory: Trajectory) -> str:
    """Where a position goes from one assembly to another between two points, in words; "" where none does."""
    phase, times = trajectory.phase, trajectory.time[1:]
    loops = [s for s in phase.algebraics if s.symbol.name() in built.system.loops]
    if not loops or times.size < 2:
        return ""
    positions = trajectory.values(ca.vertcat(*(s.symbol for s in loops)), times)
    least = LEAST_JUMP * np.maximum(np.max(np.abs(positions), axis=1, keepdims=True), 1.0)
    excess = np.abs(np.diff(positions)) - least
    if not np.any(excess > 0):
        return ""
    rates = np.abs(trajectory.values(built.expressed([f"der({s.symbol.name()})" for s in loops]), times))
    excess -= FASTER * np.maximum(rates[:, 1:], rates[:, :-1]) * np.diff(times)
    k, at = np.unravel_index(np.argmax(excess), excess.shape)
    if not excess[k, at] > 0:
        return ""
    name, (before, after) = built.read.dae.spoken(loops[k].symbol.name()), positions[k, at : at + 2]
    return (
        f"no motion: {name} jumps from {before:.4g} to {after:.4g} between t = {times[at]:.4g} s and {times[at + 1]:.4g} s, "
        "where loops close in another way"
    )


def assembled_near(program: Program, loops: Collection[str], w: np.ndarray) -> Program:
    """The program with such limits around the course that its unknowns w (unscaled) give to positions, by symbol."""
    lower, upper, scale = program.lbw.copy(), program.ubw.copy(), program.places.scale
    for mine in _positions(program, loops):
        low, high = float(np.min(w[mine])), float(np.max(w[mine]))
        beside = max(BESIDE * max(abs(low), abs(high)), BESIDE * (high - low), ANGLE)
        lower[mine] = np.maximum(lower[mine], (low - beside) / scale[mine])
        upper[mine] = np.minimum(upper[mine], (high + beside) / scale[mine])
    return replace(program, lbw=lower, ubw=upper)


def rests_on(narrow: Program, program: Program, w: np.ndarray) -> bool:
    """Whether unknowns w (unscaled) are at limits that a program has more than another one."""
    added = (narrow.lbw > program.lbw) | (narrow.ubw < program.ubw)
    x, low, high = (part[added] for part in (w / narrow.places.scale, narrow.lbw, narrow.ubw))
    near = TOUCHES * (high - low)
    return bool(np.any((x < low + near) | (x > high - near)))


def _positions(program: Program, loops: Collection[str]) -> list[np.ndarray]:
    """The unknowns of each of the positions."""
    return [
        layout.of(number)
        for layout in program.places.layouts
        for number, signal in enumerate(layout.phase.signals)
        if signal.symbol.name() in loops
    ]
