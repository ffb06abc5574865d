"""GT-A (free path) with rockit's direct collocation as its user writes it; torques are piecewise constant."""

from __future__ import annotations

import time
from typing import Any

import casadi as ca
import numpy as np
from rockit import DirectCollocation, FreeTime, Ocp  # pyright: ignore[reportMissingImports]

from tests.benchmarks.gta import Task, reaches, trapezoid
from tests.benchmarks.reference_collocation import IPOPT, Outcome, point_function


def solve(task: Task, elements: int = 50, points: int = 3, max_time: float = 60.0) -> Outcome:
    """Build and solve the motion, both timed. Raises RuntimeError if that takes Ipopt more than max_time (s)."""
    began = time.perf_counter()
    ocp: Any = Ocp(T=FreeTime(task.guessed_time))  # pyright: ignore[reportArgumentType]
    y, dy = ocp.state(3), ocp.state(3)
    ddy, dX, torque = ocp.algebraic(3), ocp.algebraic(3), ocp.control(3)
    residual, squares = point_function(task)(y, dy, ddy, dX, torque)
    ocp.set_der(y, dy)
    ocp.set_der(dy, ddy)
    ocp.add_alg(residual)
    ocp.add_objective(ocp.T + (ocp.integral(task.weight * squares) if task.weight else 0))
    ocp.subject_to(ocp.at_t0(y) == list(task.start))
    ocp.subject_to(ocp.at_t0(dy) == 0)
    ocp.subject_to(ocp.at_tf(y) == list(task.end))
    ocp.subject_to(ocp.at_tf(dy) == 0)
    ocp.subject_to(-task.torque_limit <= (torque <= task.torque_limit))
    ocp.subject_to(ocp.T >= 0.1)
    ocp.subject_to(dX >= 0)
    # first guesses have to be expressions of the time: tables of the straight line, linear in between
    times = np.linspace(0.0, 1.0, 201)
    position, speed, acceleration = trapezoid(times)
    start, span = np.array(task.start), np.array(task.end) - np.array(task.start)
    tool = start + position[:, None] * span
    for symbol, table in (
        (y, tool),
        (dy, speed[:, None] * span),
        (ddy, acceleration[:, None] * span),
        (dX, reaches(task.robot, tool)),
    ):
        lookup = ca.interpolant(
            "lookup", "linear", [(times * task.guessed_time).tolist()], table.ravel().tolist()
        )
        ocp.set_initial(symbol, lookup(ocp.t))
    options = {"expand": True, "print_time": False, "record_time": True}
    ocp.solver("ipopt", options | {"ipopt": IPOPT | {"max_wall_time": max_time}})
    ocp.method(DirectCollocation(N=elements, degree=points, scheme="radau"))
    solution = ocp.solve()
    ended = time.perf_counter()
    stats = solution.stats
    solving = stats["t_wall_total"]  # rockit transcribes when it solves: that is building
    energy = float(np.asarray(solution.value(ocp.integral(squares)))) if task.weight else float("nan")
    return Outcome(
        float(solution.value(ocp.T)),
        energy,
        stats["iter_count"],
        ended - began - solving,
        solving,
        bool(stats["success"]),
        int(ocp._method.opti.nx),
    )
