"""GT-A as a record of the transcription, its equations taken from the closed form: no model, no compiler."""

from __future__ import annotations

import casadi as ca
import numpy as np

from gantrytau_optimica.control_problem import (
    ControlProblem,
    FreeNumber,
    Limit,
    Parameter,
    PointValue,
    Signal,
)
from tests.benchmarks.gta import Task, reaches, trapezoid
from tests.benchmarks.reference_collocation import point_function

LEAST_REACH = 0.3  # m; near dX = 0, where the arm is at a right angle to its guideway, iterates run away


def control_problem(task: Task) -> ControlProblem:
    """Tool (or path coordinate) and its speed as states; accelerations, reaches dX and torques at every
    point.

    The poses "start" and "end" are parameters of the free path, so that one transcription serves many of
    them.
    """
    n = 1 if task.line else 3
    y, dy, ddy = ca.SX.sym("y", n), ca.SX.sym("dy", n), ca.SX.sym("ddy", n)
    dX, torque, final_time = ca.SX.sym("dX", 3), ca.SX.sym("torque", 3), ca.SX.sym("final_time")
    start, end = ca.SX.sym("start", n), ca.SX.sym("end", n)
    at_start, at_end = ca.SX.sym("at_start", 2 * n), ca.SX.sym("at_end", 2 * n)
    residual, squares = point_function(task)(y, dy, ddy, dX, torque)
    guesses = guess(task, np.array(task.start), np.array(task.end))

    def signals(name: str, symbol: ca.SX, low: float = -np.inf, high: float = np.inf) -> list[Signal]:
        return [
            Signal(f"{name}[{i}]", symbol[i], low, high, guess=guesses[f"{name}[{i}]"])
            for i in range(symbol.numel())
        ]

    # as many algebraics as residuals: along a line the torques follow from one input, the acceleration
    drives = signals("torque", torque, -task.torque_limit, task.torque_limit)
    reach, acceleration = signals("dX", dX, LEAST_REACH), signals("ddy", ddy)
    algebraics, inputs = ([*reach, *drives], acceleration) if task.line else ([*acceleration, *reach], drives)
    rest = ca.DM.zeros(n, 1)
    return ControlProblem(
        states=(*signals("y", y), *signals("dy", dy)),
        ode=ca.vertcat(dy, ddy),
        algebraics=tuple(algebraics),
        residuals=residual,
        residual_names=(
            *(f"length of link {i}" for i in range(3)),
            *(f"balance of forces along {i}" for i in "xyz"),
        ),
        inputs=tuple(inputs),
        final_time=final_time,
        free=(FreeNumber("final_time", final_time, 0.1, 5.0, task.guessed_time, unit="s"),),
        parameters=(
            Parameter("start", start, [0.0] if task.line else task.start),
            Parameter("end", end, [1.0] if task.line else task.end),
        ),
        integrand=task.weight * squares,
        objective=final_time,
        points=(
            PointValue(at_start, ca.vertcat(y, dy), "initial"),
            PointValue(at_end, ca.vertcat(y, dy), "final"),
        ),
        boundary=(
            Limit(at_start, ca.vertcat(start, rest), ca.vertcat(start, rest), "start of the tool"),
            Limit(at_end, ca.vertcat(end, rest), ca.vertcat(end, rest), "end of the tool"),
        ),
    )


def guess(task: Task, start: np.ndarray, end: np.ndarray) -> dict:
    """A straight line with trapezoidal speed, as functions of time by the names of the signals."""
    T, span = task.guessed_time, end - start

    def tool(t: np.ndarray) -> np.ndarray:
        return start + trapezoid(t / T)[0][:, None] * span

    origin, way = (np.zeros(1), np.ones(1)) if task.line else (start, span)
    found = {}
    for i in range(len(way)):
        found[f"y[{i}]"] = lambda t, i=i: origin[i] + trapezoid(t / T)[0] * way[i]
        found[f"dy[{i}]"] = lambda t, i=i: trapezoid(t / T)[1] * way[i] / T
        found[f"ddy[{i}]"] = lambda t, i=i: trapezoid(t / T)[2] * way[i] / T**2
    for i in range(3):
        found[f"dX[{i}]"] = lambda t, i=i: reaches(task.robot, tool(t))[:, i]
        found[f"torque[{i}]"] = np.zeros_like
    return found
