"""The minimum-time motion of GT-A as a careful engineer writes it down for one robot: the peer of the
transcription.

Direct collocation at Radau points in the derivative form: the accelerations a of the tool (or of the path
coordinate) are the unknowns at every point, the positions and speeds there follow by two integrations, and
only those at the borders of the elements are variables. The reaches dX (m) are bounded variables with the
length of the link as their equation, so that no square root is evaluated. One SX function per point, exact
Hessian, Ipopt with MUMPS.

    y = tool position (free path) or path coordinate (line);   h = final time / elements
    y'_j = y'_0 + h sum_k A_jk a_k           y_j = y_0 + h c_j y'_0 + h^2 sum_k (A A)_jk a_k
    0 = dX^2 + dY^2 + dZ^2 - L^2             0 = M1 T'' + M2 q'' + G - W' (gear * torque - friction)
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tests.benchmarks.closed_form import friction_force
from tests.benchmarks.gta import Task, reaches, trapezoid

IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "mu_strategy": "adaptive",
    "linear_solver": "mumps",
    "max_wall_time": 60.0,
}


@dataclass(frozen=True)
class Outcome:
    """What a run of a reference program found, and how long it took."""

    time: float  # s, duration of the motion
    energy: float  # (N.m)^2.s
    iterations: int
    build: float  # s
    solve: float  # s
    success: bool
    variables: int


def butcher(points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A (k, k), b (k,) and c (k,) of the Radau IIA method."""
    c = np.array(ca.collocation_points(points, "radau"))
    powers = np.arange(1, points + 1)
    A = (c[:, None] ** powers / powers) @ np.linalg.inv(c[:, None] ** (powers - 1))
    return A, A[-1], c


def point_function(task: Task) -> ca.Function:
    """Residuals (6,) of link lengths and forces at one point, and the squared torques."""
    robot, n = task.robot, 1 if task.line else 3
    y, dy, ddy = ca.SX.sym("y", n), ca.SX.sym("dy", n), ca.SX.sym("ddy", n)
    dX, torque = ca.SX.sym("dX", 3), ca.SX.sym("torque", 3)
    along = ca.DM(task.end) - ca.DM(task.start)
    tool, velocity, acceleration = (
        (ca.DM(task.start) + y * along, dy * along, ddy * along) if task.line else (y, dy, ddy)
    )
    balance = ca.vertcat(0, 0, robot.g * robot.plate_mass) + robot.plate_mass * acceleration
    lengths = []
    for i in range(3):
        _, offset_y, offset_z = robot.offsets[i]
        dY, dZ = tool[1] - offset_y, tool[2] - offset_z
        slope_y, slope_z = dY / dX[i], dZ / dX[i]
        ahead = slope_y * velocity[1] + slope_z * velocity[2]
        centripetal = (ahead**2 + velocity[1] ** 2 + velocity[2] ** 2) / dX[i]
        ddq = acceleration[0] + slope_y * acceleration[1] + slope_z * acceleration[2] + centripetal
        net = (
            task.gear * torque[i] - friction_force(robot, i, velocity[0] + ahead) - robot.cart_masses[i] * ddq
        )
        balance -= net * ca.vertcat(1, slope_y, slope_z)
        lengths.append(dX[i] ** 2 + dY**2 + dZ**2 - robot.lengths[i] ** 2)
    residual = ca.vertcat(*lengths, balance)
    return ca.Function("point", [y, dy, ddy, dX, torque], [residual, ca.sumsqr(torque)])


class Unknowns:
    """The variables of the NLP in the order in which they are written down."""

    def __init__(self) -> None:
        self.symbols: list[ca.SX] = []
        self.values: list[np.ndarray] = []
        self.bounds: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, value: np.ndarray, lower: float = -np.inf, upper: float = np.inf) -> ca.SX:
        value = np.atleast_1d(value)
        symbol = ca.SX.sym("w", len(value))
        self.symbols.append(symbol)
        self.values.append(value)
        self.bounds.append((np.full(len(value), lower), np.full(len(value), upper)))
        return symbol


def solve(task: Task, elements: int = 50, points: int = 3) -> Outcome:
    """Build and solve the motion, both timed."""
    if any(task.robot.link_masses):
        raise ValueError("the reference program is written for massless links")
    began = time.perf_counter()
    A, b, c = butcher(points)
    A2 = A @ A
    point = point_function(task)
    first, last = (np.zeros(1), np.ones(1)) if task.line else (np.array(task.start), np.array(task.end))

    def guess(fraction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        position, speed, acceleration = (float(value) for value in trapezoid(np.array(fraction)))
        tool = np.array(task.start) + position * (np.array(task.end) - np.array(task.start))
        span, T = last - first, task.guessed_time
        return (
            first + position * span,
            speed * span / T,
            acceleration * span / T**2,
            reaches(task.robot, tool[None])[0],
        )

    unknowns, g, energy = Unknowns(), [], ca.SX(0)
    final_time = unknowns.add(np.array(task.guessed_time), 0.1, 5.0)
    h = final_time / elements
    y0, dy0 = unknowns.add(guess(0.0)[0]), unknowns.add(guess(0.0)[1])
    g += [y0 - first, dy0]
    for element in range(elements):
        a, dX, torque = [], [], []
        for j in range(points):
            _, _, acceleration, reach = guess((element + c[j]) / elements)
            a.append(unknowns.add(acceleration))
            dX.append(unknowns.add(reach, 0.0))  # an upper bound of L would lead to other branches
            torque.append(unknowns.add(np.zeros(3), -task.torque_limit, task.torque_limit))
        accelerations = ca.horzcat(*a)
        for j in range(points):
            dy = dy0 + h * (accelerations @ A[j])
            y = y0 + h * (c[j] * dy0 + h * (accelerations @ A2[j]))
            residual, squares = point(y, dy, a[j], dX[j], torque[j])
            g.append(residual)
            energy += b[j] * h * squares
        y1, dy1 = (unknowns.add(value) for value in guess((element + 1) / elements)[:2])
        g += [y0 + h * (dy0 + h * (accelerations @ (b @ A))) - y1, dy0 + h * (accelerations @ b) - dy1]
        y0, dy0 = y1, dy1
    g += [y0 - last, dy0]

    w = ca.vertcat(*unknowns.symbols)
    nlp = {"x": w, "f": final_time + task.weight * energy, "g": ca.vertcat(*g)}
    solver = ca.nlpsol("solver", "ipopt", nlp, {"ipopt": IPOPT, "print_time": False, "calc_lam_p": False})
    built = time.perf_counter()
    lower, upper = (np.concatenate(side) for side in zip(*unknowns.bounds, strict=True))
    found = solver(x0=np.concatenate(unknowns.values), lbx=lower, ubx=upper, lbg=0, ubg=0)
    solved = time.perf_counter()
    used = float(ca.Function("energy", [w], [energy])(found["x"]))
    stats = solver.stats()
    return Outcome(
        float(found["x"][0]),
        used,
        stats["iter_count"],
        built - began,
        solved - built,
        stats["success"],
        w.numel(),
    )
