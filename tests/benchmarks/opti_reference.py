"""GT-A (free path) with CasADi's Opti as a careful user writes it: direct collocation, and multiple shooting.

Both in x = (y, y'), tool position and speed, (6,). Simple bounds are handed to Ipopt as bounds.

    collocation   sum_i D_ij y_i = h y'_j    0 = point(y_j, y'_j, sum_i D_ij y'_i / h, dX_j, torque_j)
    shooting      x_{k+1} = two steps of Runge-Kutta from x_k with constant torques and the solved closed form
"""

from __future__ import annotations

import time
from typing import Any

import casadi as ca
import numpy as np

from tests.benchmarks.closed_form import forward_dynamics
from tests.benchmarks.gta import Task, reaches, trapezoid
from tests.benchmarks.reference_collocation import IPOPT, Outcome, point_function

STEPS = 2  # per interval: friction below 0.05 m/s is too stiff for one step of 1/50 s


class Motion:
    """What both programs have in common: the time, the torques, the limits, and the first guess."""

    def __init__(self, task: Task) -> None:
        if task.line:
            raise ValueError("these reference programs are written for free paths")
        self.began = time.perf_counter()
        self.task = task
        self.opti = ca.Opti()
        self.T = self.opti.variable()
        self.opti.set_initial(self.T, task.guessed_time)
        self.opti.subject_to(self.opti.bounded(0.1, self.T, 5.0))

    def states(self, fractions: np.ndarray) -> ca.MX:
        """Tool position and speed at shares of the duration, (6, n), guessed along the straight line."""
        position, speed, _ = trapezoid(fractions)
        span = np.array(self.task.end) - np.array(self.task.start)
        x = self.opti.variable(6, fractions.size)
        path = np.array(self.task.start)[:, None] + span[:, None] * position
        self.opti.set_initial(x[:3, :], path)
        self.opti.set_initial(x[3:, :], span[:, None] * speed / self.task.guessed_time)
        return x

    def torques(self, count: int) -> ca.MX:
        """Motor torques in their limits, (3, count)."""
        torque = self.opti.variable(3, count)
        limit = self.task.torque_limit
        self.opti.subject_to(self.opti.bounded(-limit, ca.vec(torque), limit))
        return torque

    def solve(self, first: ca.MX, last: ca.MX, energy: ca.MX, *, expand: bool, max_time: float) -> Outcome:
        """From rest at `first` to rest at `last`, built and solved; both timed. expand: the whole program to SX."""
        self.opti.subject_to(first == [*self.task.start, 0, 0, 0])
        self.opti.subject_to(last == [*self.task.end, 0, 0, 0])
        self.opti.minimize(self.T + self.task.weight * energy)
        options = {"expand": expand, "detect_simple_bounds": True, "print_time": False, "record_time": True}
        self.opti.solver("ipopt", options | {"ipopt": IPOPT | {"max_wall_time": max_time}})
        try:
            found: Any = self.opti.solve()
        except RuntimeError:  # not converged, or not in time
            found = self.opti.debug
        ended = time.perf_counter()
        stats = self.opti.stats()
        solving = stats["t_wall_total"]  # Opti sets its solver up when it solves: that is building
        return Outcome(
            float(found.value(self.T)),
            float(found.value(energy)),
            stats["iter_count"],
            ended - self.began - solving,
            solving,
            bool(stats["success"]),
            int(self.opti.nx),
        )


def collocation(task: Task, elements: int = 50, points: int = 3, max_time: float = 60.0) -> Outcome:
    """Radau collocation with states, reaches and torques at every point as variables."""
    motion = Motion(task)
    opti, h = motion.opti, motion.T / elements
    c = np.array(ca.collocation_points(points, "radau"))
    C, _, weights = ca.collocation_coeff(list(c))  # slopes of the polynomial through start and points
    point = point_function(task).map(points)
    inside = (np.arange(elements)[:, None] + c) / elements
    guess = np.array(task.start) + trapezoid(inside)[0][..., None] * np.subtract(task.end, task.start)
    first = start = motion.states(np.zeros(1))
    energy = ca.MX(0)
    for element in range(elements):
        x, dX = motion.states(inside[element]), opti.variable(3, points)
        torque = motion.torques(points)
        opti.subject_to(ca.vec(dX) >= 0)
        opti.set_initial(dX, reaches(task.robot, guess[element]).T)
        slope = ca.mtimes(ca.horzcat(start, x), C)
        residual, squares = point(x[:3, :], x[3:, :], slope[3:, :] / h, dX, torque)
        opti.subject_to(ca.vec(slope[:3, :] - h * x[3:, :]) == 0)
        opti.subject_to(ca.vec(residual) == 0)
        energy += h * ca.mtimes(squares, weights)
        start = x[:, -1]  # the last Radau point is the end of the element
    return motion.solve(first, start, energy, expand=True, max_time=max_time)


def shooting(task: Task, elements: int = 50, max_time: float = 60.0) -> Outcome:
    """Multiple shooting with torques that are constant on each interval."""
    motion = Motion(task)
    opti, step = motion.opti, _interval(task)
    x = motion.states(np.linspace(0.0, 1.0, elements + 1))
    torque = motion.torques(elements)
    ends = step.map(elements)(x[:, :-1], torque, motion.T / elements)
    opti.subject_to(ca.vec(ends - x[:, 1:]) == 0)
    energy = motion.T / elements * ca.sumsqr(torque)
    # expanded, four times as slow to build, and slower in all
    return motion.solve(x[:, 0], x[:, -1], energy, expand=False, max_time=max_time)


def _interval(task: Task) -> ca.Function:
    """(x, torque, h) -> x at the end of an interval of h seconds."""
    x, torque, h = ca.SX.sym("x", 6), ca.SX.sym("torque", 3), ca.SX.sym("h")

    def slope(x: ca.SX) -> ca.SX:
        return ca.vertcat(x[3:], forward_dynamics(task.robot, x[:3], x[3:], task.gear * torque))

    dt, end = h / STEPS, x
    for _ in range(STEPS):
        k1 = slope(end)
        k2 = slope(end + dt / 2 * k1)
        k3 = slope(end + dt / 2 * k2)
        k4 = slope(end + dt * k3)
        end = end + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("interval", [x, torque, h], [end], {"cse": True})
