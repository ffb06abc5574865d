"""Values at times that the optimiser moves: read from the element in which the time lies at the optimum.

A value is read from the polynomials of one element, which mean nothing outside of it. So every such time is held within its
element, left <= share <= right, and goes on into the next where that limit has a multiplier, in strides that double, or
halve what is left between two elements that push towards each other. Where neighbours do, the time rests on their border.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.control_problem import ControlProblem, Limit
from gantrytau_optimica.solving.ipopt import Solution, objective_size
from gantrytau_optimica.transcription.point_functions import share_of
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.transcribe import transcribed_again

Solve = Callable[[Program, np.ndarray], Solution]

EASY = 2  # solves after which times that do not stay in their elements are held there
BORDERS = 6  # the same, and the last, where borders move, which hold nothing
ROUNDS = 100  # of going on into other elements
GAIN = 1e-7  # of the size of the objective: what it would gain in the next element that is worth going there
HELD = "the time of {} stays within its element"


def settled(program: Program, solution: Solution, solve: Solve) -> tuple[Program, Solution]:
    """The solution with all times in the elements that they are read from, and its program; else one without success."""
    moving = any(layout.knots.size for layout in program.places.layouts)
    for _ in range(BORDERS if moving else EASY):
        if not solution.success or not program.astray(solution.w):
            return program, solution
        program = located(program, solution.w)
        solution = solve(program, solution.w)
    if not solution.success or not program.astray(solution.w):
        return program, solution
    return (program, unsettled(program, solution)) if moving else _walked(program, solution, solve)


def unsettled(program: Program, solution: Solution) -> Solution:
    """The solution without success, because times do not come to rest."""
    moving = ca.vertcat(*(one.point.symbol for one in program.points if one.place is None))
    names = [limit.name for limit in program.problem.boundary if ca.depends_on(limit.expression, moving)]
    said = " and ".join(f"`{name}`" for name in dict.fromkeys(names)) or "the objective"
    status = f"not settled: the times of values in {said} do not come to rest in an element"
    return replace(solution, success=False, status=status)


def located(program: Program, w: np.ndarray, held: tuple[Limit, ...] = ()) -> Program:
    """The program with all values read from the elements in which their times lie at unknowns w; held: more conditions."""
    borders = [layout.placed(w).borders for layout in program.places.layouts]
    problem = replace(program.problem, boundary=(*_own(program.problem), *held))
    return transcribed_again(program, problem, located=(w[program.places.free], borders))


def _own(problem: ControlProblem) -> tuple[Limit, ...]:
    """Conditions without those that hold times."""
    held = {HELD.format(p.symbol) for p in problem.points}
    return tuple(limit for limit in problem.boundary if limit.name not in held)


@dataclass(frozen=True, eq=False)
class _Moving:
    """A time that moves: its phase, its share of the horizon, the elements there are; seen: where they pushed, -1 or 1."""

    name: str
    phase: int
    share: ca.SX
    elements: int
    seen: Mapping[int, int]

    def goal(self, element: int) -> int | None:
        """The element to be looked at after this one; None where the time rests."""
        side = self.seen[element]
        if side == 0 or not 0 <= element + side < self.elements:
            return None
        opposed = [k for k, other in self.seen.items() if other == -side and (k - element) * side > 0]
        if opposed:
            nearest = min(opposed, key=lambda k: abs(k - element))
            return None if abs(nearest - element) == 1 else (element + nearest) // 2
        stride = 2 ** (sum(other == side for other in self.seen.values()) - 1)
        return int(np.clip(element + side * stride, 0, self.elements - 1))


def _walked(program: Program, solution: Solution, solve: Solve) -> tuple[Program, Solution]:
    """Every time held within an element, and on into others until all rest."""
    moving = _times(program)
    size, w = objective_size(program), solution.w
    for _ in range(ROUNDS):
        where = _elements(program, moving, w)
        held = [_hold(program, one, k) for one, k in zip(moving, where, strict=True)]
        program = located(program, w, tuple(held))
        solution = solve(program, w)
        if not solution.success:
            return program, solution
        sides = _sides(program, solution, size)
        moving = [
            replace(one, seen={**one.seen, k: side})
            for one, k, side in zip(moving, where, sides, strict=True)
        ]
        goals = [one.goal(k) for one, k in zip(moving, where, strict=True)]
        w = solution.w
        if all(goal is None for goal in goals):
            return _released(program, solution, len(held))
        for one, goal in zip(moving, goals, strict=True):
            w = w if goal is None else _moved(program, one, goal, w)
        if len(moving) > 1:  # where one goes, what was seen of the others may not hold any more
            moving = [
                one if goal is not None else replace(one, seen={})
                for one, goal in zip(moving, goals, strict=True)
            ]
    return program, unsettled(program, solution)


def _times(program: Program) -> list[_Moving]:
    """The times that move, each once."""
    found: dict[tuple[int, int], _Moving] = {}
    for one in program.points:
        if one.place is None and not isinstance(one.point.time, str):
            share = share_of(program.problem.phases[one.phase], one.point.time)
            count = program.places.layouts[one.phase].mesh.elements
            key = (one.phase, ca.SX(one.point.time).element_hash())
            found.setdefault(key, _Moving(HELD.format(one.point.symbol), one.phase, share, count, {}))
    return list(found.values())


def _shares(program: Program, moving: Sequence[_Moving], w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the times lie on the horizon, (k,), and how that changes with the scaled free numbers, (k, n)."""
    numbers, free = program.problem.numbers, program.places.free
    shares = ca.vertcat(*(one.share for one in moving))
    function = ca.Function(
        "shares", [numbers], [ca.densify(shares), ca.densify(ca.jacobian(shares, numbers))]
    )
    share, gradient = (np.array(x) for x in function(w[free]))
    return np.clip(share.ravel(), 0.0, 1.0), gradient * program.places.scale[free]


def _elements(program: Program, moving: Sequence[_Moving], w: np.ndarray) -> list[int]:
    shares = _shares(program, moving, w)[0]
    meshes = [program.places.layouts[one.phase].mesh for one in moving]
    return [int(mesh.locate(np.array([x]))[0][0]) for mesh, x in zip(meshes, shares, strict=True)]


def _hold(program: Program, one: _Moving, element: int) -> Limit:
    left, right = program.places.layouts[one.phase].mesh.borders[element : element + 2]
    return Limit(one.share, float(left), float(right), one.name, size=float(right - left))


def _sides(program: Program, solution: Solution, size: float) -> list[int]:
    """To which side the limits that hold times are pushed, -1, 0 or 1: where going on by an element would gain something."""
    count = len(program.problem.boundary) - len(_own(program.problem))
    pushes = solution.multipliers[program.assembled.rows - count :]
    return [int(np.sign(push)) if abs(push) > GAIN * size else 0 for push in pushes]


def _moved(program: Program, one: _Moving, element: int, w: np.ndarray) -> np.ndarray:
    """Unknowns with the free numbers changed least, so that the time lies in the middle of an element."""
    borders = program.places.layouts[one.phase].mesh.borders
    w, free, scale = w.copy(), program.places.free, program.places.scale
    low, high = program.lbw[free] * scale[free], program.ubw[free] * scale[free]
    for _ in range(3):
        (share,), (gradient,) = _shares(program, [one], w)
        gradient = np.where(low < high, gradient, 0.0)
        step = (
            gradient
            * ((borders[element] + borders[element + 1]) / 2 - share)
            / max(float(gradient @ gradient), 1e-300)
        )
        w[free] = np.clip(w[free] + step * scale[free], low, high)
    return w


def _released(program: Program, solution: Solution, count: int) -> tuple[Program, Solution]:
    """The same without the conditions that held times, the last `count` rows."""
    rows = program.assembled.rows - count
    released = replace(
        solution, multipliers=solution.multipliers[:rows], constraints=solution.constraints[:rows]
    )
    return located(program, solution.w), released
